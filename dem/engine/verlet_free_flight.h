#pragma once
#include "free_flight_partners.h"
#include "verlet.h"

namespace LAMMPS_NS {

// The stock velocity Verlet loop with three additions: sub-spheres may leave and enter the arrays before neighbour lists
// are built, several steps may be taken as one, and time jumps while none are there. Fix free_flight installs it.
class VerletFreeFlight : public Verlet {
 public:
  VerletFreeFlight(class LAMMPS *lmp) : Verlet(lmp, 0, nullptr) {}
  void init() override;
  void setup() override;
  void run(int) override;

 private:
  FlightControl *flight_ = nullptr;
  int stride_ = 1;      // steps of the deck that one step takes together
  double step_s_ = 0;   // of the deck
  void set_stride(int steps);
  bool is_due() const;
  void step();
  void rebuild();
};

}  // namespace LAMMPS_NS
