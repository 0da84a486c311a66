#include "network/sphere_motion.h"

#include "atom.h"
#include "base/quaternion.h"
#include "base/vec.h"
#include "kernels/turn_all.h"
#include "memory.h"
#include "update.h"

namespace LAMMPS_NS {

SphereMotion::~SphereMotion() { memory->destroy(quaternion); }

void SphereMotion::turn_on() {
  for (const auto &[first, count] : local_.turned())
    turn_all(quaternion[first], atom->omega[first], count, 0.5 * update->dt);
}

void SphereMotion::rotate(int i, const Rotation &turned) {
  double *q = quaternion[i];
  const Rotation now = turned * Rotation{q[0], Vec(q + 1)};
  q[0] = now.w;
  now.v.to(q + 1);
}

void SphereMotion::remember() {
  before_.resize(atom->nlocal + atom->nghost);
  const double *v = flat(atom->v), *omega = flat(atom->omega);
  for (int i : local_.computed())
    for (int k = 0; k < 3; k++) before_[i].v[k] = v[3 * i + k], before_[i].omega[k] = omega[3 * i + k];
}

// Ghosts of then may belong to this rank now.
SphereMotion::ByTag SphereMotion::before_by_tag() const {
  ByTag motion;
  if (!knows_before_) return motion;
  motion.reserve(local_.computed().size());
  for (int i : local_.computed()) motion[local_.tags()[i]] = before_[i];
  return motion;
}

void SphereMotion::take_before(const ByTag &before) {
  knows_before_ = !before.empty();
  if (!knows_before_) return;
  remember();
  for (int i : local_.computed())
    if (auto known = before.find(atom->tag[i]); known != before.end()) before_[i] = known->second;
}

namespace {
// Where a sub-sphere is after `time` with the velocities v and omega.
inline AtomRecord moved(const double *x, const double *q, const double *v, const double *omega, double time) {
  AtomRecord r;
  r.dilatation = 0;
  for (int k = 0; k < 3; k++) r.x[k] = x[k] + time * v[k];
  extrapolate(r.q, q, omega, 0.5 * time);
  return r;
}
}  // namespace

AtomRecord SphereMotion::at(int i) const { return moved(atom->x[i], quaternion[i], atom->v[i], atom->omega[i], 0); }

AtomRecord SphereMotion::at(int i, const Shift &s) const {
  const Velocities &u = before_[i];
  double v[3], omega[3];
  for (int k = 0; k < 3; k++) {
    v[k] = s.now * atom->v[i][k] + s.before * u.v[k];
    omega[k] = s.now * atom->omega[i][k] + s.before * u.omega[k];
  }
  return moved(atom->x[i], quaternion[i], v, omega, 1);
}

Vec SphereMotion::place(int i, const Shift &s) const {
  return Vec(atom->x[i]) + (s.now * Vec(atom->v[i]) + s.before * Vec(before_[i].v));
}

void SphereMotion::all_at(double time, std::vector<AtomRecord> &records) const {
  const double *x = flat(atom->x), *q = flat(quaternion), *v = flat(atom->v), *omega = flat(atom->omega);
  for (int i : local_.computed()) records[i] = moved(x + 3 * i, q + 4 * i, v + 3 * i, omega + 3 * i, time);
}

}  // namespace LAMMPS_NS
