#include "bonds/bond_energies.h"

#include "base/vec.h"
#include "update.h"

namespace LAMMPS_NS {

BondEnergies::BondEnergies(LAMMPS *lmp, const RankBonds &rank, BondForces &forces)
    : Pointers(lmp), rank_(rank), forces_(forces), work_(rank.agglomerates.count(), 0.0), released_(work_),
      damped_(work_), broken_(work_) {}

void BondEnergies::each_elastic(const std::function<void(int, double)> &add) const {
  for (const LocalBond &b : rank_.local.all())
    if (rank_.bonds.holds(b.id) && b.i < atom->nlocal)
      add(b.bond->tag_i, bond_state(*b.bond, rank_.motion.at(b.i), rank_.motion.at(b.j)).energy);
  if (!rank_.bonds.volumes().needed()) return;
  const std::vector<double> stretch = stretches_now();
  for (int i = 0; i < atom->nlocal; i++) add(atom->tag[i], rank_.bonds.volumes().energy(atom->tag[i], stretch[i]));
}

// Without the share of the damping, of each sub-sphere of this rank, m^3.
std::vector<double> BondEnergies::stretches_now() const {
  std::vector<double> sum(atom->nlocal + atom->nghost, 0.0);
  for (const LocalBond &b : rank_.local.all()) {
    if (!rank_.bonds.holds(b.id) || !b.bond->material->feels_dilatation()) continue;
    const double stretch = b.bond->area * (norm(Vec(atom->x[b.j]) - Vec(atom->x[b.i])) - b.bond->length);
    sum[b.i] += stretch;
    sum[b.j] += stretch;
  }
  return sum;
}

double BondEnergies::stretch(const Bond &b, const Shift &s) const {
  const Vec from = rank_.motion.place(atom->map(b.tag_i), s), to = rank_.motion.place(atom->map(b.tag_j), s);
  return b.area * (norm(to - from) - b.length);
}

// What is lost, J, when a bond, which still counts, loses `share` of what it has: of its beam and of the dilatations of
// its ends, whose other bonds may be taken at another time. Those of a ghost are taken as when the bond was judged.
double BondEnergies::lost(const Bond &bond, double share, const Shift &s, const Shift &others) const {
  const BondVolumes &volumes = rank_.bonds.volumes();
  const int i = atom->map(bond.tag_i), j = atom->map(bond.tag_j);
  double energy = share * bond_state(bond, rank_.motion.at(i, s), rank_.motion.at(j, s)).energy;
  if (!bond.material->feels_dilatation()) return energy;
  const double own = stretch(bond, s);
  for (int end : {i, j}) {
    const int tag = atom->tag[end];
    double sum = own;
    if (end < atom->nlocal) {
      for (int other : volumes.bonds_of(tag))
        if (rank_.bonds.holds(other) && other != bond.id) sum += stretch(rank_.bonds.of(other), others);
    } else sum += volumes.stretch(tag, forces_.dilatation(end)) - stretch(bond, {forces_.damping_time(), 0});
    energy += volumes.energy(tag, sum) - volumes.energy(tag, sum - share * own);
  }
  return energy;
}

// Of the step before half was done with the force of then, and of the coming one half will be done with a dilatation
// which still has the bond. What add_work takes for damping has the fall of the force in it, which is none. All of it
// to second order in the step.
double BondEnergies::release(const Bond &bond, double share) {
  const double dt = update->dt, tau = forces_.damping_time();
  auto lost_at = [&](const Shift &s, const Shift &others) { return lost(bond, share, s, others); };
  const Shift later = {0.5 * dt, 0}, earlier = {-0.5 * dt, 0};
  const Shift mean_later = {0.25 * dt, 0.25 * dt}, mean_earlier = {-0.25 * dt, -0.25 * dt};
  const double now = lost_at({0, 0}, {0, 0});
  const double energy = now - 0.5 * (lost_at(later, earlier) - lost_at(earlier, later));
  const double after = lost_at(mean_later, mean_later), before = lost_at(mean_earlier, mean_earlier);
  const double rate = (after - before) / dt, curvature = 4 * (before - 2 * now + after) / (dt * dt);
  const int a = rank_.agglomerates.of_tag(bond.tag_i);
  released_[a] += energy;
  damped_[a] += tau * rate + 0.5 * tau * (tau - dt) * curvature;
  return energy;
}

// Adds half a step's work of the forces to that of each agglomerate. Neighbours in memory mostly belong to one
// agglomerate, so the sums are kept in registers until that changes.
//
// The damping makes a force F + tau dF/dt and takes -tau dF/dt . v. In a step from the forces F to F' that is
// tau/2 (F - F') . (u + v), with the velocities u of the step before and v of this one: exactly what bonds without
// memory take whose energy is quadratic. `side` is 1 with F and -1 with F'.
void BondEnergies::add_work(int side) {
  const double half_dt = 0.5 * update->dt, half_tau = side * 0.5 * forces_.damping_time();
  const double *v = flat(atom->v), *omega = flat(atom->omega);
  int home = 0;
  double power = 0, power_before = 0;
  auto count = [&] {
    work_[home] += half_dt * power, damped_[home] += half_tau * (power_before + power);
    power = power_before = 0;
  };
  for (int i : rank_.local.computed()) {
    if (i >= atom->nlocal) break;
    const int a = rank_.agglomerates.of_tag(atom->tag[i]);
    if (a != home) count(), home = a;
    const ForceRecord &g = forces_.on(i);
    const SphereMotion::Velocities &u = rank_.motion.before(i);
    for (int k = 0; k < 3; k++) {
      power += g.f[k] * v[3 * i + k] + g.torque[k] * omega[3 * i + k];
      power_before += g.f[k] * u.v[k] + g.torque[k] * u.omega[k];
    }
  }
  count();
}

void BondEnergies::take_energy(int tag, double energy) {
  work_[rank_.agglomerates.of_tag(tag)] -= energy;
  damped_[rank_.agglomerates.of_tag(tag)] += energy;
}

void BondEnergies::without_work(const std::function<void()> &step) {
  const std::vector<double> work = work_, damped = damped_;
  step();
  work_ = work;
  damped_ = damped;
}

void BondEnergies::add_to(LedgerRows &rows) {
  std::vector<double> elastic(rank_.agglomerates.count(), 0.0);
  each_elastic([&](int tag, double energy) { elastic[rank_.agglomerates.of_tag(tag)] += energy; });
  rows.add(BOND_ELASTIC, elastic);
  rows.add(BOND_WORK, work_);
  rows.add(RELEASED, released_);
  rows.add(BOND_DAMPED, damped_);
  rows.add(BROKEN, broken_);
}

void BondEnergies::save(CheckpointWriter &out) const {
  out.sum("bond_work", work_);
  out.sum("bond_released", released_);
  out.sum("bond_damped", damped_);
  out.sum("bond_broken", broken_);
}

void BondEnergies::restore(const CheckpointReader &in) {
  const size_t n = rank_.agglomerates.count();
  work_ = in.sum("bond_work", n);
  released_ = in.sum("bond_released", n);
  damped_ = in.sum("bond_damped", n);
  broken_ = in.sum("bond_broken", n);
}

}  // namespace LAMMPS_NS
