#pragma once
#include <vector>

#include "base/rigid_motion.h"

namespace LAMMPS_NS {

struct Sphere {
  Vec x;
  double radius;
};

// A smooth surface between two spheres about one point, m. All radii are 0 where there is none. It presses on the plate
// with a patch of sub-spheres no farther than `patch` from the vertical line through that point.
struct Shell {
  Vec x;
  double inner = 0, outer = 0, patch = 0;
};

// A flat face of a stone, with the sub-sphere behind it. It touches the plate only while it lies parallel to it.
struct Face {
  Vec x;                // centre of the sub-sphere, m
  double height = 0;    // from there to the face, m
  Vec normal;           // outwards
  double within_rad = 0;  // of the plate's: farther turned it cannot touch
};

// A body at one instant, as far as it matters for what it could touch and when. SI units.
class Outline {
 public:
  Vec center, velocity;  // of the centre of mass
  double mass = 0;       // kg
  double outside = 0;    // how far what touches the plate may reach beyond sub-spheres, m
  double faces_outside = 0;  // and how far its faces may, m
  bool is_still = false;     // so that it may fly among heights at which a face could touch, until one does
  double spin = 0;       // bound for |omega|, rad/s
  double radius = 0;     // of the sphere about the centre of mass that holds the body and its smooth surface
  double parts_radius = 0;  // of the one that holds its sub-spheres
  int agglomerate = 0;
  // The smooth surface with which it touches the plate and other stones, from the centre of mass.
  Shell own_surface;
  virtual ~Outline() {}
  virtual Shell surface() {
    Shell now = own_surface;
    now.x += center;
    return now;
  }
  // Its sub-spheres. They are placed when first asked for, where the sphere that holds the body is not enough.
  const std::vector<Sphere> &spheres() {
    if (spheres_.empty()) place(spheres_);
    return spheres_;
  }
  // Its faces, in the same way.
  const std::vector<Face> &faces() {
    if (!has_faces_) place_faces(faces_);
    has_faces_ = true;
    return faces_;
  }

 protected:
  virtual void place(std::vector<Sphere> &) = 0;
  virtual void place_faces(std::vector<Face> &) = 0;
  void forget_places() { spheres_.clear(), faces_.clear(), has_faces_ = false; }

 private:
  std::vector<Sphere> spheres_;
  std::vector<Face> faces_;
  bool has_faces_ = false;
};

// The plate for bodies in the air: no deflection above `reach` anywhere on the rectangle `extent`.
struct PlateOutline {
  double extent[4];  // XMIN XMAX YMIN YMAX, m
  double reach;      // m
  double patch_height;  // of the lowest sub-sphere of a smooth surface above where that presses, at most, m
};

// A wall for bodies in the air: a box that is flat along one axis, m.
struct WallOutline {
  Vec low, high;
};

double gap(Outline &, Outline &, double most);  // between sub-spheres, never negative, and `most` where it is more

// Time during which nothing can touch, s. It is a lower bound and never negative. A body is taken to be a sphere as
// long as that is enough; then each sub-sphere is looked at, which may be anywhere that the spin could bring it.
double time_to_plate(Outline &, const PlateOutline &, const Vec &gravity_m_s2);
double time_to_wall(Outline &, const WallOutline &, const Vec &gravity_m_s2);
Vec from_wall(const Vec &point, const WallOutline &);  // to the point, from the nearest one of the wall
// Between two bodies that both fly freely, so that their centres approach each other uniformly.
double time_to_meet(Outline &, Outline &);
// The same where one is not free and may gain the speed `unforeseen`, m/s.
double time_to_meet(Outline &, Outline &, double unforeseen);

}  // namespace LAMMPS_NS
