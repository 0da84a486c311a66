#include "record/fix_checkpoint.h"

#include <fcntl.h>
#include <mpi.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <unordered_map>

#include "atom.h"
#include "atom_vec.h"
#include "interfaces/checkpointed.h"
#include "comm.h"
#include "error.h"
#include "base/fix_input.h"
#include "base/fixes.h"
#include "force.h"
#include "neigh_list.h"
#include "pair.h"
#include "interfaces/stone_stream.h"
#include "update.h"

using namespace LAMMPS_NS;
using namespace FixConst;

namespace {

const double LEAST_INTERVAL_s = 0.2;
const double COST_SHARE = 0.01;  // of the run's time that checkpoints may take
const int ATOM_COLUMNS = 16;     // tag, x, v, omega, force, torque

long long pair_key(int i, int j) { return static_cast<long long>(i) << 32 | static_cast<unsigned>(j); }

}  // namespace

FixCheckpoint::FixCheckpoint(LAMMPS *lmp, int narg, char **arg)
    : Fix(lmp, narg, arg), stop_time_(std::numeric_limits<double>::infinity()) {
  int resume_step = 0;
  FixInput input(lmp, this);
  input.whole("every", nevery, 1)
      .text("directory", directory_)
      .whole("resume", resume_step, 0)
      .text("identity", identity_)
      .words("walltime", 1, [&](char **words, int) {
        if (std::strcmp(words[0], "never") == 0) return;
        stop_time_ = MPI_Wtime() + input.number("walltime", words[0], Allowed::FROM_0);
      })
      .words("streams", FixInput::ALL_THE_REST, [&](char **words, int count) {
        for (int n = 0; n < count; n++) streams_.push_back({words[n]});
      })
      .read(arg, 3, narg, {"every", "directory"});
  if (comm->me == 0 && mkdir(directory_.c_str(), 0777) != 0 && errno != EEXIST)
    error->one(FLERR, ("cannot make " + directory_ + ": " + std::strerror(errno)).c_str());
  force_reneighbor = 1;
  next_reneighbor = -1;
  if (resume_step > 0) resume(resume_step);
}

int FixCheckpoint::setmask() { return END_OF_STEP; }

std::string FixCheckpoint::file(long long step) const {
  return directory_ + "/engine_" + std::to_string(step) + ".checkpoint";
}

std::vector<Checkpointed *> FixCheckpoint::others() const { return fixes_that_are<Checkpointed>(modify); }

void FixCheckpoint::init() {
  bool last = false;  // of all that must be restored
  for (int k = 0; k < modify->nfix; k++)
    last = modify->fix[k] == this || (last && !dynamic_cast<Checkpointed *>(modify->fix[k]));
  if (!last) error->fix_error(FLERR, this, "must be the last fix");
  for (Checkpointed *one : others()) one->resuming = resumed_ != nullptr;
}

// This comes last in the set-up and puts back what a resumed run must not compute anew.
void FixCheckpoint::setup(int) {
  next_time_ = MPI_Wtime() + LEAST_INTERVAL_s;
  next_reneighbor = update->ntimestep + 1;
  if (!resumed_) return;
  restore_forces();
  restore_contacts();
  for (Checkpointed *one : others()) {
    one->restore(*resumed_);
    one->resuming = false;
  }
  resumed_.reset();
}

void FixCheckpoint::end_of_step() {
  next_reneighbor = update->ntimestep + 1;
  for (Checkpointed *one : others()) one->begin_anew();
  if (update->ntimestep >= update->laststep) return;
  const double start = MPI_Wtime();
  int due[2] = {start >= next_time_, start >= stop_time_};  // by the clock of the first rank
  if (comm->nprocs > 1) MPI_Bcast(due, 2, MPI_INT, 0, world);
  if (!due[0] && !due[1]) return;
  save();
  const double end = MPI_Wtime();
  next_time_ = end + std::max(LEAST_INTERVAL_s, (end - start) / COST_SHARE);
  if (due[1]) throw Stopped{update->ntimestep};
}

/* --- taking one ---------------------------------------------------------------------------------------------- */

void FixCheckpoint::save() {
  CheckpointWriter body(lmp), out(lmp);
  save_atoms(body);
  save_contacts(body);
  for (Checkpointed *one : others()) one->save(body);  // these flush their streams
  save_streams(out);
  out.append(body);
  out.write(file(update->ntimestep), identity_);
  for (Checkpointed *one : others()) one->saved(update->ntimestep);
  saved_.push_back(update->ntimestep);
  keep_two();
}

// Only when the new one is whole, with what other programs keep beside it.
void FixCheckpoint::keep_two() {
  while (saved_.size() > 2) {
    if (comm->me == 0) unlink(file(saved_.front()).c_str());
    saved_.erase(saved_.begin());
  }
}

void FixCheckpoint::save_atoms(CheckpointWriter &out) {
  std::vector<double> rows;
  rows.reserve(static_cast<size_t>(atom->nlocal) * ATOM_COLUMNS);
  for (int i = 0; i < atom->nlocal; i++) {
    rows.push_back(atom->tag[i]);
    for (const double *vector : {atom->x[i], atom->v[i], atom->omega[i], atom->f[i], atom->torque[i]})
      rows.insert(rows.end(), vector, vector + 3);
  }
  out.rows("atoms", rows);
}

// History of the contacts between sub-spheres: tags, flag, values.
void FixCheckpoint::save_contacts(CheckpointWriter &out) {
  const NeighList *list = force->pair->list, *history = list->listgranhistory;
  if (!history) return;
  std::vector<double> rows;
  for (int k = 0; k < list->inum; k++) {
    const int i = list->ilist[k];
    for (int m = 0; m < list->numneigh[i]; m++) {
      if (!history->firstneigh[i][m]) continue;
      const double *values = history->firstdouble[i] + history->dnum * m;
      rows.insert(rows.end(), {static_cast<double>(atom->tag[i]),
                               static_cast<double>(atom->tag[list->firstneigh[i][m] & NEIGHMASK]),
                               static_cast<double>(history->firstneigh[i][m])});
      rows.insert(rows.end(), values, values + history->dnum);
    }
  }
  out.rows("contacts", rows);
}

void FixCheckpoint::save_streams(CheckpointWriter &out) {
  std::vector<double> rows(2 * streams_.size(), 0.0);
  if (comm->me == 0)
    for (size_t k = 0; k < streams_.size(); k++) {
      Stream &stream = streams_[k];
      const int descriptor = open(stream.file.c_str(), O_RDONLY);
      if (descriptor < 0) continue;  // not begun yet
      read_on(stream, descriptor);
      close(descriptor);
      rows[2 * k] = static_cast<double>(stream.length);
      rows[2 * k + 1] = stream.crc;
    }
  out.common("streams", rows);
}

// What was read for the last checkpoint is not read again: a run only appends.
void FixCheckpoint::read_on(Stream &stream, int descriptor) {
  std::vector<char> block(1 << 20);
  ssize_t some = fsync(descriptor);
  if (some == 0)
    while ((some = pread(descriptor, block.data(), block.size(), stream.length)) > 0) {
      stream.crc = crc_of(block.data(), some, stream.crc);
      stream.length += some;
    }
  if (some < 0) error->one(FLERR, ("cannot write or read " + stream.file + ": " + std::strerror(errno)).c_str());
}

/* --- resuming a run ----------------------------------------------------------------------------------------- */

void FixCheckpoint::resume(long long step) {
  resumed_ = std::make_unique<CheckpointReader>(lmp, file(step));
  saved_ = {step};
  update->ntimestep = step;
  if (auto *stream = fix_that_is<StoneStream>(modify)) stream->take_up(*resumed_);
  const std::vector<double> &rows = resumed_->rows("atoms", ATOM_COLUMNS);
  if (comm->nprocs == 1) put_in_order(rows);
  if (rows.size() != static_cast<size_t>(atom->natoms) * ATOM_COLUMNS)
    error->all(FLERR, (file(step) + ": is of another deck").c_str());
  for (size_t k = 0; k < rows.size(); k += ATOM_COLUMNS) {
    const int i = atom->map(static_cast<int>(rows[k]));
    if (i < 0 || i >= atom->nlocal) continue;  // the atoms go to their ranks at set-up
    std::copy_n(&rows[k + 1], 3, atom->x[i]);
    std::copy_n(&rows[k + 4], 3, atom->v[i]);
    std::copy_n(&rows[k + 7], 3, atom->omega[i]);
  }
  cut_streams();
}

void FixCheckpoint::cut_streams() {
  const std::vector<double> &rows = resumed_->common("streams", 2 * streams_.size());
  if (comm->me != 0) return;
  for (size_t k = 0; k < streams_.size(); k++) {
    Stream &stream = streams_[k];
    stream.length = static_cast<long long>(rows[2 * k]);
    stream.crc = static_cast<uint32_t>(rows[2 * k + 1]);
    struct stat status;
    const bool there = stat(stream.file.c_str(), &status) == 0;
    if (!there && stream.length == 0) continue;
    if (!there || status.st_size < stream.length)
      error->one(FLERR, (stream.file + ": shorter than at the checkpoint").c_str());
    if (truncate(stream.file.c_str(), static_cast<off_t>(stream.length)) != 0)
      error->one(FLERR, ("cannot cut " + stream.file + ": " + std::strerror(errno)).c_str());
  }
}

// The order in memory decides in which order forces are summed. A sub-sphere that is not among the rows was in free
// flight, and fix free_flight has it in its own part of the checkpoint.
void FixCheckpoint::put_in_order(const std::vector<double> &rows) {
  AtomVec *avec = atom->avec;
  const int kept = static_cast<int>(rows.size() / ATOM_COLUMNS);
  if (kept > atom->nlocal) return;
  if (atom->nlocal == atom->nmax) avec->grow(0);
  const int spare = atom->nlocal;
  for (int k = 0; k < kept; k++) {
    const int tag = static_cast<int>(rows[static_cast<size_t>(k) * ATOM_COLUMNS]), i = atom->map(tag);
    if (i == k) continue;
    if (i < 0) error->one(FLERR, "the checkpoint is of another deck");
    avec->copy(k, spare, 0);
    avec->copy(i, k, 0);
    avec->copy(spare, i, 0);
    atom->map_one(atom->tag[k], k);
    atom->map_one(atom->tag[i], i);
  }
  for (int i = kept; i < atom->nlocal; i++) atom->map_one(atom->tag[i], -1);
  atom->nlocal = kept;
  atom->natoms = kept;
}

void FixCheckpoint::restore_forces() {
  const std::vector<double> &rows = resumed_->rows("atoms", ATOM_COLUMNS);
  for (size_t k = 0; k < rows.size(); k += ATOM_COLUMNS) {
    const int i = atom->map(static_cast<int>(rows[k]));
    if (i < 0 || i >= atom->nlocal) continue;
    std::copy_n(&rows[k + 10], 3, atom->f[i]);
    std::copy_n(&rows[k + 13], 3, atom->torque[i]);
  }
}

void FixCheckpoint::restore_contacts() {
  const NeighList *list = force->pair->list, *history = list->listgranhistory;
  if (!history) return;
  const int dnum = history->dnum, columns = 3 + dnum;
  const std::vector<double> &rows = resumed_->rows("contacts", columns);
  std::unordered_map<long long, const double *> row_of;
  for (size_t k = 0; k < rows.size(); k += columns)
    row_of[pair_key(static_cast<int>(rows[k]), static_cast<int>(rows[k + 1]))] = &rows[k];
  for (int k = 0; k < list->inum; k++) {
    const int i = list->ilist[k];
    for (int m = 0; m < list->numneigh[i]; m++) {
      const int a = atom->tag[i], b = atom->tag[list->firstneigh[i][m] & NEIGHMASK];
      auto found = row_of.find(pair_key(a, b));
      double sign = 1;
      if (found == row_of.end()) {  // on other ranks than before a pair may be seen from its other end
        found = row_of.find(pair_key(b, a));
        sign = -1;
      }
      const double *row = found == row_of.end() ? nullptr : found->second;
      history->firstneigh[i][m] = row ? static_cast<int>(row[2]) : 0;
      for (int d = 0; d < dnum; d++) history->firstdouble[i][dnum * m + d] = row ? sign * row[3 + d] : 0.0;
    }
  }
}
