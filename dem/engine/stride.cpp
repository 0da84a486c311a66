#include "stride.h"

#include <algorithm>
#include <cmath>

#include "atom.h"
#include "force.h"
#include "lammps.h"
#include "neigh_list.h"
#include "pair.h"
#include "vec.h"

namespace LAMMPS_NS {

namespace {
const double LEAST_STEPS = 10;
}

// The fastest towards the plate or towards a neighbour, m/s.
double Stride::closing_speed(const LAMMPS *lmp) {
  const Atom *atom = lmp->atom;
  const NeighList *list = lmp->force->pair->list;
  double fastest = 0;
  for (int i = 0; i < atom->nlocal; i++) fastest = std::max(fastest, std::fabs(atom->v[i][2]));
  for (int k = 0; k < list->inum; k++) {
    const int i = list->ilist[k];
    for (int m = 0; m < list->numneigh[i]; m++) {
      const int j = list->firstneigh[i][m] & NEIGHMASK;
      const Vec apart = Vec(atom->x[i]) - Vec(atom->x[j]), v = Vec(atom->v[i]) - Vec(atom->v[j]);
      fastest = std::max(fastest, std::fabs(dot(v, apart)) / norm(apart));
    }
  }
  return fastest;
}

int Stride::longest(const LAMMPS *lmp, double plate_m_s) const {
  const Atom *atom = lmp->atom;
  if (atom->nlocal == 0) return 1;
  double push = 0, mass = HUGE_VAL;
  for (int i = 0; i < atom->nlocal; i++) {
    mass = std::min(mass, atom->rmass[i]);
    push = std::max(push, norm(Vec(atom->f[i])));
  }
  const double radius = *std::min_element(atom->radius, atom->radius + atom->nlocal);
  const double speed = closing_speed(lmp);
  // Two alike meet with half the mass and half the radius; one alone and the plate take longer.
  const double m = 0.5 * mass, R = 0.5 * radius, v = speed + plate_m_s;
  const double steps = std::max(LEAST_STEPS, std::cbrt(10 * v * v / (tolerance_ * speed_ * speed_)));
  const double impact_s = 2.87 * std::pow(m * m / (R * modulus_ * modulus_ * v), 0.2);
  const double overlap = std::pow(0.75 * push / (modulus_ * std::sqrt(R)), 2. / 3.);
  const double pressed_s = M_PI * std::sqrt(m / (2 * modulus_ * std::sqrt(R * overlap)));
  const double longest_s = std::min(impact_s / steps, pressed_s / LEAST_STEPS);
  for (int steps_as_one = unit_; steps_as_one > 1; steps_as_one--)
    if (unit_ % steps_as_one == 0 && steps_as_one * step_s_ <= longest_s) return steps_as_one;
  return 1;
}

}  // namespace LAMMPS_NS
