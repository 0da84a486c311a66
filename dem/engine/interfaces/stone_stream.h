#pragma once
#include <vector>

#include "lmptype.h"
#include "base/vec.h"

namespace LAMMPS_NS {

// A stone as it enters, read from the file of fix stones. SI units.
struct EnteringStone {
  int agglomerate = 0, first_tag = 0;
  int first_bond = 0;                // number of its first bond among those of all stones
  Vec spin;                          // of each sub-sphere, rad/s
  static const int ATOM_COLUMNS = 9, BOND_COLUMNS = 8, SURFACE_COLUMNS = 6, CONTACT_NUMBERS = 12,
                   FACE_COLUMNS = 7;
  std::vector<double> atoms;         // rows of type, diameter, density, place, velocity
  std::vector<double> bonds;         // rows of tag_i tag_j material dx dy dz radius strength_factor (bond_table.h)
  std::vector<double> contact;       // the numbers of SmoothStone from `radius` on; none where sub-spheres touch alone
  std::vector<double> surface;       // rows as in the file of surfaces (stone_surface.h)
  std::vector<double> faces;         // rows as in the file of faces (face_columns.h)
  int count() const { return static_cast<int>(atoms.size()) / ATOM_COLUMNS; }
  Vec place(int k) const { return Vec(&atoms[k * ATOM_COLUMNS + 3]); }
};

// Keeps something of each stone while that is near.
class StoneKeeper {
 public:
  virtual ~StoneKeeper() {}
  virtual void enter(const EnteringStone &) = 0;  // before neighbour lists are built
  virtual void leave(int agglomerate) = 0;        // none of its sub-spheres is there any more
};

// A body that has left the plate for good, as it was then.
struct LeftBody {
  int agglomerate, count;            // of sub-spheres
  double mass, kinetic, bond_elastic, pair_elastic;  // kg, J
  Vec center, velocity;
};

// Stones that come and go: fix stones. Without it all stones are there from the start to the end.
class StoneStream {
 public:
  virtual ~StoneStream() {}
  virtual const std::vector<int> &near() const = 0;  // agglomerates that are there, ascending
  virtual int tags_near() const = 0;                 // sub-spheres that are there, those in free flight as well
  virtual bigint next_entry() const = 0;             // step at which the next stone enters, after the present one
  // A ball about each stone that is to enter now. Spheres with their centres in it could be in the way.
  struct Ball {
    Vec center;
    double radius;
  };
  virtual std::vector<Ball> wanted() = 0;
  // They enter, where neither the arrays nor what flies, with these centres, are in the way; next after `wanted`, before
  // neighbour lists are built.
  virtual void let_enter(const std::vector<Vec> &flying) = 0;
  virtual void take_out(const LeftBody &) = 0;       // it is in the arrays no more
  virtual std::vector<int> close_finished() = 0;     // stones that have gone, and are near no more from now on
  virtual double entered_kinetic_J() const = 0;      // of all that entered so far
  virtual double entered_mass_height() const = 0;    // kg m
  virtual double smallest_radius() const = 0;        // of all sub-spheres that will ever be there, m
  virtual void take_up(const class CheckpointReader &) = 0;  // makes those enter that were near at the checkpoint
};

}  // namespace LAMMPS_NS
