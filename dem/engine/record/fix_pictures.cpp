#include "record/fix_pictures.h"

#include <mpi.h>

#include <algorithm>
#include <numeric>
#include <string>

#include "atom.h"
#include "comm.h"
#include "error.h"
#include "base/fix_input.h"
#include "base/fixes.h"
#include "bodies/flat_row.h"
#include "interfaces/stone_stream.h"
#include "update.h"

using namespace LAMMPS_NS;
using namespace FixConst;

namespace {
const int MOTION_COLUMNS = 6;  // x y z vx vy vz
const size_t CONTACT_COLUMNS = 5;
}

FixPictures::FixPictures(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg) {
  std::string agglomerates, file;
  FixInput input(lmp, this);
  input.text("agglomerates", agglomerates)
      .text("file", file)
      .whole("every", every_, 1)
      .words("impact", FixInput::ALL_THE_REST, [&](char **words, int count) {
        if (count < 3 || count % 2 == 0) input.refuse("impact: must be followed by M FIRST LAST [FIRST LAST ...]");
        impact_every_ = input.whole("impact", words[0], 1);
        for (int k = 1; k < count; k += 2)
          impacts_.push_back({input.whole("impact", words[k], 0), input.whole("impact", words[k + 1], 0)});
      })
      .read(arg, 3, narg, {"agglomerates", "file", "every"});
  nevery = std::gcd(every_, impact_every_);
  agglomerates_ = std::make_unique<Agglomerates>(lmp, this, agglomerates);
  row_of_.resize(agglomerates_->count());
  if (comm->me != 0) return;
  file_ = std::fopen(file.c_str(), "ab");
  if (!file_) error->one(FLERR, ("cannot write " + file).c_str());
}

FixPictures::~FixPictures() {
  if (file_) std::fclose(file_);
}

int FixPictures::setmask() { return END_OF_STEP; }

void FixPictures::init() {
  plate_ = fix_that_is<Pushed>(modify);
  flying_ = fix_that_is<FlyingSpheres>(modify);
  agglomerates_->init();
}

void FixPictures::setup(int) {
  if (!resuming && update->ntimestep == 0) write();
}

void FixPictures::end_of_step() {
  if (is_due()) write();
}

bool FixPictures::is_due() const {
  const bigint now = update->ntimestep;
  if (now % every_ == 0) return true;
  if (!impact_every_ || now % impact_every_ != 0) return false;
  const bool in_impact = std::any_of(impacts_.begin(), impacts_.end(), [now](const auto &impact) {
    return impact.first <= now && now <= impact.second;
  });
  return in_impact && is_pushed();
}

bool FixPictures::is_pushed() const {
  int mine = plate_ && plate_->is_pushed(), any = 0;
  MPI_Allreduce(&mine, &any, 1, MPI_INT, MPI_MAX, world);
  return any;
}

// Each sub-sphere is known to one rank, and has zeros in the sum of all others.
void FixPictures::write() {
  const std::vector<int> &near = agglomerates_->near();
  size_t count = 0;
  for (const int a : near) row_of_[a] = static_cast<int>(count), count += agglomerates_->size(a);
  std::vector<float> mine(count * MOTION_COLUMNS, 0.0f), all(comm->me == 0 ? mine.size() : 0);
  auto note = [&](int tag, const double *x, const double *v) {
    const int a = agglomerates_->of_tag(tag);
    float *row = &mine[static_cast<size_t>(row_of_[a] + tag - agglomerates_->first_tag(a)) * MOTION_COLUMNS];
    std::copy_n(x, 3, row);
    std::copy_n(v, 3, row + 3);
  };
  for (int i = 0; i < atom->nlocal; i++) note(atom->tag[i], atom->x[i], atom->v[i]);
  if (flying_) flying_->each_in_flight(note);
  MPI_Reduce(mine.data(), all.data(), mine.size(), MPI_FLOAT, MPI_SUM, 0, world);
  const std::vector<double> contacts = plate_ ? plate_->contacts_now() : std::vector<double>();
  if (comm->me != 0) return;
  const long long head[3] = {update->ntimestep, static_cast<long long>(contacts.size() / CONTACT_COLUMNS),
                             static_cast<long long>(near.size())};
  const std::vector<long long> stones(near.begin(), near.end());
  const bool written = std::fwrite(head, 8, 3, file_) == 3 && write_all(stones, file_) && write_all(all, file_) &&
                       write_all(contacts, file_);
  if (!written) error->one(FLERR, "cannot write the pictures");
}

void FixPictures::post_run() {
  if (file_ && std::fflush(file_) != 0) error->one(FLERR, "cannot write the pictures");
}
