#include "bodies/free_body.h"

#include <algorithm>

#include "bodies/array_body.h"
#include "atom.h"
#include "bodies/flat_row.h"

namespace LAMMPS_NS {

namespace {

const int NUMBERS = 26;  // before the arrays in a row

}  // namespace

FreeBody::FreeBody(const Atom *atom, ArrayBody &b, const Vec &weight, bigint step, double dt)
    : start(step), dt(dt) {
  mass = b.mass, radius = b.radius, parts_radius = b.parts_radius, outside = b.outside, agglomerate = b.agglomerate;
  faces_outside = b.faces_outside, is_still = b.is_still;
  own_surface = b.own_surface;
  motion = RigidMotion(b.center, b.velocity, weight, b.momentum, b.inertia, b.atoms.size() == 1);
  spin = motion.fastest_spin();
  kinetic_start = 0.5 * b.mass * dot(b.velocity, b.velocity) + motion.rotational_energy() + b.inner_energy;
  for (int i : b.atoms) {
    const double m = atom->rmass[i], r = atom->radius[i];
    const Vec arm = Vec(atom->x[i]) - b.center;
    parts.push_back({atom->tag[i], r, m, arm, Vec(atom->v[i]) - b.velocity - cross(b.omega, arm),
                     Vec(atom->omega[i]) - b.omega, (1 / m) * Vec(atom->f[i]) - weight,
                     (1 / (0.4 * m * r * r)) * Vec(atom->torque[i]), 0});
  }
  if (is_still)
    for (const Face &f : b.faces()) own_faces.push_back({f.x - b.center, f.height, f.normal, f.within_rad});
  go_to(step);
}

void FreeBody::append_to(std::vector<double> &row) const {
  const double numbers[] = {double(start), dt, double(agglomerate), mass, kinetic_start, bond_elastic, pair_elastic,
                            double(is_leaving), double(is_waking), double(safe_until), double(meets_at), spin, radius,
                            outside, double(parts.size()), double(packed.size()), own_surface.inner,
                            own_surface.outer, own_surface.x.x, own_surface.x.y, own_surface.x.z, faces_outside,
                            double(own_faces.size()), double(is_still), parts_radius, own_surface.patch};
  row.insert(row.end(), numbers, numbers + NUMBERS);
  append_bytes(row, &motion, 1);
  append_bytes(row, parts.data(), parts.size());
  append_bytes(row, own_faces.data(), own_faces.size());
  row.insert(row.end(), packed.begin(), packed.end());
}

FreeBody::FreeBody(const double *&row) {
  start = bigint(row[0]), dt = row[1], agglomerate = int(row[2]), mass = row[3], kinetic_start = row[4];
  bond_elastic = row[5], pair_elastic = row[6], is_leaving = row[7] != 0, is_waking = row[8] != 0;
  safe_until = bigint(row[9]), meets_at = bigint(row[10]), spin = row[11], radius = row[12], outside = row[13];
  parts.resize(size_t(row[14])), packed.resize(size_t(row[15]));
  own_surface = {Vec(row + 18), row[16], row[17], row[25]}, faces_outside = row[21];
  own_faces.resize(size_t(row[22])), is_still = row[23] != 0, parts_radius = row[24];
  row += NUMBERS;
  take_bytes(row, &motion, 1);
  take_bytes(row, parts.data(), parts.size());
  take_bytes(row, own_faces.data(), own_faces.size());
  std::copy_n(row, packed.size(), packed.begin());
  row += packed.size();
}

}  // namespace LAMMPS_NS
