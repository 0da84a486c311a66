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
  LEDGER_COLUMNS
};

// What this rank knows of the rows of one step.
class LedgerRows {
 public:
  explicit LedgerRows(int agglomerates) : values_(static_cast<size_t>(agglomerates) * LEDGER_COLUMNS, 0.0) {}
  double &at(int agglomerate, LedgerColumn column) { return values_[agglomerate * LEDGER_COLUMNS + column]; }
  void add(LedgerColumn column, const std::vector<double> &by_agglomerate) {
    for (size_t a = 0; a < by_agglomerate.size(); a++) values_[a * LEDGER_COLUMNS + column] += by_agglomerate[a];
  }
  const std::vector<double> &values() const { return values_; }  // [agglomerate][column]

 private:
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
