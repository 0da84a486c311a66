#pragma once
#include <vector>

#include "base/rigid_motion.h"

namespace LAMMPS_NS {

class ArrayBody;
class Atom;

// A body in LIGGGHTS's arrays that touches something and does not vibrate. It moves as a rigid body under the forces on
// its sub-spheres and its weight, and its bonds are not computed, which they need not be as long as these forces stay below its
// limits. Its deformation is frozen. The step is that of the integrator: half a kick, a drift, half a kick. SI units.
class HeldBody {
 public:
  struct Part {
    int tag;
    Vec place;       // from the centre of mass when it was taken
    double limit_N;  // of the force of contacts on this sub-sphere
  };

  // As it moves at the end of this step, with `limit_N` of all contacts together. Its inner velocities are gone.
  HeldBody(Atom *, const ArrayBody &, const std::vector<double> &part_limits_N, double limit_N);
  explicit HeldBody(const double *&row);  // as append_to left it; the row is advanced
  void append_to(std::vector<double> &row) const;

  int label() const { return label_; }
  const std::vector<Part> &parts() const { return parts_; }
  void find(const Atom *);               // after a change of the arrays
  void move(Atom *, double dt);          // the first half of the integrator's step
  void push(Atom *, double dt, const Vec &gravity);  // the second half, when the forces of contacts are known
  bool is_overloaded() const { return overloaded_; }   // by the forces of this step

 private:
  struct State {  // kept in a checkpoint as it lies in memory
    Vec center, velocity, momentum;  // angular momentum about the centre of mass
    Rotation attitude;               // since it was taken
    Tensor inverse_inertia;          // then
    Vec force, torque;               // of the last step
    double mass, limit_N;
  };
  int label_;
  State now_;
  std::vector<Part> parts_;
  std::vector<int> index_;   // local, of each part
  std::vector<Vec> arm_;
  bool overloaded_ = false;

  Vec spin(const Rotation &attitude) const;
  void add_up_forces(const Atom *, const Vec &weight_N);
  void set_velocities(Atom *, const Vec &spin) const;
};

}  // namespace LAMMPS_NS
