#include "network/bond_softening.h"

#include <algorithm>

namespace LAMMPS_NS {

void BondSoftening::weaken(Bond &b) const {
  const State &state = bonds_[b.id];
  const double left = state.left(), strength = left * state.reached;
  b = state.whole;
  for (double *value : {&b.area, &b.k_normal, &b.k_shear, &b.k_bend, &b.k_twist}) *value *= left;
  b.tensile_force *= strength;
  b.shear_force *= strength;
}

void BondSoftening::enter(const std::vector<Bond> &bonds) {
  for (const Bond &b : bonds) {
    if (!b.material->softens()) continue;
    needed_ = true;
    if (bonds_.size() <= static_cast<size_t>(b.id)) bonds_.resize(b.id + 1);
    bonds_[b.id] = {b};
  }
}

double BondSoftening::yield(const Bond &bond, double loading, double energy) {
  State &state = bonds_[bond.id];
  if (loading <= 1) return 1;  // the kernel rounded otherwise
  if (state.end == 0) state.end = bond.fracture_energy * bond.area * loading * loading / energy;
  const double before = state.left(), reached = loading * state.reached;
  if (reached >= state.end) return 0;
  state.reached = reached;
  state.changed = true;
  return state.left() / before;
}

void BondSoftening::share(MPI_Comm world, const std::function<Bond &(int)> &bond_of) {
  const int COLUMNS = 4;
  std::vector<double> mine;
  for (size_t id = 0; id < bonds_.size(); id++) {
    State &s = bonds_[id];
    if (!s.changed) continue;
    mine.insert(mine.end(), {static_cast<double>(id), s.reached, s.end, s.unshared});
    s.spent -= s.unshared;  // added below as that of any other rank is
    s.unshared = 0;
    s.changed = false;
  }
  int ranks = 0, n = mine.size(), total = 0;
  MPI_Comm_size(world, &ranks);
  std::vector<int> count(ranks), offset(ranks);
  MPI_Allgather(&n, 1, MPI_INT, count.data(), 1, MPI_INT, world);
  for (int p = 0; p < ranks; p++) offset[p] = total, total += count[p];
  std::vector<double> all(total);
  MPI_Allgatherv(mine.data(), n, MPI_DOUBLE, all.data(), count.data(), offset.data(), MPI_DOUBLE, world);
  for (int k = 0; k < total; k += COLUMNS) {
    State &s = bonds_[static_cast<size_t>(all[k])];
    s.reached = std::max(s.reached, all[k + 1]);
    s.end = std::max(s.end, all[k + 2]);
    s.spent += all[k + 3];
  }
  for (int k = 0; k < total; k += COLUMNS) weaken(bond_of(static_cast<int>(all[k])));
}

void BondSoftening::save(CheckpointWriter &out, const std::vector<Bond> &bonds) const {
  std::vector<double> states;
  for (const Bond &b : bonds) {
    if (b.material->softens()) {
      const State &s = bonds_[b.id];
      states.insert(states.end(), {s.reached, s.end, s.spent});
    } else states.insert(states.end(), 3, 0.0);
  }
  out.common("bond_softening", states);
}

void BondSoftening::restore(const CheckpointReader &in, std::vector<Bond> &bonds) {
  const std::vector<double> &states = in.common("bond_softening", 3 * bonds.size());
  for (size_t k = 0; k < bonds.size(); k++) {
    if (!bonds[k].material->softens()) continue;
    State &s = bonds_[bonds[k].id];
    s.reached = states[3 * k], s.end = states[3 * k + 1], s.spent = states[3 * k + 2];
    weaken(bonds[k]);
  }
}

}  // namespace LAMMPS_NS
