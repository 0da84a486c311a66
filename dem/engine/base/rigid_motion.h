#pragma once
#include <cmath>

#include "base/vec.h"

namespace LAMMPS_NS {

// Free flight of a rigid body, SI units. The centre of mass moves on the parabola. The attitude q follows Euler's
// equations of the free top (the angular momentum is constant in space, the inertia is constant in the body): dq/dt =
// omega q / 2 is integrated by the classical fourth-order Runge-Kutta method in turns of at most STEP_rad, so that its
// error is below that of rounding. A single sphere turns about a fixed axis.
class RigidMotion {
 public:
  RigidMotion() {}
  RigidMotion(const Vec &center, const Vec &velocity, const Vec &acceleration, const Vec &angular_momentum,
              const Tensor &inertia, bool is_sphere)
      : center_(center), velocity_(velocity), acceleration_(acceleration), momentum_(angular_momentum),
        inverse_inertia_(inertia.inverse()), is_sphere_(is_sphere) {
    fastest_ = std::sqrt(2 * rotational_energy() * inverse_inertia_.largest());
  }

  Vec center(double t) const { return center_ + t * (velocity_ + 0.5 * t * acceleration_); }
  Vec velocity(double t) const { return velocity_ + t * acceleration_; }
  // Rotation since the start. Each call must name a time that is not before that of the last call.
  const Rotation &attitude(double t) {
    if (is_sphere_) {
      const Vec omega = inverse_inertia_ * momentum_;
      const double half = 0.5 * t * norm(omega), sinc = half == 0 ? 1 : std::sin(half) / half;
      return attitude_ = {std::cos(half), 0.5 * t * sinc * omega};
    }
    const double span = t - time_;
    const int steps = static_cast<int>(std::ceil(fastest_ * span / STEP_rad));
    for (int k = 0; k < steps; k++) turn(span / steps);
    time_ = t;
    return attitude_;
  }
  Vec spin() const { return attitude_(inverse_inertia_ * attitude_.inverse()(momentum_)); }  // rad/s, at that attitude
  double rotational_energy() const { return 0.5 * dot(momentum_, spin()); }
  double fastest_spin() const { return fastest_; }  // bound for |omega| at all times: sqrt(2 E / least inertia)

 private:
  static constexpr double STEP_rad = 2e-3;
  Vec center_, velocity_, acceleration_, momentum_;
  Tensor inverse_inertia_;
  Rotation attitude_;
  double time_ = 0, fastest_ = 0;
  bool is_sphere_ = false;

  static Rotation unit(const Rotation &q) {
    const double s = 1 / std::sqrt(q.w * q.w + dot(q.v, q.v));
    return {s * q.w, s * q.v};
  }
  Rotation rate(const Rotation &q) const {
    const Vec omega = q(inverse_inertia_ * q.inverse()(momentum_));
    return Rotation{0, 0.5 * omega} * q;
  }
  static Rotation moved(const Rotation &q, double h, const Rotation &rate) {
    return unit({q.w + h * rate.w, q.v + h * rate.v});
  }
  void turn(double h) {
    const Rotation &q = attitude_;
    const Rotation a = rate(q), b = rate(moved(q, h / 2, a)), c = rate(moved(q, h / 2, b)), d = rate(moved(q, h, c));
    attitude_ = moved(q, h / 6, {a.w + 2 * b.w + 2 * c.w + d.w, a.v + 2 * b.v + 2 * c.v + d.v});
  }
};

}  // namespace LAMMPS_NS
