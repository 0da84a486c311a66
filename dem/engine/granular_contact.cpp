#include "granular_contact.h"

#include <mpi.h>

#include <algorithm>

#include "atom.h"
#include "checkpoint_file.h"
#include "energy_holder.h"
#include "error.h"
#include "lammps.h"
#include "tangential_law.h"
#include "update.h"

namespace LAMMPS_NS {

namespace {
const int SPRING = 3;  // numbers in the history of a contact: the stretch of its tangential spring
const double AWAY_M = 1.0;  // lifts a sub-sphere that is beside the plate out of reach of the stock wall
}

GranularContact::GranularContact(LAMMPS *lmp, const Agglomerates &agglomerates, StockWall &wall,
                                 double yield_pressure_Pa)
    : lmp_(lmp), agglomerates_(agglomerates), wall_(wall), damped_(agglomerates.count(), 0.0), friction_(damped_),
      gained_(damped_), deepest_(damped_) {
  if (yield_pressure_Pa > 0)
    indentation_ = std::make_unique<PlasticIndentation>(lmp, agglomerates, yield_pressure_Pa);
}

void GranularContact::setup() {
  law_ = std::make_unique<HertzLaw>(lmp_);
  const int numbers = wall_.history_size();
  if (numbers != 0 && numbers != SPRING) lmp_->error->all(FLERR, "The plate needs a contact with `tangential history`");
}

double GranularContact::modulus(int i) const { return law_->modulus(lmp_->atom->type[i], wall_.type()); }

int GranularContact::agglomerate_of(int i) const { return agglomerates_.of_tag(lmp_->atom->tag[i]); }

void GranularContact::add_forces(std::vector<NearSphere> &near, double, int vflag) {
  move_into_frame_of_plate(near);
  wall_.act(vflag);
  move_back(near);
  if (has_springs()) measure_friction(near);
}

void GranularContact::move_into_frame_of_plate(std::vector<NearSphere> &near) {
  const Atom *atom = lmp_->atom;
  kept_z_.resize(near.size());
  springs_before_.assign(2 * near.size(), 0);
  for (size_t k = 0; k < near.size(); k++) {
    NearSphere &p = near[k];
    const int i = p.i;
    double &z = atom->x[i][2];
    const double radius = atom->radius[i];
    kept_z_[k] = z;
    z += p.is_above ? -p.plate_z : AWAY_M;
    p.overlap = p.depth = radius - z;
    if (indentation_) {
      p.overlap = indentation_->press(i, modulus(i), p.depth);
      if (p.overlap != p.depth) z = radius - p.overlap;
    }
    p.touches = p.overlap > 0;
    atom->v[i][2] -= p.plate_v;
    std::copy_n(atom->f[i], 3, p.force);
    std::copy_n(atom->torque[i], 3, p.torque);
    if (p.touches && has_springs()) std::copy_n(wall_.history(i), 2, &springs_before_[2 * k]);
  }
}

// What slip took, and what of the force is the tangential dashpot's.
void GranularContact::measure_friction(std::vector<NearSphere> &near) {
  const double dt = lmp_->update->dt;
  for (size_t k = 0; k < near.size(); k++) {
    NearSphere &p = near[k];
    if (!p.touches || p.in_patch) continue;
    const double *s = wall_.history(p.i), closing = p.plate_v - lmp_->atom->v[p.i][2];
    const Vec before(springs_before_[2 * k], springs_before_[2 * k + 1], 0), now(s[0], s[1], 0);
    const double k0 = tangential_stiffness(p.i, p.overlap - dt * closing), k1 = tangential_stiffness(p.i, p.overlap);
    const TangentialStep step = tangential_step(k0, before, k1, now, dt * surface_velocity(p));
    friction_[agglomerate_of(p.i)] += step.friction;
    gained_[agglomerate_of(p.i)] += step.gained;
    for (int d = 0; d < 2; d++) p.rubbed[d] = p.force[d] + k1 * s[d];
  }
}

double GranularContact::tangential_stiffness(int i, double overlap) const {
  return law_->tangential_stiffness(lmp_->atom->type[i], wall_.type(), lmp_->atom->radius[i], overlap);
}

// Of the sub-sphere over the plate, where they touch.
Vec GranularContact::surface_velocity(const NearSphere &p) const {
  const double *v = lmp_->atom->v[p.i], *spin = lmp_->atom->omega[p.i], arm = lmp_->atom->radius[p.i] - 0.5 * p.overlap;
  return Vec(v[0] - spin[1] * arm, v[1] + spin[0] * arm, 0);
}

void GranularContact::move_back(std::vector<NearSphere> &near) {
  const Atom *atom = lmp_->atom;
  for (size_t k = 0; k < near.size(); k++) {
    NearSphere &p = near[k];
    const int i = p.i;
    atom->x[i][2] = kept_z_[k];
    atom->v[i][2] += p.plate_v;
    if (!p.touches) continue;
    for (int d = 0; d < 3; d++) {
      p.force[d] = atom->f[i][d] - p.force[d];
      p.torque[d] = atom->torque[i][d] - p.torque[d];
    }
    p.push = p.force[2];
    double &deepest = deepest_[agglomerate_of(i)];
    deepest = std::max(deepest, p.depth / atom->radius[i]);
  }
}

void GranularContact::end_of_step(const std::vector<NearSphere> &near) {
  const Atom *atom = lmp_->atom;
  const double dt = lmp_->update->dt;
  for (const NearSphere &p : near) {
    if (!p.touches || p.in_patch) continue;
    const int i = p.i;
    const double mass = atom->rmass[i], v = atom->v[i][2] - p.plate_v, v_before = v - 0.5 * dt * atom->f[i][2] / mass;
    damped_[agglomerate_of(i)] +=
        dt * law_->damping_power(atom->type[i], wall_.type(), atom->radius[i], p.overlap, mass, v_before, v);
    if (has_springs()) damped_[agglomerate_of(i)] -= dt * dot(Vec(p.rubbed[0], p.rubbed[1], 0), surface_velocity(p));
  }
}

PlateContact::Pressing GranularContact::pressing(const NearSphere &p) const {
  const double E = modulus(p.i), R = lmp_->atom->radius[p.i];
  return {law_->normal_force(E, R, p.overlap), indentation_ ? indentation_->under(p.i, E).radius : R};
}

void GranularContact::add_to(LedgerRows &rows, const std::vector<NearSphere> &near) const {
  for (const NearSphere &p : near) {
    if (!p.touches || p.in_patch) continue;
    const double E = modulus(p.i), R = lmp_->atom->radius[p.i];
    const double left = indentation_ ? indentation_->under(p.i, E).depth : 0;
    // Hertz' 2/5 F d, which is 8/15 E* sqrt(R) d^(5/2) where nothing has yielded
    double &elastic = rows.at(agglomerate_of(p.i), WALL_ELASTIC);
    elastic += 0.4 * law_->normal_force(E, R, p.overlap) * (p.depth - left);
    if (!has_springs()) continue;
    const double *s = wall_.history(p.i);
    elastic += 0.5 * tangential_stiffness(p.i, p.overlap) * (s[0] * s[0] + s[1] * s[1]);
  }
  rows.add(WALL_DAMPED, damped_);
  rows.add(FRICTION, friction_);
  rows.add(SPRINGS, gained_);
  if (indentation_) rows.add(WALL_PLASTIC, indentation_->energy());
  rows.add(WALL_DEEPEST, deepest_);
}

void GranularContact::save(CheckpointWriter &out, const std::vector<NearSphere> &near) const {
  out.sum("wall_damped", damped_);
  out.sum("wall_friction", friction_);
  out.sum("wall_springs", gained_);
  std::vector<double> deepest(deepest_.size());
  MPI_Allreduce(deepest_.data(), deepest.data(), deepest.size(), MPI_DOUBLE, MPI_MAX, lmp_->world);
  out.common("wall_deepest", deepest);
  if (wall_.history_size() > 0) {
    std::vector<double> rows;
    for (const NearSphere &p : near) {
      if (!p.touches || p.in_patch) continue;
      rows.push_back(lmp_->atom->tag[p.i]);
      rows.insert(rows.end(), wall_.history(p.i), wall_.history(p.i) + wall_.history_size());
    }
    out.rows("wall_history", rows);
  }
  if (indentation_) indentation_->save(out);
}

void GranularContact::restore(const CheckpointReader &in) {
  damped_ = in.sum("wall_damped", damped_.size());
  friction_ = in.sum("wall_friction", friction_.size());
  gained_ = in.sum("wall_springs", gained_.size());
  deepest_ = in.common("wall_deepest", deepest_.size());
  if (wall_.history_size() > 0) {
    const int size = wall_.history_size(), columns = 1 + size;
    const std::vector<double> &rows = in.rows("wall_history", columns);
    for (size_t k = 0; k < rows.size(); k += columns) {
      const int i = lmp_->atom->map(static_cast<int>(rows[k]));
      if (i >= 0 && i < lmp_->atom->nlocal) std::copy_n(&rows[k + 1], size, wall_.history(i));
    }
  }
  if (indentation_) indentation_->restore(in);
}

}  // namespace LAMMPS_NS
