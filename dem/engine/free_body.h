#pragma once
#include <algorithm>
#include <cstring>
#include <type_traits>
#include <vector>

#include "lmptype.h"
#include "outline.h"
#include "rigid_motion.h"

namespace LAMMPS_NS {

// A body in free flight, out of the arrays: what its sub-spheres were when it left, in its frame, and its rigid motion
// since. Its deformation, and what the velocities differ from rigid motion, are frozen and turn with it: nothing is
// discarded. SI units.
class FreeBody : public Outline {
 public:
  struct Part {
    int tag;
    double radius, mass;
    Vec place, velocity, spin;           // from the centre of mass; over rigid motion; over rigid motion
    Vec acceleration, spin_acceleration; // by inner forces
    size_t packed;                       // where its record begins in `packed`
  };
  struct State {
    Vec x, v, omega, acceleration, spin_acceleration;
  };

  std::vector<Part> parts;
  std::vector<double> packed;  // records of AtomVec::pack_exchange
  RigidMotion motion;
  bigint start = 0;            // step at which it left
  double dt = 0;
  int agglomerate = 0;
  double mass = 0;             // kg
  double kinetic_start = 0;    // J, inner motion included
  double bond_elastic = 0, pair_elastic = 0;  // J
  bool is_leaving = true;      // still in the arrays, leaves them in the coming step
  bool is_waking = false;      // comes back in the coming step
  bigint safe_until = 0;       // touches neither the plate nor another body in free flight before this step

  void go_to(bigint step) {
    const double t = time(step);
    center = motion.center(t), velocity = motion.velocity(t);
    if (step_ != step) spheres_.clear();
    step_ = step;
  }
  State state(const Part &p) {  // at the step of go_to
    const Rotation &turned = motion.attitude(time(step_));
    const Vec arm = turned(p.place), omega = motion.spin();
    return {center + arm, velocity + cross(omega, arm) + turned(p.velocity), omega + turned(p.spin),
            turned(p.acceleration), turned(p.spin_acceleration)};
  }

  // Everything, appended to a row of numbers, and back from where it stands there (advanced).
  void append_to(std::vector<double> &row) const {
    const double numbers[] = {double(start), dt, double(agglomerate), mass, kinetic_start, bond_elastic, pair_elastic,
                              double(is_leaving), double(is_waking), double(safe_until), spin, radius,
                              double(parts.size()), double(packed.size())};
    row.insert(row.end(), numbers, numbers + NUMBERS);
    append_bytes(row, &motion, 1);
    append_bytes(row, parts.data(), parts.size());
    row.insert(row.end(), packed.begin(), packed.end());
  }
  explicit FreeBody(const double *&row) {
    start = bigint(row[0]), dt = row[1], agglomerate = int(row[2]), mass = row[3], kinetic_start = row[4];
    bond_elastic = row[5], pair_elastic = row[6], is_leaving = row[7] != 0, is_waking = row[8] != 0;
    safe_until = bigint(row[9]), spin = row[10], radius = row[11];
    parts.resize(size_t(row[12])), packed.resize(size_t(row[13]));
    row += NUMBERS;
    take_bytes(row, &motion, 1);
    take_bytes(row, parts.data(), parts.size());
    std::copy_n(row, packed.size(), packed.begin());
    row += packed.size();
  }
  FreeBody() {}

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

 private:
  static constexpr int NUMBERS = 14;
  bigint step_ = -1;

  template <class T> static void append_bytes(std::vector<double> &row, const T *from, size_t count) {
    static_assert(std::is_trivially_copyable<T>::value && sizeof(T) % sizeof(double) == 0, "kept as it lies in memory");
    const size_t at = row.size();
    row.resize(at + count * sizeof(T) / sizeof(double));
    std::memcpy(static_cast<void *>(row.data() + at), from, count * sizeof(T));
  }
  template <class T> static void take_bytes(const double *&row, T *to, size_t count) {
    std::memcpy(static_cast<void *>(to), row, count * sizeof(T));
    row += count * sizeof(T) / sizeof(double);
  }
  double time(bigint step) const { return (step - start) * dt; }
};

}  // namespace LAMMPS_NS
