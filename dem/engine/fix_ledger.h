#pragma once
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "agglomerates.h"
#include "checkpointed.h"
#include "fix.h"
#include "hertz_law.h"

namespace LAMMPS_NS {

// fix ID group ledger agglomerates FILE every N file FILE
//
// Where the energy of each agglomerate is, every N steps. It must come before all other fixes that add forces: what it
// finds in the force array then comes from the contacts between sub-spheres alone.
//
// File: int64 step, then double[agglomerates][columns] with the columns of fix_ledger.cpp.
class FixLedger : public Fix, public Checkpointed {
 public:
  FixLedger(class LAMMPS *, int, char **);
  ~FixLedger() override;
  int setmask() override;
  void init() override;
  void setup(int) override;
  void post_integrate() override;
  void post_force(int) override;
  void end_of_step() override;
  void post_run() override;
  void save(CheckpointWriter &) override;
  void restore(const CheckpointReader &) override;
  int every() const { return every_; }

  // Of all agglomerates at the last row. `took`: from the stones and the plate, and not held as elastic energy.
  struct Sum {
    long long step;
    double kinetic_J, mass_height_kg_m, work_on_stones_J, bonds_took_J, contacts_took_J;
  };
  Sum sum() const { return sum_; }

 private:
  struct Contact {
    int i;
    double force[3], torque[3];
  };
  std::unique_ptr<Agglomerates> agglomerates_;
  std::vector<double> pair_work_, pair_damped_;
  std::unique_ptr<HertzLaw> law_;
  std::vector<Contact> contacts_;  // sub-spheres that felt another one at the last step
  class FixBondParallel *bonds_ = nullptr;
  class FixWallPlate *wall_ = nullptr;
  class FixIdle *idle_ = nullptr;
  int every_ = 1;
  Sum sum_ = {0, 0, 0, 0, 0, 0};
  FILE *file_ = nullptr;

  template <class Visit> void each_contact(Visit visit) const;
  void add_damping();
  void write();
  void add_up(const std::vector<double> &rows);
};

}  // namespace LAMMPS_NS
