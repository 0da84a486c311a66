#pragma once
#include "verlet.h"

namespace LAMMPS_NS {

// The stock velocity Verlet loop with two additions: sub-spheres may leave and enter the arrays before neighbour lists
// are built, and time jumps while none are there. Installed by fix idle.
class VerletIdle : public Verlet {
 public:
  VerletIdle(class LAMMPS *lmp) : Verlet(lmp, 0, nullptr) {}
  void init() override;
  void setup() override;
  void run(int) override;

 private:
  class FixIdle *idle_ = nullptr;
  void step();
  void rebuild();
};

}  // namespace LAMMPS_NS
