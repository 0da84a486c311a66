#pragma once
#include <vector>

namespace LAMMPS_NS {

// A row of the ledger, one for each agglomerate. dem/run/energy_balance.py reads the columns in this order.
enum LedgerColumn {
  KINETIC,         // translation and spin of the sub-spheres, J
  MOMENTUM_Z,      // kg m/s
  MASS_HEIGHT,     // sum of m z, kg m, for the potential energy
  BOND_ELASTIC,    // now in the bonds, J
  BOND_WORK,       // done by the bonds on the sub-spheres, J
  RELEASED,        // elastic energy of bonds at the moment they broke, J
  BOND_DAMPED,     // taken by the damping of bonds so far, J
  BROKEN,          // number of bonds
  PAIR_WORK,       // done by contacts between sub-spheres, J
  WALL_WORK,       // done by the plate on the sub-spheres, J
  PLATE_WORK,      // done by the sub-spheres on the moving plate, J
  WALL_ELASTIC,    // now in the contacts with the plate, J
  WALL_DAMPED,     // taken by their dashpots so far, J
  PAIR_ELASTIC,    // now in the contacts between sub-spheres, J
  PAIR_DAMPED,     // taken by their dashpots so far, J
  WALL_PLASTIC,    // taken by the plate's yielding under the contacts so far, J
  WALL_RELEASED,   // elastic energy of contacts with the plate whose sub-spheres broke off, J
  FRICTION,        // taken by the slip of all contacts so far, J
  SPRINGS,         // gained by their tangential springs as the normal force changed the stiffness, so far, J
  WALL_DEEPEST,    // largest overlap over radius of a contact with the plate so far; over the ranks the largest counts
  WAITED_STEPS,    // of a stone of a stream, until nothing was in its way
  LEDGER_COLUMNS
};

// What this rank knows of the rows of one step, one for each agglomerate that is near.
class LedgerRows {
 public:
  // `row` is room for a number of each agglomerate.
  LedgerRows(const std::vector<int> &near, std::vector<int> &row)
      : near_(near), row_(row), values_(near.size() * LEDGER_COLUMNS, 0.0) {
    for (size_t k = 0; k < near.size(); k++) row_[near[k]] = static_cast<int>(k);
  }
  const std::vector<int> &near() const { return near_; }  // agglomerates, ascending
  double &at(int agglomerate, LedgerColumn column) { return values_[row_[agglomerate] * LEDGER_COLUMNS + column]; }
  void add(LedgerColumn column, const std::vector<double> &by_agglomerate) {
    for (size_t k = 0; k < near_.size(); k++) values_[k * LEDGER_COLUMNS + column] += by_agglomerate[near_[k]];
  }
  const std::vector<double> &values() const { return values_; }  // [agglomerate that is near][column]

 private:
  const std::vector<int> &near_;
  std::vector<int> &row_;
  std::vector<double> values_;
};

// A fix that holds energy, or gives it to the sub-spheres or takes it from them. Fix ledger finds all of them.
class EnergyHolder {
 public:
  virtual ~EnergyHolder() {}
  // At the end of a step: adds what this rank holds now and what it gave and took so far.
  virtual void add_to(LedgerRows &) = 0;
};

}  // namespace LAMMPS_NS
