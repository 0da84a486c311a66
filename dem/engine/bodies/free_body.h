#pragma once
#include <vector>

#include "lmptype.h"
#include "bodies/outline.h"
#include "base/rigid_motion.h"

namespace LAMMPS_NS {

class ArrayBody;
class Atom;

// A body in free flight, out of the arrays: what its sub-spheres were when it left, in its frame, and its rigid motion
// since. Its deformation, and what the velocities differ from rigid motion, are frozen and turn with it: nothing is
// discarded. SI units.
class FreeBody : public Outline {
 public:
  struct Part {
    int tag;
    double radius, mass;
    Vec place;                           // from the centre of mass
    Vec velocity, spin;                  // over rigid motion
    Vec acceleration, spin_acceleration; // by inner forces
    size_t packed;                       // where its record begins in `packed`
  };
  struct State {
    Vec x, v, omega, acceleration, spin_acceleration;
  };

  std::vector<Part> parts;
  std::vector<double> packed;  // records of AtomVec::pack_exchange
  std::vector<Face> own_faces;  // at the start, from the centre of mass
  RigidMotion motion;
  bigint start = 0;            // step at which it left
  double dt = 0;
  double kinetic_start = 0;    // J, inner motion included
  double bond_elastic = 0, pair_elastic = 0;  // J
  bool is_leaving = true;      // still in the arrays, leaves them in the coming step
  bool is_waking = false;      // comes back in the coming step
  // Before these steps it touches neither the plate nor another body in free flight, and no body in free flight.
  bigint safe_until = 0, meets_at = 0;

  void go_to(bigint step) {
    const double t = time(step);
    center = motion.center(t), velocity = motion.velocity(t);
    if (step_ != step) forget_places();
    step_ = step;
  }
  Vec center_at(bigint step) const { return motion.center(time(step)); }
  State state(const Part &p) {  // at the step of go_to
    const Rotation &turned = motion.attitude(time(step_));
    const Vec arm = turned(p.place), omega = motion.spin();
    return {center + arm, velocity + cross(omega, arm) + turned(p.velocity), omega + turned(p.spin),
            turned(p.acceleration), turned(p.spin_acceleration)};
  }

  // Everything, appended to a row of numbers, and back from where it stands there (advanced).
  void append_to(std::vector<double> &row) const;
  explicit FreeBody(const double *&row);
  // A body that leaves the arrays at this step. `weight` is that of 1 kg, N, dt in s.
  FreeBody(const Atom *, ArrayBody &, const Vec &weight, bigint step, double dt);

  Shell surface() override {
    Shell now = own_surface;
    now.x = center + attitude()(own_surface.x);
    return now;
  }
  const Rotation &attitude() { return motion.attitude(time(step_)); }
  double kinetic() const {
    const Vec v0 = motion.velocity(0);
    return kinetic_start + 0.5 * mass * (dot(velocity, velocity) - dot(v0, v0));
  }

 protected:
  void place(std::vector<Sphere> &spheres) override {
    const Rotation &turned = attitude();
    for (const Part &p : parts) spheres.push_back({center + turned(p.place), p.radius});
  }
  void place_faces(std::vector<Face> &faces) override {
    const Rotation &turned = attitude();
    for (const Face &f : own_faces) faces.push_back({center + turned(f.x), f.height, turned(f.normal), f.within_rad});
  }

 private:
  bigint step_ = -1;  // of go_to

  double time(bigint step) const { return (step - start) * dt; }
};

}  // namespace LAMMPS_NS
