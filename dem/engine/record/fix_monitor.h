#pragma once
#include "interfaces/checkpointed.h"
#include "fix.h"
#include "interfaces/free_flight_partners.h"

namespace LAMMPS_NS {

// fix ID group monitor impact_J E weight W height_kg_m H
//
// Stops a run that has gone wrong, at once and with the limit that was broken:
//   - a sub-sphere moves more than a tenth of the smallest radius in a step, or its velocity is no number;
//   - energy comes from nothing, by 1 % of what the scene supplies: the kinetic energy of the impact (E, J) and what
//     gravity (W, m/s^2) did since the sum of m z was H (kg m), with what stones of a stream bring (fix stones).
// The first is looked at every ten steps and before lists of neighbours are built, the second at each row of the fix
// ledger, which must come before this one.
// Lost particles are counted by `thermo_modify lost error`.
class FixMonitor : public Fix, public Checkpointed, public ActsInFreeFlight {
 public:
  FixMonitor(class LAMMPS *, int, char **);
  int setmask() override;
  void init() override;
  void pre_exchange() override;
  void end_of_step() override;
  void save(CheckpointWriter &) override;
  void restore(const CheckpointReader &) override;

 private:
  class FixLedger *ledger_ = nullptr;
  class StoneStream *stream_ = nullptr;
  double impact_J_ = 0, weight_ = 0, height_kg_m_ = 0;
  double smallest_radius_ = 0, fallen_J_ = 0;
  long long checked_ = 0;  // row of the ledger

  void check_speed() const;
  void check_energy();
};

}  // namespace LAMMPS_NS
