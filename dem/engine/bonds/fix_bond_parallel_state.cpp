// What fix bond/parallel keeps: the quaternion that travels with each sub-sphere, and its part of a checkpoint.

#include <algorithm>
#include <cstring>

#include "atom.h"
#include "base/fix_input.h"
#include "interfaces/checkpoint_file.h"
#include "comm.h"
#include "bonds/fix_bond_parallel.h"
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

void FixBondParallel::write_restart(FILE *) {
  FixInput(lmp, this).refuse("bonds are kept by fix checkpoint, not by LIGGGHTS' restart and write_restart");
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
  known_tags_.assign(atom->tag, atom->tag + atom->nlocal + atom->nghost);
  list_turned();
}
