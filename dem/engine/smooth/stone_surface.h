#pragma once
#include <functional>
#include <string>
#include <vector>

#include "interfaces/agglomerates.h"
#include "interfaces/stone_stream.h"
#include "base/vec.h"

namespace LAMMPS_NS {

class LAMMPS;

// A stone as the smooth body that it stands for, and its contact with the plate. SI units.
struct SmoothStone {
  int first_tag = 0, count = 0;   // of its sub-spheres
  double radius = 0, patch_radius = 0;    // R, b
  double modulus = 0, shear_modulus = 0;  // E*, G*
  double damping_ratio = 0, damping_ratio_across = 0;  // of the dashpots along the contact axis and across it
  double friction = 0, yield_pressure = 0;             // the last one 0 where nothing yields
  // Compression of the bond network per force on the patch, along its axis and across it: about the axis that points
  // down at the start, and about others.
  double compliance_first = 0, compliance = 0, across_first = 0, across = 0;
};

// Which sub-spheres are of a stone's surface, and how those about a contact axis share a force on it: weights
//
//   w_i ~ r_i^2 (1 - rho_i^2/b^2) (1 + g . rho_i),   sum of w_i = 1,   sum of w_i rho_i = 0
//
// with the distance rho_i from the axis. dem/stones/contact_patch.py, which writes the file, has the same formula.
//
// File: the most that a smooth surface lies outside its sub-spheres, and the greatest height of a sub-sphere's lowest
// point above the plate that touches the surface in the middle of its patch. Then of each agglomerate a line with the
// numbers of SmoothStone from `count` on, and a line for each sub-sphere: its place X in the stone, radius of contact,
// mass, and 1 if it is of the surface. Where stones come with a stream (fix stones), `stream` alone.
class StoneSurfaces {
 public:
  StoneSurfaces(LAMMPS *, const std::string &file, const Agglomerates &);

  struct Weight {
    int tag;
    double weight;
  };
  // The weights of those about `axis` (in the frame of the undeformed stone) that `belong`, and into `share` how much
  // of the patch they are. Empty where they are too few to be centred on the axis.
  std::vector<Weight> weights(const SmoothStone &, const Vec &axis, const std::function<bool(int)> &belong,
                              double &share) const;

  void enter(const EnteringStone &);

  const std::vector<SmoothStone> &stones() const { return stones_; }
  const Vec &place(int tag) const { return place_[tag]; }       // X, m
  double radius(int tag) const { return radius_[tag]; }
  double mass(int tag) const { return mass_[tag]; }
  bool is_surface(int tag) const { return surface_[tag] != 0; }
  double outside() const { return outside_; }                   // of the sub-spheres lies the surface, at most, m
  double height() const { return height_; }                     // of what is in a patch above its middle, at most, m

 private:
  std::vector<SmoothStone> stones_;
  std::vector<Vec> place_;
  std::vector<double> radius_, mass_;
  std::vector<char> surface_;
  double outside_ = 0, height_ = 0;

  void read_stones(std::istream &, const Agglomerates &);
  void put(int tag, const double *row);
};

}  // namespace LAMMPS_NS
