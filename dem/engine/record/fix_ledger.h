#pragma once
#include <cstdio>
#include <memory>
#include <vector>

#include "interfaces/agglomerates.h"
#include "interfaces/checkpointed.h"
#include "interfaces/energy_holder.h"
#include "fix.h"
#include "interfaces/free_flight_partners.h"
#include "interfaces/takes_pairs.h"
#include "laws/hertz_law.h"
#include "base/vec.h"

namespace LAMMPS_NS {

// fix ID group ledger agglomerates FILE every N file FILE [up X Y Z]
//
// Writes where the energy of each agglomerate is, every N steps. It must come before all other fixes that add forces:
// what it finds in the force array then comes from the contacts between sub-spheres alone. Other fixes tell what they
// hold by EnergyHolder. `up` is the direction against gravity, that of z if not given.
//
// File: at each such step, and the last one of the run, a row for each agglomerate that is near (fix stones; all of
// them without it): int64 step, int64 agglomerate (from 1), double[LEDGER_COLUMNS] (energy_holder.h). The last row of a
// stone that has left is the first one after that, and has what was in its pieces when they were taken out. Where none
// is near, there is a row of zeros of agglomerate 0.
class FixLedger : public Fix, public Checkpointed, public ActsInFreeFlight {
 public:
  FixLedger(class LAMMPS *, int, char **);
  ~FixLedger() override;
  int setmask() override;
  void init() override;
  void pre_force(int) override;
  void setup(int) override;
  void post_integrate() override;
  void post_force(int) override;
  void end_of_step() override;
  void post_run() override;
  void save(CheckpointWriter &) override;
  void restore(const CheckpointReader &) override;
  int acts_every() const override { return every_; }

  // Of all agglomerates that ever were there, at the last row. What bonds and contacts took from the stones and the
  // plate does not count what they hold as elastic energy, nor what tangential springs gained.
  struct Sum {
    long long step;
    double kinetic_J, mass_height_kg_m, work_on_stones_J, bonds_took_J, contacts_took_J;
    double entered_J = 0, entered_kg_m = 0;  // kinetic energy, mass times height with which stones came in until then
  };
  Sum sum() const { return sum_; }

 private:
  struct Felt {
    int i;
    double force[3], torque[3];
  };
  struct Contact {             // between two sub-spheres
    int i, j;
    double radius, overlap;    // effective radius, m
    Vec normal;                // from j to i
    double share;              // a contact with a ghost is seen by both ranks and counts half on each
    const double *history;     // the stretch of its tangential spring, or null
    Vec spring;                // that as the last step left it, m
    Vec rubbed;                // force of its tangential dashpot, N
  };
  std::unique_ptr<Agglomerates> agglomerates_;
  std::vector<double> pair_work_, pair_damped_, friction_, gained_;  // so far, by agglomerate, J: see LedgerColumn
  std::unique_ptr<HertzLaw> law_;
  std::vector<Felt> felt_;         // sub-spheres that felt another one at the last step
  std::vector<Contact> contacts_;  // of the present step; found only where some touch
  bool found_ = false;             // are contacts_ known before the forces?
  std::vector<EnergyHolder *> holders_;
  std::vector<TakesPairs *> takers_;
  class StoneStream *stream_ = nullptr;
  std::vector<int> row_of_;        // see LedgerRows
  Sum closed_ = {0, 0, 0, 0, 0, 0};  // of the stones that have left
  Vec up_ = Vec(0, 0, 1);          // against gravity
  int every_ = 1;
  Sum sum_ = {0, 0, 0, 0, 0, 0};
  FILE *file_ = nullptr;

  void find_contacts(bool touched_before);
  Vec surface_velocity(const Contact &, bool of_both = true) const;
  double spring_stiffness(const Contact &, double overlap) const;
  void count(std::vector<double> &, const Contact &, double energy) const;
  void measure_friction();
  void add_damping();
  void write();
  void add_motion(LedgerRows &) const;
  void add_contacts(LedgerRows &) const;
  std::vector<double> over_ranks(const std::vector<double> &mine) const;
  void write_rows(const LedgerRows &, const std::vector<double> &total);
  static void add_up(Sum &, const double *row);
  void close_finished(const std::vector<double> &total);
};

}  // namespace LAMMPS_NS
