#include "bodies/outline.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace LAMMPS_NS {

namespace {

const double NEVER_s = std::numeric_limits<double>::infinity();
const double LONG_s = 2e-3;  // a time from this on is long enough as it is

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

// Time until something with speed v and acceleration a along a line has come the way `way`.
double time_to_travel(double way, double v, double a) {
  if (way <= 0) return 0;
  const double discriminant = v * v + 2 * a * way;
  if (discriminant < 0) return NEVER_s;
  if (v > 0) return 2 * way / (v + std::sqrt(discriminant));
  return a > 0 ? (std::sqrt(discriminant) - v) / a : NEVER_s;
}

// Time until a coordinate x is within [low, high], which it approaches with velocity v and acceleration a; `faster` is
// a speed that may add to that.
double time_into(double x, double low, double high, double v, double a, double faster) {
  if (x < low) return time_to_travel(low - x, v + faster, a);
  return time_to_travel(x - high, faster - v, -a);
}

double spin_speed(Outline &a) { return a.spheres().size() == 1 ? 0 : a.spin * a.parts_radius; }

double surface_speed(const Outline &a) { return a.spin * norm(a.own_surface.x); }

// Time until what is at an angle of this cosine can be within another angle, if it turns with `spin`.
double time_to_turn(double cosine, double within_rad, double spin) {
  const double angle = std::acos(std::clamp(cosine, -1.0, 1.0)) - within_rad;
  if (angle <= 0) return 0;
  return spin > 0 ? angle / spin : NEVER_s;
}

const Vec DOWN(0, 0, -1);

// Time until a sub-sphere can be in the patch of the smooth surface about an axis, if the two turn with `spin`. Its place
// may be off by what the stone has deformed.
double time_into_patch(const Sphere &s, const Shell &surface, const Vec &axis, double spin) {
  const Vec arm = s.x - surface.x;
  const double wide = surface.patch + surface.outer - surface.inner, far = norm(arm);
  return wide < far ? time_to_turn(dot(arm, axis) / far, std::asin(wide / far), spin) : 0;
}

// The same for any of its sub-spheres.
double time_to_patch(Outline &body, const Shell &surface, const Vec &axis, double spin) {
  double first = NEVER_s;
  for (const Sphere &s : body.spheres()) {
    if (first == 0) break;
    first = std::min(first, time_into_patch(s, surface, axis, spin));
  }
  return first;
}

// Time until sub-spheres, or smooth surfaces of two stones, can touch when the centres approach with `speed`. Surfaces
// begin to touch from outside: those that reach far into each other, as of fragments, must come apart first. And both
// need a patch about the line of their centres, which turns with `turning` at most until these are half as far apart.
double time_to_close(Outline &a, Outline &b, double speed) {
  const double fastest = speed + spin_speed(a) + spin_speed(b);
  if (fastest == 0) return NEVER_s;
  const double time = gap(a, b, LONG_s * fastest) / fastest;
  if (a.agglomerate == b.agglomerate || std::min(a.own_surface.outer, b.own_surface.outer) == 0) return time;
  const Shell p = a.surface(), q = b.surface();
  const double apart = norm(p.x - q.x), closing = speed + surface_speed(a) + surface_speed(b);
  const double between = std::max({0.0, apart - p.outer - q.outer, p.inner + q.inner - apart}) / closing;
  if (between >= time || apart == 0) return std::min(time, between);
  const Vec line = (1 / apart) * (q.x - p.x);
  const double turning = 2 * closing / apart;
  const double patches = std::max(time_to_patch(a, p, line, a.spin + turning), time_to_patch(b, q, -1 * line, b.spin + turning));
  return std::min(time, std::max(between, std::min(patches, 1 / turning)));
}

// As long as it is still each of its faces is looked at.
double time_to_touch_with_face(Outline &body, const PlateOutline &plate, double rise, double gravity) {
  double first = NEVER_s;
  if (!body.is_still) return first;
  for (const Face &face : body.faces()) {
    const double fall = time_to_fall(face.x.z - face.height - plate.reach, rise, gravity);
    if (fall < first) first = std::min(first, std::max(fall, time_to_turn(dot(face.normal, DOWN), face.within_rad, body.spin)));
  }
  return first;
}

}  // namespace

double gap(Outline &a, Outline &b, double most) {
  double least = most;
  for (const Sphere &p : a.spheres()) {
    if (norm(p.x - b.center) - p.radius - b.parts_radius >= least) continue;
    for (const Sphere &q : b.spheres()) {
      const Vec apart = p.x - q.x;
      const double radii = p.radius + q.radius, nearer = least + radii;
      if (dot(apart, apart) < nearer * nearer) least = norm(apart) - radii;
    }
  }
  return std::max(0.0, least);
}

double time_to_plate(Outline &body, const PlateOutline &plate, const Vec &weight) {
  const Vec &x = body.center, &v = body.velocity;
  const double gravity = std::fabs(weight.z);
  const double *e = plate.extent;
  const double beside = std::hypot(std::max({e[0] - x.x, x.x - e[1], 0.0}), std::max({e[2] - x.y, x.y - e[3], 0.0}));
  const double across = time_to_cross(beside - body.radius, std::hypot(v.x, v.y), std::hypot(weight.x, weight.y));
  const double most_outside = std::max(body.outside, body.faces_outside);
  double down = time_to_fall(x.z - body.radius - plate.reach - most_outside, v.z, gravity);
  if (std::max(across, down) < LONG_s) {
    double lowest = NEVER_s;
    for (const Sphere &s : body.spheres()) lowest = std::min(lowest, s.x.z - s.radius);
    const double rise = v.z - spin_speed(body);
    const double reach = plate.reach + (body.is_still ? body.outside : most_outside);
    double fine = std::min(time_to_fall(lowest - reach, rise, gravity), time_to_touch_with_face(body, plate, rise, gravity));
    if (body.own_surface.outer > 0) {
      // Where a fragment's surface would be beneath the plate, its sub-spheres may still be too high for a patch, or
      // too far aside.
      const Shell surface = body.surface();
      double patch = NEVER_s;
      for (const Sphere &s : body.spheres()) {
        const double low = time_to_fall(s.x.z - s.radius - plate.reach - plate.patch_height, rise, gravity);
        if (low < patch) patch = std::min(patch, std::max(low, time_into_patch(s, surface, DOWN, body.spin)));
      }
      const double foot = time_to_fall(surface.x.z - surface.outer - plate.reach, v.z - surface_speed(body), gravity);
      fine = std::min(fine, std::max(foot, patch));
    }
    down = std::max(down, fine);
  }
  return std::max(across, down);
}

Vec from_wall(const Vec &x, const WallOutline &wall) {
  const Vec &a = wall.low, &b = wall.high;
  return x - Vec(std::clamp(x.x, a.x, b.x), std::clamp(x.y, a.y, b.y), std::clamp(x.z, a.z, b.z));
}

// To touch it a body must come as near as its radius along each of the three axes, and one of its sub-spheres must come
// as near as its own radius along the axis of the wall.
double time_to_wall(Outline &body, const WallOutline &wall, const Vec &weight) {
  double time = 0;
  for (const auto axis : {&Vec::x, &Vec::y, &Vec::z})
    time = std::max(time, time_into(body.center.*axis, wall.low.*axis - body.radius, wall.high.*axis + body.radius,
                                    body.velocity.*axis, weight.*axis, 0));
  if (time >= LONG_s) return time;
  const auto across = wall.low.x == wall.high.x ? &Vec::x : wall.low.y == wall.high.y ? &Vec::y : &Vec::z;
  double first = NEVER_s;
  for (const Sphere &s : body.spheres())
    first = std::min(first, time_into(s.x.*across, wall.low.*across - s.radius, wall.high.*across + s.radius,
                                      body.velocity.*across, weight.*across, spin_speed(body)));
  return std::max(time, first);
}

double time_to_meet(Outline &a, Outline &b) {
  const Vec d = a.center - b.center, v = a.velocity - b.velocity;
  const double time = time_to_approach(d, v, a.radius + b.radius);
  return time >= LONG_s ? time : std::max(time, time_to_close(a, b, norm(v)));
}

double time_to_meet(Outline &a, Outline &b, double unforeseen) {
  const double speed = norm(a.velocity - b.velocity) + unforeseen;
  const double time = (norm(a.center - b.center) - a.radius - b.radius) / speed;
  return time >= LONG_s ? time : std::max(time, time_to_close(a, b, speed));
}

}  // namespace LAMMPS_NS
