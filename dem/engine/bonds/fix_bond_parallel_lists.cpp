// What fix bond/parallel lists when sub-spheres have moved in memory: bonds by local index, and sub-spheres with bonds.

#include <algorithm>

#include "atom.h"
#include "comm.h"
#include "error.h"
#include "bonds/fix_bond_parallel.h"

using namespace LAMMPS_NS;

// Makes the kernel's list of bonds by local index, unless nothing has moved in memory.
void FixBondParallel::rebuild() {
  if (comm->nprocs > 1) share_broken();
  const int nlocal = atom->nlocal, nall = nlocal + atom->nghost;
  const bool same = listed_ && static_cast<int>(known_tags_.size()) == nall &&
                    std::equal(known_tags_.begin(), known_tags_.end(), atom->tag);
  if (same && comm->nprocs == 1) return;
  listed_ = true;
  const std::unordered_map<int, Motion> before = motion_by_tag();
  known_tags_.assign(atom->tag, atom->tag + nall);

  local_.clear();
  std::vector<char> is_here(agglomerates_->count(), 0);
  for (int i = 0; i < nlocal; i++) is_here[agglomerates_->of_tag(atom->tag[i])] = 1;
  for (const Stretch &s : stretches_of_bonds())
    if (is_here[s.agglomerate] || !bodies_may_leave_) list_bonds(s);
  std::vector<LocalBond> computed;
  for (const LocalBond &b : local_)
    if (!held_[b.bond->tag_i]) computed.push_back(b);
  kernel_->build(computed, nall);
  list_sub_spheres(computed);
  take_motion(before);
}

// Of the step before, where it is known; ghosts of then may belong to this rank now.
std::unordered_map<int, FixBondParallel::Motion> FixBondParallel::motion_by_tag() const {
  std::unordered_map<int, Motion> motion;
  if (!knows_motion_) return motion;
  motion.reserve(computed_.size());
  for (int i : computed_) motion[known_tags_[i]] = before_[i];
  return motion;
}

void FixBondParallel::take_motion(const std::unordered_map<int, Motion> &before) {
  if (before.empty()) {
    knows_motion_ = false;
    return;
  }
  remember_motion();
  for (int i : computed_)
    if (auto known = before.find(atom->tag[i]); known != before.end()) before_[i] = known->second;
}

void FixBondParallel::list_bonds(const Stretch &stretch) {
  const int nlocal = atom->nlocal;
  for (size_t k = stretch.start; k < stretch.end; k++) {
    const Bond &b = bonds_[k];
    if (!intact_[b.id]) continue;
    const int i = atom->map(b.tag_i), j = atom->map(b.tag_j);
    const bool mine = (i >= 0 && i < nlocal) || (j >= 0 && j < nlocal);
    if (bodies_may_leave_ && i < 0 && j < 0) continue;
    if (comm->nprocs == 1 && (i < 0 || j < 0)) error->one(FLERR, "A bonded sub-sphere was lost");
    if (!mine) continue;
    if (i < 0 || j < 0) error->one(FLERR, "A bonded sub-sphere is beyond the ghost atoms of this rank");
    local_.push_back({i, j, b.id, &b});
  }
}

// Of one agglomerate each, so that those which are all in free flight cost nothing.
const std::vector<FixBondParallel::Stretch> &FixBondParallel::stretches_of_bonds() {
  if (!stretches_of_bonds_.empty()) return stretches_of_bonds_;
  for (size_t k = 0; k < bonds_.size(); k++) {
    const int a = agglomerates_->of_tag(bonds_[k].tag_i);
    if (k == 0 || a != stretches_of_bonds_.back().agglomerate) stretches_of_bonds_.push_back({a, k, k});
    stretches_of_bonds_.back().end = k + 1;
  }
  return stretches_of_bonds_;
}

void FixBondParallel::list_sub_spheres(const std::vector<LocalBond> &computed) {
  std::vector<char> is_computed(atom->nlocal + atom->nghost, 0);
  for (const LocalBond &b : computed) is_computed[b.i] = is_computed[b.j] = 1;
  is_turned_.assign(is_computed.size(), 0);
  for (const LocalBond &b : local_) is_turned_[b.i] = is_turned_[b.j] = 1;
  computed_.clear();
  for (int i = 0; i < atom->nlocal + atom->nghost; i++)
    if (is_computed[i]) computed_.push_back(i);
  is_turned_.resize(atom->nlocal);
  list_turned();
}

void FixBondParallel::list_turned() {
  turned_.clear();
  for (size_t i = 0; i < is_turned_.size(); i++) {
    if (!is_turned_[i]) continue;
    if (i == 0 || !is_turned_[i - 1]) turned_.emplace_back(i, 0);
    turned_.back().second++;
  }
}
