#include "network/local_bonds.h"

#include <algorithm>

#include "atom.h"
#include "comm.h"
#include "error.h"

namespace LAMMPS_NS {

LocalBonds::LocalBonds(LAMMPS *lmp, const StoneBonds &bonds, const Agglomerates &agglomerates)
    : Pointers(lmp), bonds_(bonds), agglomerates_(agglomerates), held_(agglomerates.tags() + 1, 0) {}

bool LocalBonds::stands() const {
  const size_t nall = atom->nlocal + atom->nghost;
  return comm->nprocs == 1 && listed_ && moves_ == bonds_.moves() && tags_.size() == nall &&
         std::equal(tags_.begin(), tags_.end(), atom->tag);
}

std::vector<LocalBond> LocalBonds::list() {
  const int nlocal = atom->nlocal;
  listed_ = true;
  moves_ = bonds_.moves();
  tags_.assign(atom->tag, atom->tag + nlocal + atom->nghost);
  all_.clear();
  std::vector<char> is_here(agglomerates_.count(), 0);
  for (int i = 0; i < nlocal; i++) is_here[agglomerates_.of_tag(atom->tag[i])] = 1;
  for (const StoneBonds::Block &b : bonds_.blocks())
    if (is_here[b.agglomerate] || !bodies_may_leave_) add(b);
  std::vector<LocalBond> computed;
  for (const LocalBond &b : all_)
    if (!held_[b.bond->tag_i]) computed.push_back(b);
  list_sub_spheres(computed);
  return computed;
}

void LocalBonds::add(const StoneBonds::Block &block) {
  const int nlocal = atom->nlocal;
  for (size_t k = block.start; k < block.start + block.count; k++) {
    const Bond &b = bonds_.all()[k];
    if (!bonds_.holds(b.id)) continue;
    const int i = atom->map(b.tag_i), j = atom->map(b.tag_j);
    const bool mine = (i >= 0 && i < nlocal) || (j >= 0 && j < nlocal);
    if (bodies_may_leave_ && i < 0 && j < 0) continue;
    if (comm->nprocs == 1 && (i < 0 || j < 0)) error->one(FLERR, "A bonded sub-sphere was lost");
    if (!mine) continue;
    if (i < 0 || j < 0) error->one(FLERR, "A bonded sub-sphere is beyond the ghost atoms of this rank");
    all_.push_back({i, j, b.id, &b});
  }
}

void LocalBonds::list_sub_spheres(const std::vector<LocalBond> &computed) {
  std::vector<char> is_computed(tags_.size(), 0);
  for (const LocalBond &b : computed) is_computed[b.i] = is_computed[b.j] = 1;
  computed_.clear();
  for (size_t i = 0; i < is_computed.size(); i++)
    if (is_computed[i]) computed_.push_back(i);
  is_turned_.assign(tags_.size(), 0);
  for (const LocalBond &b : all_) is_turned_[b.i] = is_turned_[b.j] = 1;
  is_turned_.resize(atom->nlocal);
  turned_.clear();
}

const std::vector<std::pair<int, int>> &LocalBonds::turned() {
  if (!turned_.empty()) return turned_;
  for (size_t i = 0; i < is_turned_.size(); i++) {
    if (!is_turned_[i]) continue;
    if (i == 0 || !is_turned_[i - 1]) turned_.emplace_back(i, 0);
    turned_.back().second++;
  }
  return turned_;
}

void LocalBonds::restore(const std::vector<int> &computed, const std::vector<char> &is_turned) {
  computed_ = computed;
  std::sort(computed_.begin(), computed_.end());
  tags_.assign(atom->tag, atom->tag + atom->nlocal + atom->nghost);
  is_turned_ = is_turned;
  turned_.clear();
}

}  // namespace LAMMPS_NS
