#include "outline.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace LAMMPS_NS {

namespace {

const double NEVER_s = std::numeric_limits<double>::infinity();
const double LONG_s = 2e-3;  // a time of the bounding spheres from this on is long enough as it is

// Time until a point at height z >= 0 that rises with v under gravity g is at 0.
double time_to_fall(double z, double v, double g) {
  if (z <= 0) return 0;
  if (g > 0) return (v + std::sqrt(v * v + 2 * g * z)) / g;
  return v < 0 ? -z / v : NEVER_s;
}

// Time in which something with speed v and acceleration a comes no further than `way`, in whatever direction they are.
double time_to_cross(double way, double v, double a) {
  if (way <= 0) return 0;
  return a > 0 ? (std::sqrt(v * v + 2 * a * way) - v) / a : way / v;
}

// Time until |d + v t| = distance, for |d| > distance.
double time_to_approach(const Vec &d, const Vec &v, double distance) {
  const double b = dot(d, v), c = dot(d, d) - distance * distance, a = dot(v, v);
  if (c <= 0) return 0;
  const double discriminant = b * b - a * c;
  if (b >= 0 || discriminant <= 0) return NEVER_s;
  return c / (-b + std::sqrt(discriminant));
}

double spin_speed(Outline &a) { return a.spheres().size() == 1 ? 0 : a.spin * a.radius; }

}  // namespace

double gap(Outline &a, Outline &b) {
  double least = NEVER_s;
  for (const Sphere &p : a.spheres()) {
    if (norm(p.x - b.center) - p.radius - b.radius >= least) continue;
    for (const Sphere &q : b.spheres()) least = std::min(least, norm(p.x - q.x) - p.radius - q.radius);
  }
  return std::max(0.0, least);
}

double time_to_plate(Outline &body, const PlateOutline &plate, const Vec &weight) {
  const Vec &x = body.center, &v = body.velocity;
  const double gravity = std::fabs(weight.z);
  const double *e = plate.extent;
  const double beside = std::hypot(std::max({e[0] - x.x, x.x - e[1], 0.0}), std::max({e[2] - x.y, x.y - e[3], 0.0}));
  const double across = time_to_cross(beside - body.radius, std::hypot(v.x, v.y), std::hypot(weight.x, weight.y));
  const double reach = plate.reach + body.outside;
  double down = time_to_fall(x.z - body.radius - reach, v.z, gravity);
  if (std::max(across, down) < LONG_s) {
    double lowest = NEVER_s;
    for (const Sphere &s : body.spheres()) lowest = std::min(lowest, s.x.z - s.radius);
    down = std::max(down, time_to_fall(lowest - reach, v.z - spin_speed(body), gravity));
  }
  return std::max(across, down);
}

double time_to_meet(Outline &a, Outline &b) {
  const Vec d = a.center - b.center, v = a.velocity - b.velocity;
  const double time = time_to_approach(d, v, a.radius + b.radius);
  if (time >= LONG_s) return time;
  return std::max(time, gap(a, b) / (norm(v) + spin_speed(a) + spin_speed(b)));
}

double time_to_meet(Outline &a, Outline &b, double unforeseen) {
  const double between = norm(a.center - b.center) - a.radius - b.radius;
  const double speed = norm(a.velocity - b.velocity) + unforeseen;
  if (between / speed >= LONG_s) return between / speed;
  return std::max(between, gap(a, b)) / (speed + spin_speed(a) + spin_speed(b));
}

}  // namespace LAMMPS_NS
