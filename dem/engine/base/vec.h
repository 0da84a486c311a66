#pragma once
#include <cmath>

namespace LAMMPS_NS {

// Vectors, rotations and tensors in space. Results of a run hang on the order of every sum to the last bit, so that
// order stands here in plain sight, and what is built of these types can be kept in a checkpoint as it lies in memory.
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

// Rotation as a unit quaternion (w, v): q a q^-1 = a + 2 w v x a + 2 v x (v x a).
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

}  // namespace LAMMPS_NS
