#pragma once
#include <vector>

#include "kernels/bond_table.h"

namespace LAMMPS_NS {

// The dilatation theta of each sub-sphere, its relative change of volume, by the bonds that it has. A bond is a bar of
// section A and length r0. With the stretches of the bonds that hold, over all bonds that there were:
//
//   S = sum of A (r - r0),   W = sum of A r0,   theta = 3 S/W,   U = kappa (W/6) theta^2/2
//
// A uniform dilatation of all bonds is met exactly. Of a bond's length r the energy of its two ends has the gradient
// kappa A (theta_i + theta_j)/2, which is what its pull gains.
class BondVolumes {
 public:
  BondVolumes() {}
  BondVolumes(int tags) : per_stretch_(tags + 1, 0.0), stiffness_(per_stretch_), bonds_of_(tags + 1) {}
  void enter(const std::vector<Bond> &bonds);            // all those of the stones that they are of
  void leave(int first_tag, int tags);

  bool needed() const { return needed_; }
  double dilatation(int tag, double stretch) const { return per_stretch_[tag] * stretch; }
  double stretch(int tag, double dilatation) const { return dilatation / per_stretch_[tag]; }
  double energy(int tag, double stretch) const { return stiffness_[tag] * stretch * stretch; }  // J
  const std::vector<int> &bonds_of(int tag) const { return bonds_of_[tag]; }

 private:
  bool needed_ = false;        // does any bond so far feel it?
  std::vector<double> per_stretch_, stiffness_;  // by tag: 3/W, m^-3; 3 kappa/(4 W), J/m^6; 0 without such a material
  std::vector<std::vector<int>> bonds_of_;       // by tag: their numbers
};

}  // namespace LAMMPS_NS
