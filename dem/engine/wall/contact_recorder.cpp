#include "wall/contact_recorder.h"

#include <mpi.h>

#include <algorithm>

#include "atom.h"
#include "interfaces/checkpoint_file.h"
#include "comm.h"
#include "error.h"
#include "bodies/flat_row.h"
#include "lammps.h"
#include "update.h"

namespace LAMMPS_NS {

namespace {
const int RECORD_COLUMNS = 5;
}

ContactRecorder::ContactRecorder(LAMMPS *lmp, const Agglomerates &agglomerates, const std::string &forces_file,
                                 const std::string &contacts_file, int co_step, int row_steps)
    : lmp_(lmp), agglomerates_(agglomerates), push_(agglomerates.count()), co_step_(co_step), row_steps_(row_steps),
      has_contacts_(!contacts_file.empty()) {
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
  for (const NearSphere &p : near) {
    if (!p.touches) continue;
    Push &push = push_[agglomerates_.of_tag(lmp_->atom->tag[p.i])];
    const double force = share * p.push, *x = lmp_->atom->x[p.i];
    push.force += force;
    push.x += force * (x[0] + p.to_foot[0]), push.y += force * (x[1] + p.to_foot[1]);
  }
}

void ContactRecorder::end_co_step() {
  const std::vector<int> &near = agglomerates_.near();
  std::vector<Push> mine, all(near.size());
  for (const int a : near) {
    mine.push_back(push_[a]);
    push_[a] = Push();
  }
  if (lmp_->comm->nprocs > 1)
    MPI_Reduce(mine.data(), all.data(), 3 * mine.size(), MPI_DOUBLE, MPI_SUM, 0, lmp_->world);
  else all = mine;
  if (lmp_->comm->me != 0) return;
  if (std::all_of(all.begin(), all.end(), [](const Push &p) { return p.force == 0; })) return;
  const long long now = lmp_->update->ntimestep, end = (now + row_steps_ - 1) / row_steps_ * row_steps_;
  if (end != row_end_) write_row();
  row_end_ = end;
  Push sum;
  for (size_t k = 0; k < near.size(); k++) {
    if (all[k].force == 0) continue;
    add(near[k], all[k]);
    sum.force += all[k].force, sum.x += all[k].x, sum.y += all[k].y;
  }
  add(-1, sum);
  if (now == row_end_) write_row();
}

void ContactRecorder::add(int agglomerate, const Push &p) {
  Row &row = row_[agglomerate];
  row.mean += p.force * (static_cast<double>(co_step_) / row_steps_);
  row.largest = std::max(row.largest, p.force);
  row.weight += p.force, row.x += p.x, row.y += p.y;
}

void ContactRecorder::write_row() {
  for (const auto &[agglomerate, row] : row_) {
    const long long head[2] = {row_end_, agglomerate + 1};
    const double place = row.weight != 0 ? 1 / row.weight : 0;
    const double numbers[4] = {row.mean, row.largest, place * row.x, place * row.y};
    if (std::fwrite(head, 8, 2, forces_) != 2 || std::fwrite(numbers, 8, 4, forces_) != 4)
      lmp_->error->one(FLERR, "cannot write the forces on the plate");
  }
  row_.clear();
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
    mine.insert(mine.end(), {agglomerates_.of_tag(lmp_->atom->tag[p.i]) + 1.0, x[0] + p.to_foot[0],
                             x[1] + p.to_foot[1], pressing.force_N, pressing.radius_m});
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
  const long long head[2] = {lmp_->update->ntimestep, static_cast<long long>(contacts.size() / RECORD_COLUMNS)};
  if (std::fwrite(head, 8, 2, contacts_) != 2 || !write_all(contacts, contacts_))
    lmp_->error->one(FLERR, "cannot write the contacts with the plate");
}

void ContactRecorder::flush() {
  if (forces_ && lmp_->update->ntimestep >= row_end_) write_row();
  if ((forces_ && std::fflush(forces_) != 0) || (contacts_ && std::fflush(contacts_) != 0))
    lmp_->error->one(FLERR, "cannot write the forces on the plate");
}

void ContactRecorder::save(CheckpointWriter &out) {
  flush();
  std::vector<double> push, rows;
  for (const int a : agglomerates_.near()) push.insert(push.end(), {push_[a].force, push_[a].x, push_[a].y});
  for (const auto &[a, row] : row_)
    rows.insert(rows.end(), {a + 0.0, row.mean, row.largest, row.weight, row.x, row.y});
  out.sum("wall_push", push);
  out.common("wall_row_end", {row_end_ + 0.0});
  out.rows("wall_row", rows);
}

void ContactRecorder::restore(const CheckpointReader &in) {
  const std::vector<int> &near = agglomerates_.near();
  const std::vector<double> push = in.sum("wall_push", 3 * near.size()), &rows = in.rows("wall_row", 6);
  for (size_t k = 0; k < near.size(); k++) push_[near[k]] = {push[3 * k], push[3 * k + 1], push[3 * k + 2]};
  row_end_ = static_cast<long long>(in.common("wall_row_end", 1)[0]);
  row_.clear();
  for (size_t k = 0; lmp_->comm->me == 0 && k < rows.size(); k += 6)
    row_[static_cast<int>(rows[k])] = {rows[k + 1], rows[k + 2], rows[k + 3], rows[k + 4], rows[k + 5]};
}

}  // namespace LAMMPS_NS
