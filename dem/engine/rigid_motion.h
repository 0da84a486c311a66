#pragma once
#include <cmath>

namespace LAMMPS_NS {

struct Vec {
  double x = 0, y = 0, z = 0;
  Vec() {}
  Vec(double a, double b, double c) : x(a), y(b), z(c) {}
  explicit Vec(const double *a) : x(a[0]), y(a[1]), z(a[2]) {}
  void to(double *a) const { a[0] = x, a[1] = y, a[2] = z; }
  Vec &operator+=(const Vec &b) { return x += b.x, y += b.y, z += b.z, *this; }
};
inline Vec operator+(const Vec &a, const Vec &b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec operator-(const Vec &a, const Vec &b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec operator*(double s, const Vec &a) { return {s * a.x, s * a.y, s * a.z}; }
inline double dot(const Vec &a, const Vec &b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec cross(const Vec &a, const Vec &b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double norm(const Vec &a) { return std::sqrt(dot(a, a)); }

// Rotation as a unit quaternion (w, v).
struct Rotation {
  double w = 1;
  Vec v;
  Vec operator()(const Vec &a) const {
    const Vec t = 2 * cross(v, a);
    return a + w * t + cross(v, t);
  }
  Rotation inverse() const { return {w, -1 * v}; }
};
inline Rotation operator*(const Rotation &a, const Rotation &b) {
  return {a.w * b.w - dot(a.v, b.v), a.w * b.v + b.w * a.v + cross(a.v, b.v)};
}

// Symmetric 3 x 3 tensor.
struct Tensor {
  double xx = 0, yy = 0, zz = 0, xy = 0, xz = 0, yz = 0;
  Vec operator*(const Vec &a) const {
    return {xx * a.x + xy * a.y + xz * a.z, xy * a.x + yy * a.y + yz * a.z, xz * a.x + yz * a.y + zz * a.z};
  }
  // Inertia of a mass point at r, plus that of a sphere about its own centre, `own`.
  void add_inertia(double mass, const Vec &r, double own) {
    xx += own + mass * (r.y * r.y + r.z * r.z), yy += own + mass * (r.x * r.x + r.z * r.z);
    zz += own + mass * (r.x * r.x + r.y * r.y);
    xy -= mass * r.x * r.y, xz -= mass * r.x * r.z, yz -= mass * r.y * r.z;
  }
  Tensor inverse() const {
    const double a = yy * zz - yz * yz, b = xz * yz - xy * zz, c = xy * yz - xz * yy;
    const double d = 1 / (xx * a + xy * b + xz * c);
    return {d * a, d * (xx * zz - xz * xz), d * (xx * yy - xy * xy), d * b, d * c, d * (xy * xz - xx * yz)};
  }
  // Largest eigenvalue, by the trigonometric solution of the characteristic cubic.
  double largest() const {
    const double mean = (xx + yy + zz) / 3, a = xx - mean, b = yy - mean, c = zz - mean;
    const double size = std::sqrt((a * a + b * b + c * c + 2 * (xy * xy + xz * xz + yz * yz)) / 6);
    if (size == 0) return mean;
    const double det = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz);
    const double half = std::fmin(1, std::fmax(-1, det / (2 * size * size * size)));
    return mean + 2 * size * std::cos(std::acos(half) / 3);
  }
};

// Free flight of a rigid body: its centre of mass on the parabola, its attitude by Euler's equations of the free top
// (angular momentum constant in space, inertia constant in the body): dq/dt = omega q / 2 by the classical
// fourth-order Runge-Kutta method in turns of at most STEP_rad, whose error is that of rounding. A single sphere turns
// about a fixed axis.
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
  // Rotation since the start. To be asked for with times that never decrease.
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
