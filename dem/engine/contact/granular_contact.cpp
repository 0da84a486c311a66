#include "contact/granular_contact.h"

#include <mpi.h>

#include <algorithm>
#include <cmath>

#include "atom.h"
#include "interfaces/checkpoint_file.h"
#include "interfaces/energy_holder.h"
#include "error.h"
#include "lammps.h"
#include "laws/tangential_law.h"
#include "update.h"

namespace LAMMPS_NS {

namespace {
const int SPRING = 3;  // numbers in the history of a contact: the stretch of its tangential spring
const double CLEAR = 1e-6;  // of the radius: between the plate and a sub-sphere whose face does not press
const double AWAY_M = 1.0;  // lifts a member of a patch out of reach of the stock wall

// Turns the unit vector n upwards, the shortest way.
Rotation to_upright(const Vec &n) {
  if (n.z > 1 - 1e-15) return Rotation();
  if (n.z < -1 + 1e-12) return {0, Vec(1, 0, 0)};
  const double w = std::sqrt(0.5 * (1 + n.z));
  return {w, (0.5 / w) * cross(n, Vec(0, 0, 1))};
}
}  // namespace

GranularContact::GranularContact(LAMMPS *lmp, const Agglomerates &agglomerates, StockWall &wall,
                                 double yield_pressure_Pa, const std::string &name, const std::string &face_file)
    : lmp_(lmp), agglomerates_(agglomerates), wall_(wall), name_(name), damped_(agglomerates.count(), 0.0), friction_(damped_),
      gained_(damped_), deepest_(damped_) {
  if (yield_pressure_Pa > 0)
    indentation_ = std::make_unique<PlasticIndentation>(lmp, agglomerates, yield_pressure_Pa);
  if (face_file.empty()) return;
  if (indentation_) lmp->error->all(FLERR, "Faces of stones need a plate that does not yield");
  faces_ = std::make_unique<FaceColumns>(lmp, face_file, agglomerates.tags());
}

void GranularContact::setup() {
  law_ = std::make_unique<HertzLaw>(lmp_);
  const int numbers = wall_.history_size();
  if (numbers != 0 && numbers != SPRING) lmp_->error->all(FLERR, "The plate needs a contact with `tangential history`");
  if (faces_) faces_->setup();
}

void GranularContact::enter(const EnteringStone &stone) {
  if (faces_) faces_->enter(stone);
}

void GranularContact::leave(int agglomerate) {
  if (faces_) faces_->leave(agglomerates_.first_tag(agglomerate), agglomerates_.size(agglomerate));
}

void GranularContact::list(std::vector<NearSphere> &near) {
  for (NearSphere &p : near) p.outside = faces_ ? faces_->outside_of(p.i) : 0;
}

SphereMemory *GranularContact::memory() {
  return faces_ ? &faces_->memory() : indentation_ ? &indentation_->memory() : nullptr;
}

double GranularContact::modulus(int i) const { return law_->modulus(lmp_->atom->type[i], wall_.type()); }

int GranularContact::agglomerate_of(int i) const { return agglomerates_.of_tag(lmp_->atom->tag[i]); }

void GranularContact::add_forces(std::vector<NearSphere> &near, double, int vflag) {
  move_into_frame_of_plate(near);
  wall_.act(vflag);
  move_back(near);
}

void GranularContact::move_into_frame_of_plate(std::vector<NearSphere> &near) {
  const Atom *atom = lmp_->atom;
  kept_.resize(near.size());
  springs_before_.assign(2 * near.size(), 0);
  for (size_t k = 0; k < near.size(); k++) {
    NearSphere &p = near[k];
    const int i = p.i;
    double &z = atom->x[i][2], *v = atom->v[i], *spin = atom->omega[i];
    const double radius = atom->radius[i];
    const Vec off = wall_.from_wall(p);
    const double distance = norm(off);
    kept_[k] = {z, Vec(v), Vec(spin), Rotation()};
    z = p.in_patch ? AWAY_M : distance;
    p.overlap = p.depth = radius - z;
    if (indentation_) p.overlap = indentation_->press(i, modulus(i), p.depth);
    if (faces_) p.overlap = press(p, distance, off.x == 0 && off.y == 0);
    if (p.overlap != p.depth) z = radius - p.overlap;
    p.touches = p.overlap > 0;
    p.normal = distance > 0 ? (1 / distance) * off : Vec(0, 0, 1);
    if (!p.touches && p.face.force_before > 0 && has_springs()) let_go(p);
    if (!p.touches) continue;
    kept_[k].upright = to_upright(p.normal);
    kept_[k].upright(velocity_over_plate(p)).to(v);
    kept_[k].upright(Vec(spin)).to(spin);
    std::copy_n(atom->f[i], 3, p.force);
    std::copy_n(atom->torque[i], 3, p.torque);
    if (has_springs()) std::copy_n(wall_.history(i), 2, &springs_before_[2 * k]);
  }
}

// A face presses by its own law. Returns the overlap at which the sub-sphere alone would have the same force.
double GranularContact::press(NearSphere &p, double distance, bool is_over_plate) {
  p.face = faces_->press(p.i, distance, velocity_over_plate(p).z, is_over_plate);
  if (!p.face.acts) return p.overlap;
  p.depth = p.face.depth;
  return overlap_of(p.i, p.face.force());
}

double GranularContact::overlap_of(int i, double face_force) const {
  const double radius = lmp_->atom->radius[i];
  return face_force > 0 ? PlasticLaw::hertz_overlap(modulus(i), radius, face_force) : -CLEAR * radius;
}

// The depth over radius at which a sphere has the pressure on the face as its largest, 2 E*/pi sqrt(depth/radius).
double GranularContact::like_a_sphere(const NearSphere &p) const {
  const double root = M_PI * p.face.pressure() / (2 * modulus(p.i));
  return root * root;
}

// When the sub-sphere was deeper by `rise`, m.
double GranularContact::overlap_before(const NearSphere &p, double rise) const {
  if (indentation_) return indentation_->overlap_before(p.i, modulus(p.i), p.depth, p.depth + rise);
  return p.face.acts || p.face.force_before > 0 ? overlap_of(p.i, p.face.force_before) : p.overlap + rise;
}

void GranularContact::move_back(std::vector<NearSphere> &near) {
  const Atom *atom = lmp_->atom;
  for (size_t k = 0; k < near.size(); k++) {
    NearSphere &p = near[k];
    const int i = p.i;
    const Kept &kept = kept_[k];
    if (p.touches && has_springs()) measure_friction(p, &springs_before_[2 * k]);
    atom->x[i][2] = kept.z;
    if (!p.touches) continue;
    kept.v.to(atom->v[i]);
    kept.spin.to(atom->omega[i]);
    const Rotation back = kept.upright.inverse();
    const Vec force = back(Vec(atom->f[i]) - Vec(p.force)), torque = back(Vec(atom->torque[i]) - Vec(p.torque));
    (Vec(p.force) + force).to(atom->f[i]);
    (Vec(p.torque) + torque).to(atom->torque[i]);
    force.to(p.force);
    torque.to(p.torque);
    p.rubbed = back(p.rubbed);
    p.push = p.force[2];
    std::copy_n(p.force, 2, p.drag);
    double &deepest = deepest_[agglomerate_of(i)];
    deepest = std::max(deepest, p.face.acts ? like_a_sphere(p) : p.depth / atom->radius[i]);
  }
}

// In the frame of the plate: what slip took, and what of the force is the tangential dashpot's.
void GranularContact::measure_friction(NearSphere &p, const double *spring_before) {
  const Atom *atom = lmp_->atom;
  const double dt = lmp_->update->dt, *s = wall_.history(p.i), *v = atom->v[p.i], *spin = atom->omega[p.i];
  const double arm = atom->radius[p.i] - 0.5 * p.overlap;
  const Vec before(spring_before[0], spring_before[1], 0), now(s[0], s[1], 0);
  const Vec sliding(v[0] - spin[1] * arm, v[1] + spin[0] * arm, 0);
  const double k0 = tangential_stiffness(p.i, overlap_before(p, dt * v[2])), k1 = tangential_stiffness(p.i, p.overlap);
  const TangentialStep step = tangential_step(k0, before, k1, now, dt * sliding);
  friction_[agglomerate_of(p.i)] += step.friction;
  gained_[agglomerate_of(p.i)] += step.gained;
  p.rubbed = Vec(atom->f[p.i][0] - p.force[0], atom->f[p.i][1] - p.force[1], 0) + k1 * now;
}

// A face that comes free pressed a step ago by as much as it came out in one step, which is not nothing as with a sphere:
// half of that step was rubbed with the force of then.
void GranularContact::let_go(const NearSphere &p) {
  const double *s = wall_.history(p.i), before = tangential_stiffness(p.i, overlap_before(p, 0));
  const TangentialStep step = tangential_step(before, Vec(s[0], s[1], 0), 0, Vec(), lmp_->update->dt * surface_velocity(p));
  friction_[agglomerate_of(p.i)] += step.friction;
  gained_[agglomerate_of(p.i)] += step.gained;
}

double GranularContact::tangential_stiffness(int i, double overlap) const {
  return law_->tangential_stiffness(lmp_->atom->type[i], wall_.type(), lmp_->atom->radius[i], overlap);
}

Vec GranularContact::velocity_over_plate(const NearSphere &p) const {
  return Vec(lmp_->atom->v[p.i]) - Vec(p.plate_drift[0], p.plate_drift[1], p.plate_v);
}

// Of the sub-sphere over the plate, where they touch, across the normal.
Vec GranularContact::surface_velocity(const NearSphere &p) const {
  const double arm = lmp_->atom->radius[p.i] - 0.5 * p.overlap;
  const Vec v = velocity_over_plate(p);
  return v - dot(v, p.normal) * p.normal - arm * cross(Vec(lmp_->atom->omega[p.i]), p.normal);
}

void GranularContact::end_of_step(const std::vector<NearSphere> &near, std::vector<double> &) {
  const Atom *atom = lmp_->atom;
  const double dt = lmp_->update->dt;
  for (const NearSphere &p : near) {
    if (!p.touches || p.in_patch) continue;
    const int i = p.i;
    const double mass = atom->rmass[i], v = dot(velocity_over_plate(p), p.normal);
    const double v_before = v - 0.5 * dt / mass * dot(Vec(atom->f[i]), p.normal);
    damped_[agglomerate_of(i)] +=
        dt * law_->damping_power(atom->type[i], wall_.type(), atom->radius[i], p.overlap, mass, v_before, v);
    if (has_springs()) damped_[agglomerate_of(i)] -= dt * dot(p.rubbed, surface_velocity(p));
  }
}

PlateContact::Pressing GranularContact::pressing(const NearSphere &p) const {
  const double E = modulus(p.i), R = lmp_->atom->radius[p.i];
  if (p.face.acts) {  // the sphere whose largest pressure is that on the face
    const double force = law_->normal_force(E, R, p.overlap);
    return {force, std::sqrt(6 * std::pow(p.face.area / M_PI, 3)) * E / force};
  }
  return {law_->normal_force(E, R, p.overlap), indentation_ ? indentation_->under(p.i, E).radius : R};
}

void GranularContact::add_to(LedgerRows &rows, const std::vector<NearSphere> &near) const {
  add_energies(rows, near);
  rows.add(WALL_DEEPEST, deepest_);
}

void GranularContact::add_energies(LedgerRows &rows, const std::vector<NearSphere> &near) const {
  for (const NearSphere &p : near) {
    if (!p.touches || p.in_patch) continue;
    const double E = modulus(p.i), R = lmp_->atom->radius[p.i];
    const double left = indentation_ ? indentation_->under(p.i, E).depth : 0;
    // Hertz' 2/5 F d, which is 8/15 E* sqrt(R) d^(5/2) where nothing has yielded
    double &elastic = rows.at(agglomerate_of(p.i), WALL_ELASTIC);
    elastic += p.face.acts ? p.face.stored() : 0.4 * law_->normal_force(E, R, p.overlap) * (p.depth - left);
    if (!has_springs()) continue;
    const double *s = wall_.history(p.i);
    elastic += 0.5 * tangential_stiffness(p.i, p.overlap) * (s[0] * s[0] + s[1] * s[1]);
  }
  rows.add(WALL_DAMPED, damped_);
  rows.add(FRICTION, friction_);
  rows.add(SPRINGS, gained_);
  if (indentation_) rows.add(WALL_PLASTIC, indentation_->energy());
}

void GranularContact::save(CheckpointWriter &out, const std::vector<NearSphere> &near) const {
  out.sum(name_ + "_damped", damped_);
  out.sum(name_ + "_friction", friction_);
  out.sum(name_ + "_springs", gained_);
  std::vector<double> deepest(deepest_.size());
  MPI_Allreduce(deepest_.data(), deepest.data(), deepest.size(), MPI_DOUBLE, MPI_MAX, lmp_->world);
  out.common(name_ + "_deepest", deepest);
  if (wall_.history_size() > 0) {
    std::vector<double> rows;
    for (const NearSphere &p : near) {
      if (!p.touches || p.in_patch) continue;
      rows.push_back(lmp_->atom->tag[p.i]);
      rows.insert(rows.end(), wall_.history(p.i), wall_.history(p.i) + wall_.history_size());
    }
    out.rows(name_ + "_history", rows);
  }
  if (indentation_) indentation_->save(out);
  if (faces_) faces_->save(out);
}

void GranularContact::restore(const CheckpointReader &in) {
  damped_ = in.sum(name_ + "_damped", damped_.size());
  friction_ = in.sum(name_ + "_friction", friction_.size());
  gained_ = in.sum(name_ + "_springs", gained_.size());
  deepest_ = in.common(name_ + "_deepest", deepest_.size());
  if (wall_.history_size() > 0) {
    const int size = wall_.history_size(), columns = 1 + size;
    const std::vector<double> &rows = in.rows(name_ + "_history", columns);
    for (size_t k = 0; k < rows.size(); k += columns) {
      const int i = lmp_->atom->map(static_cast<int>(rows[k]));
      if (i >= 0 && i < lmp_->atom->nlocal) std::copy_n(&rows[k + 1], size, wall_.history(i));
    }
  }
  if (indentation_) indentation_->restore(in);
  if (faces_) faces_->restore(in);
}

}  // namespace LAMMPS_NS
