// What fix bond/parallel keeps: the quaternion that travels with each sub-sphere, restart and checkpoint.

#include <mpi.h>

#include <algorithm>
#include <cstring>

#include "atom.h"
#include "checkpoint_file.h"
#include "comm.h"
#include "error.h"
#include "fix_bond_parallel.h"
#include "memory.h"

using namespace LAMMPS_NS;

namespace {
const int STATE_COLUMNS = 13;  // of each sub-sphere in a checkpoint
}

/* --- the quaternion travels with its sub-sphere -------------------------------------------------------------- */

void FixBondParallel::grow_arrays(int nmax) { memory->grow(quaternion_, nmax, 4, "bond/parallel:quaternion"); }

void FixBondParallel::copy_arrays(int i, int j, int) {
  std::memcpy(quaternion_[j], quaternion_[i], 4 * sizeof(double));
}

void FixBondParallel::set_arrays(int i) {
  quaternion_[i][0] = 1;
  quaternion_[i][1] = quaternion_[i][2] = quaternion_[i][3] = 0;
}

int FixBondParallel::pack_exchange(int i, double *buf) {
  std::memcpy(buf, quaternion_[i], 4 * sizeof(double));
  return 4;
}

int FixBondParallel::unpack_exchange(int i, double *buf) {
  std::memcpy(quaternion_[i], buf, 4 * sizeof(double));
  return 4;
}

int FixBondParallel::pack_border(int n, int *list, double *buf) {
  for (int k = 0; k < n; k++) std::memcpy(buf + 4 * k, quaternion_[list[k]], 4 * sizeof(double));
  return 4 * n;
}

int FixBondParallel::unpack_border(int n, int first, double *buf) {
  for (int k = 0; k < n; k++) std::memcpy(quaternion_[first + k], buf + 4 * k, 4 * sizeof(double));
  return 4 * n;
}

int FixBondParallel::pack_comm(int n, int *list, double *buf, int, int *) {
  if (sends_dilatations_) {
    for (int k = 0; k < n; k++) buf[k] = atoms_[list[k]].dilatation;
    return 1;
  }
  pack_border(n, list, buf);
  return 4;
}

void FixBondParallel::unpack_comm(int n, int first, double *buf) {
  if (!sends_dilatations_) unpack_border(n, first, buf);
  else for (int k = 0; k < n; k++) atoms_[first + k].dilatation = buf[k];
}

int FixBondParallel::pack_restart(int i, double *buf) {
  buf[0] = 5;
  std::memcpy(buf + 1, quaternion_[i], 4 * sizeof(double));
  return 5;
}

void FixBondParallel::unpack_restart(int nlocal, int nth) {
  double **extra = atom->extra;
  int m = 0;
  for (int k = 0; k < nth; k++) m += static_cast<int>(extra[nlocal][m]);
  std::memcpy(quaternion_[nlocal], &extra[nlocal][m + 1], 4 * sizeof(double));
}

int FixBondParallel::size_restart(int) { return 5; }
int FixBondParallel::maxsize_restart() { return 5; }

// Global part of a restart: sums by agglomerate and which bonds hold.
void FixBondParallel::write_restart(FILE *out) {
  if (softening_.needed()) error->fix_error(FLERR, this, "bonds that soften are kept in checkpoints, not in restarts");
  if (comm->nprocs > 1) share_broken();
  const int n = agglomerates_->count();
  std::vector<double> mine, data(4 * n);
  for (const std::vector<double> *sum : {&work_, &released_, &damped_, &broken_count_})
    mine.insert(mine.end(), sum->begin(), sum->end());
  MPI_Reduce(mine.data(), data.data(), 4 * n, MPI_DOUBLE, MPI_SUM, 0, world);
  data.insert(data.end(), intact_.begin(), intact_.end());
  if (comm->me != 0) return;
  const int size = data.size() * sizeof(double);
  std::fwrite(&size, sizeof(int), 1, out);
  std::fwrite(data.data(), sizeof(double), data.size(), out);
}

void FixBondParallel::restart(char *buf) {
  const double *data = reinterpret_cast<const double *>(buf);
  const int n = agglomerates_->count();
  if (comm->me == 0)
    for (std::vector<double> *sum : {&work_, &released_, &damped_, &broken_count_}) {
      std::copy(data, data + n, sum->begin());
      data += n;
    }
  data = reinterpret_cast<const double *>(buf) + 4 * n;
  for (size_t b = 0; b < intact_.size(); b++) intact_[b] = data[b] != 0;
}

/* --- checkpoint ---------------------------------------------------------------------------------------------- */

void FixBondParallel::save(CheckpointWriter &out) {
  events_.write();
  if (comm->nprocs > 1) share_broken();
  out.sum("bond_work", work_);
  out.sum("bond_released", released_);
  out.sum("bond_damped", damped_);
  out.sum("bond_broken", broken_count_);
  std::vector<double> intact;
  for (const Bond &b : bonds_) intact.push_back(intact_[b.id]);
  out.common("bond_intact", intact);
  if (softening_.needed()) softening_.save(out, bonds_);
  std::vector<double> rows;
  rows.reserve(STATE_COLUMNS * static_cast<size_t>(atom->nlocal));
  std::vector<char> is_computed(atom->nlocal + atom->nghost, 0);
  for (int i : computed_) is_computed[i] = 1;
  for (int i = 0; i < atom->nlocal; i++) {
    if (!is_computed[i]) forces_[i] = ForceRecord();
    rows.insert(rows.end(), {static_cast<double>(atom->tag[i]), static_cast<double>(is_computed[i]),
                             static_cast<double>(is_turned_[i])});
    rows.insert(rows.end(), quaternion_[i], quaternion_[i] + 4);
    rows.insert(rows.end(), forces_[i].f, forces_[i].f + 3);
    rows.insert(rows.end(), forces_[i].torque, forces_[i].torque + 3);
  }
  out.rows("bond_atoms", rows);
}

void FixBondParallel::restore(const CheckpointReader &in) {
  const size_t n = agglomerates_->count();
  work_ = in.sum("bond_work", n);
  released_ = in.sum("bond_released", n);
  damped_ = in.sum("bond_damped", n);
  broken_count_ = in.sum("bond_broken", n);
  const std::vector<double> &intact = in.common("bond_intact", bonds_.size());
  for (size_t b = 0; b < bonds_.size(); b++) intact_[bonds_[b].id] = intact[b] != 0;
  if (softening_.needed()) softening_.restore(in, bonds_);
  changes_++;
  forces_.assign(atom->nlocal + atom->nghost + 2, ForceRecord{});
  const std::vector<double> &rows = in.rows("bond_atoms", STATE_COLUMNS);
  computed_.clear();
  is_turned_.assign(atom->nlocal, 0);
  for (size_t k = 0; k < rows.size(); k += STATE_COLUMNS) {
    const int i = atom->map(static_cast<int>(rows[k]));
    if (i < 0 || i >= atom->nlocal) continue;
    if (rows[k + 1] != 0) computed_.push_back(i);
    if (rows[k + 2] != 0) is_turned_[i] = 1;
    std::copy_n(&rows[k + 3], 4, quaternion_[i]);
    std::copy_n(&rows[k + 7], 3, forces_[i].f);
    std::copy_n(&rows[k + 10], 3, forces_[i].torque);
  }
  std::sort(computed_.begin(), computed_.end());
  list_turned();
}
