#include "contact_recorder.h"

#include <mpi.h>

#include <algorithm>

#include "atom.h"
#include "checkpoint_file.h"
#include "comm.h"
#include "error.h"
#include "lammps.h"
#include "update.h"

namespace LAMMPS_NS {

namespace {
const int CONTACT_COLUMNS = 5;
}

ContactRecorder::ContactRecorder(LAMMPS *lmp, const Agglomerates &agglomerates, const std::string &forces_file,
                                 const std::string &contacts_file)
    : lmp_(lmp), agglomerates_(agglomerates), push_(agglomerates.count(), 0.0), has_contacts_(!contacts_file.empty()) {
  if (lmp->comm->me != 0) return;
  forces_ = opened(forces_file);
  if (has_contacts_) contacts_ = opened(contacts_file);
}

ContactRecorder::~ContactRecorder() {
  if (forces_) std::fclose(forces_);
  if (contacts_) std::fclose(contacts_);
}

FILE *ContactRecorder::opened(const std::string &file) const {
  FILE *out = std::fopen(file.c_str(), "ab");
  if (!out) lmp_->error->one(FLERR, ("cannot write " + file).c_str());
  return out;
}

void ContactRecorder::add_forces(const std::vector<NearSphere> &near, double share) {
  for (const NearSphere &p : near)
    if (p.touches) push_[agglomerates_.of_tag(lmp_->atom->tag[p.i])] += share * p.push;
}

void ContactRecorder::end_co_step() {
  std::vector<double> total(push_.size());
  MPI_Reduce(push_.data(), total.data(), total.size(), MPI_DOUBLE, MPI_SUM, 0, lmp_->world);
  std::fill(push_.begin(), push_.end(), 0.0);
  if (lmp_->comm->me != 0) return;
  if (std::all_of(total.begin(), total.end(), [](double f) { return f == 0; })) return;
  const long long step = lmp_->update->ntimestep;
  const bool written = std::fwrite(&step, 8, 1, forces_) == 1 &&
                       std::fwrite(total.data(), 8, total.size(), forces_) == total.size();
  if (!written) lmp_->error->one(FLERR, "cannot write the forces on the plate");
}

void ContactRecorder::record_contacts(const std::vector<NearSphere> &near, const PlateContact &contact) {
  if (!has_contacts_) return;
  const std::vector<double> all = contacts(near, contact);
  if (!all.empty()) write(all);
}

std::vector<double> ContactRecorder::contacts(const std::vector<NearSphere> &near, const PlateContact &contact) const {
  std::vector<double> mine, all;
  for (const NearSphere &p : near) {
    if (!p.touches || p.push == 0) continue;
    const double *x = lmp_->atom->x[p.i];
    const PlateContact::Pressing pressing = contact.pressing(p);
    mine.insert(mine.end(), {agglomerates_.of_tag(lmp_->atom->tag[p.i]) + 1.0, x[0], x[1], pressing.force_N,
                             pressing.radius_m});
  }
  const int ranks = lmp_->comm->nprocs, size = mine.size();
  int total = 0;
  std::vector<int> sizes(ranks), starts(ranks);
  MPI_Gather(&size, 1, MPI_INT, sizes.data(), 1, MPI_INT, 0, lmp_->world);
  for (int rank = 0; rank < ranks; rank++) starts[rank] = total, total += sizes[rank];
  all.resize(total);
  MPI_Gatherv(mine.data(), size, MPI_DOUBLE, all.data(), sizes.data(), starts.data(), MPI_DOUBLE, 0, lmp_->world);
  return all;
}

void ContactRecorder::write(const std::vector<double> &contacts) const {
  const long long head[2] = {lmp_->update->ntimestep, static_cast<long long>(contacts.size() / CONTACT_COLUMNS)};
  if (std::fwrite(head, 8, 2, contacts_) != 2 ||
      std::fwrite(contacts.data(), 8, contacts.size(), contacts_) != contacts.size())
    lmp_->error->one(FLERR, "cannot write the contacts with the plate");
}

void ContactRecorder::flush() {
  if ((forces_ && std::fflush(forces_) != 0) || (contacts_ && std::fflush(contacts_) != 0))
    lmp_->error->one(FLERR, "cannot write the forces on the plate");
}

void ContactRecorder::save(CheckpointWriter &out) {
  flush();
  out.sum("wall_push", push_);
}

void ContactRecorder::restore(const CheckpointReader &in) { push_ = in.sum("wall_push", push_.size()); }

}  // namespace LAMMPS_NS
