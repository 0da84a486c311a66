#include "bonds/bond_forces.h"

#include <algorithm>

namespace LAMMPS_NS {

void BondForces::list(const std::vector<LocalBond> &computed) {
  kernel_->build(computed, atom->nlocal + atom->nghost);
  failed_.resize(computed.size());
}

void BondForces::begin_step() {
  const int nall = atom->nlocal + atom->nghost;
  places_.resize(nall + 2);
  forces_.resize(nall + 2);
  rank_.motion.all_at(damping_time_, places_);
  places_[nall] = {{0, 0, 0}, {1, 0, 0, 0}, 0};  // the two ends of the empty lanes of the last pack
  places_[nall + 1] = {{1, 0, 0}, {1, 0, 0, 0}, 0};
  for (int i : rank_.local.computed()) forces_[i] = ForceRecord();
  forces_[nall] = forces_[nall + 1] = ForceRecord();
}

// Bonds of a ghost may be unknown here: its own rank says.
void BondForces::find_dilatations() {
  stretches_.resize(places_.size());
  for (int i : rank_.local.computed()) stretches_[i] = 0;
  std::fill(stretches_.end() - 2, stretches_.end(), 0.0);
  kernel_->add_stretches(places_.data(), stretches_.data());
  for (int i : rank_.local.computed())
    if (i < atom->nlocal) dilatation(i) = rank_.bonds.volumes().dilatation(atom->tag[i], stretches_[i]);
}

std::vector<int> BondForces::find() {
  const int count = kernel_->add_forces(places_.data(), forces_.data(), failed_.data());
  return std::vector<int>(failed_.begin(), failed_.begin() + count);
}

void BondForces::give() const {
  double *f = flat(atom->f), *torque = flat(atom->torque);
  for (int i : rank_.local.computed()) {
    if (i >= atom->nlocal) break;
    for (int k = 0; k < 3; k++) f[3 * i + k] += forces_[i].f[k], torque[3 * i + k] += forces_[i].torque[k];
  }
}

BondState BondForces::state(const Bond &bond) const {
  return bond_state(bond, places_[atom->map(bond.tag_i)], places_[atom->map(bond.tag_j)]);
}

void BondForces::put_back(const Bond &bond) {
  const int i = atom->map(bond.tag_i), j = atom->map(bond.tag_j);
  add_to_ends(state(bond), forces_[i], forces_[j]);
  kernel_->revive({i, j, bond.id, &bond});
}

}  // namespace LAMMPS_NS
