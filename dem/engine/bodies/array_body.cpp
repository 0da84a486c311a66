#include "bodies/array_body.h"

#include <algorithm>

#include "atom.h"

namespace LAMMPS_NS {

namespace {
const size_t LEAST_HOST = 20;     // sub-spheres of a body that has cracks
const double FRAGMENT_GAP = 0.1;  // a fragment is trapped when it is nearer than this share of its sub-sphere's radius
}  // namespace

double ArrayBody::own_inertia(int i) const { return 0.4 * atom_->rmass[i] * atom_->radius[i] * atom_->radius[i]; }

void ArrayBody::place(std::vector<Sphere> &spheres) {
  for (int i : atoms) spheres.push_back({Vec(atom_->x[i]), atom_->radius[i]});
}

void ArrayBody::place_faces(std::vector<Face> &faces) {
  if (!plate) return;
  for (int i : atoms) plate->add_faces(i, faces);
}

void ArrayBody::measure() {
  mass = inner_energy = parts_radius = 0;
  center = velocity = momentum = Vec();
  inertia = Tensor();
  for (int i : atoms) {
    mass += atom_->rmass[i];
    center += atom_->rmass[i] * Vec(atom_->x[i]);
    velocity += atom_->rmass[i] * Vec(atom_->v[i]);
  }
  center = (1 / mass) * center, velocity = (1 / mass) * velocity;
  for (int i : atoms) {
    const double m = atom_->rmass[i];
    const Vec arm = Vec(atom_->x[i]) - center;
    inertia.add_inertia(m, arm, own_inertia(i));
    momentum += m * cross(arm, Vec(atom_->v[i]) - velocity) + own_inertia(i) * Vec(atom_->omega[i]);
    parts_radius = std::max(parts_radius, norm(arm) + atom_->radius[i]);
  }
  radius = parts_radius;
  omega = inertia.inverse() * momentum;
  spin = norm(omega);
  inner_energy = energy_over(*this);
}

void ArrayBody::take_trapped() {
  for (const ArrayBody *fragment : trapped) atoms.insert(atoms.end(), fragment->atoms.begin(), fragment->atoms.end());
  std::sort(atoms.begin(), atoms.end());
  forget_places();
  measure();
}

double ArrayBody::energy_over(const ArrayBody &host) const {
  double energy = 0;
  for (int i : atoms) {
    const Vec v = Vec(atom_->v[i]) - host.velocity - cross(host.omega, Vec(atom_->x[i]) - host.center);
    const Vec w = Vec(atom_->omega[i]) - host.omega;
    energy += 0.5 * (atom_->rmass[i] * dot(v, v) + own_inertia(i) * dot(w, w));
  }
  return energy;
}

std::vector<ArrayBody> bodies_in_arrays(const Atom *atom, int tags, const std::function<int(int)> &label_of) {
  std::vector<ArrayBody> bodies;
  static std::vector<int> index;  // all -1 between two calls, so that a call costs nothing for what is not there
  index.resize(tags + 1, -1);
  for (int i = 0; i < atom->nlocal; i++) {
    const int label = label_of(atom->tag[i]);
    if (index[label] < 0) {
      index[label] = bodies.size();
      bodies.emplace_back(atom, label);
    }
    bodies[index[label]].atoms.push_back(i);
  }
  for (ArrayBody &b : bodies) index[b.label] = -1, b.measure();
  return bodies;
}

namespace {
bool is_near(ArrayBody &fragment, ArrayBody &host) {
  if (norm(fragment.center - host.center) > host.radius + 2 * fragment.radius) return false;
  const double limit = FRAGMENT_GAP * fragment.spheres()[0].radius;
  bool near = gap(fragment, host, limit) < limit;
  for (ArrayBody *other : host.trapped) near = near || gap(fragment, *other, limit) < limit;
  return near;
}
}  // namespace

void find_trapped(std::vector<ArrayBody> &bodies, const Agglomerates &agglomerates, const MayFlyAlong &may_fly_along) {
  std::vector<ArrayBody *> hosts;
  for (ArrayBody &b : bodies)
    if (b.atoms.size() >= LEAST_HOST) hosts.push_back(&b);
  auto is_heavier = [](const ArrayBody *a, const ArrayBody *b) { return a->mass > b->mass; };
  std::stable_sort(hosts.begin(), hosts.end(), is_heavier);
  for (ArrayBody *host : hosts) {
    if (host->is_trapped) continue;
    for (bool found = true; found;) {  // what is trapped may trap more
      found = false;
      for (ArrayBody &fragment : bodies) {
        if (&fragment == host || fragment.is_trapped || !fragment.trapped.empty()) continue;
        if (agglomerates.of_tag(fragment.label) != agglomerates.of_tag(host->label)) continue;
        if (fragment.mass > host->mass || !may_fly_along(fragment, *host) || !is_near(fragment, *host)) continue;
        fragment.is_trapped = found = true;
        host->trapped.push_back(&fragment);
      }
    }
  }
}

}  // namespace LAMMPS_NS
