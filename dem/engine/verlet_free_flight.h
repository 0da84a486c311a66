#pragma once
#include "free_flight_partners.h"
#include "verlet.h"

namespace LAMMPS_NS {

// The stock velocity Verlet loop with two additions: sub-spheres may leave and enter the arrays before neighbour lists
// are built, and time jumps while none are there. Fix free_flight installs it.
class VerletFreeFlight : public Verlet {
 public:
  VerletFreeFlight(class LAMMPS *lmp) : Verlet(lmp, 0, nullptr) {}
  void init() override;
  void setup() override;
  void run(int) override;

 private:
  FlightControl *flight_ = nullptr;
  void step();
  void rebuild();
};

}  // namespace LAMMPS_NS
