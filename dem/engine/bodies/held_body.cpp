#include "bodies/held_body.h"

#include <cmath>

#include "bodies/array_body.h"
#include "atom.h"
#include "bodies/flat_row.h"
#include "base/quaternion.h"

namespace LAMMPS_NS {

namespace {
double sum_of_sizes(const Vec &a) { return std::fabs(a.x) + std::fabs(a.y) + std::fabs(a.z); }

Rotation turned(const Rotation &attitude, const Vec &spin, double time) {
  double q[4] = {attitude.w, attitude.v.x, attitude.v.y, attitude.v.z}, omega[3];
  spin.to(omega);
  turn(q, omega, 0.5 * time);
  const double s = 1 / std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  return {s * q[0], s * Vec(q + 1)};
}
}  // namespace

HeldBody::HeldBody(Atom *atom, const ArrayBody &b, const std::vector<double> &part_limits_N, double limit_N)
    : label_(b.label) {
  now_.center = b.center, now_.velocity = b.velocity, now_.momentum = b.momentum;
  now_.inverse_inertia = b.inertia.inverse();
  now_.mass = b.mass, now_.limit_N = limit_N;
  for (size_t k = 0; k < b.atoms.size(); k++) {
    const int i = b.atoms[k];
    parts_.push_back({atom->tag[i], Vec(atom->x[i]) - b.center, part_limits_N[k]});
    arm_.push_back(parts_.back().place);
  }
  index_ = b.atoms;
  add_up_forces(atom, Vec());  // they hold the weight of this step
  set_velocities(atom, spin(now_.attitude));
}

HeldBody::HeldBody(const double *&row) {
  label_ = static_cast<int>(row[0]);
  parts_.resize(static_cast<size_t>(row[1]));
  row += 2;
  take_bytes(row, &now_, 1);
  for (Part &p : parts_) {
    p = {static_cast<int>(row[0]), Vec(row + 1), row[4]};
    row += 5;
    arm_.push_back(now_.attitude(p.place));
  }
  index_.assign(parts_.size(), -1);
}

void HeldBody::append_to(std::vector<double> &row) const {
  row.insert(row.end(), {static_cast<double>(label_), static_cast<double>(parts_.size())});
  append_bytes(row, &now_, 1);
  for (const Part &p : parts_)
    row.insert(row.end(), {static_cast<double>(p.tag), p.place.x, p.place.y, p.place.z, p.limit_N});
}

void HeldBody::find(const Atom *atom) {
  for (size_t k = 0; k < parts_.size(); k++) index_[k] = const_cast<Atom *>(atom)->map(parts_[k].tag);
}

Vec HeldBody::spin(const Rotation &attitude) const {
  return attitude(now_.inverse_inertia * attitude.inverse()(now_.momentum));
}

// The drift turns by the spin of its middle. The rows of LIGGGHTS's arrays lie beside each other in memory.
void HeldBody::move(Atom *atom, double dt) {
  now_.velocity += 0.5 * dt / now_.mass * now_.force;
  now_.momentum += 0.5 * dt * now_.torque;
  now_.center += dt * now_.velocity;
  const Vec in_middle = spin(turned(now_.attitude, spin(now_.attitude), 0.5 * dt));
  now_.attitude = turned(now_.attitude, in_middle, dt);
  const Vec center = now_.center;
  const Vec ex = now_.attitude(Vec(1, 0, 0)), ey = now_.attitude(Vec(0, 1, 0)), ez = now_.attitude(Vec(0, 0, 1));
  double *x = atom->x[0];
  for (size_t k = 0; k < parts_.size(); k++) {
    const Vec place = parts_[k].place;
    arm_[k] = place.x * ex + place.y * ey + place.z * ez;
    (center + arm_[k]).to(x + 3 * index_[k]);
  }
  set_velocities(atom, in_middle);
}

void HeldBody::push(Atom *atom, double dt, const Vec &gravity) {
  add_up_forces(atom, now_.mass * gravity);
  now_.velocity += 0.5 * dt / now_.mass * now_.force;
  now_.momentum += 0.5 * dt * now_.torque;
  set_velocities(atom, spin(now_.attitude));
}

void HeldBody::add_up_forces(const Atom *atom, const Vec &weight_N) {
  const double *f = atom->f[0], *t = atom->torque[0];
  Vec all = weight_N, turning;
  double pushed_N = 0;
  overloaded_ = false;
  for (size_t k = 0; k < parts_.size(); k++) {
    const Vec force(f + 3 * index_[k]), torque(t + 3 * index_[k]);
    if (sum_of_sizes(force) + sum_of_sizes(torque) == 0) continue;  // most of them touch nothing
    all += force;
    turning += cross(arm_[k], force) + torque;
    const double size = norm(force);
    overloaded_ = overloaded_ || size > parts_[k].limit_N;
    pushed_N += size;
  }
  overloaded_ = overloaded_ || pushed_N > now_.limit_N;
  now_.force = all, now_.torque = turning;
}

void HeldBody::set_velocities(Atom *atom, const Vec &spin) const {
  double *v = atom->v[0], *omega = atom->omega[0];
  const Vec velocity = now_.velocity, turning = spin;
  for (size_t k = 0; k < parts_.size(); k++) {
    (velocity + cross(turning, arm_[k])).to(v + 3 * index_[k]);
    turning.to(omega + 3 * index_[k]);
  }
}

}  // namespace LAMMPS_NS
