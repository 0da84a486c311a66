#pragma once
#include "interfaces/free_flight_partners.h"
#include "flight/neighbour_lists.h"
#include "verlet.h"

namespace LAMMPS_NS {

// The stock velocity Verlet loop with three additions: sub-spheres may leave and enter the arrays before neighbour lists
// are built, time jumps while none are there, and the lists know of bodies (NeighbourLists). Fix free_flight installs it.
class VerletFreeFlight : public Verlet {
 public:
  VerletFreeFlight(class LAMMPS *lmp) : Verlet(lmp, 0, nullptr), lists_(lmp) {}
  void init() override;
  void setup() override;
  void run(int) override;

 private:
  FlightControl *flight_ = nullptr;
  NeighbourLists lists_;
  void step();
  void rebuild();
};

}  // namespace LAMMPS_NS
