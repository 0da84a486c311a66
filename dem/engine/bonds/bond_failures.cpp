#include "bonds/bond_failures.h"

#include <cstdio>

#include "base/vec.h"
#include "update.h"

namespace LAMMPS_NS {

BondFailures::BondFailures(LAMMPS *lmp, const std::string &events_file, RankBonds &rank, BondForces &forces,
                           BondEnergies &energies)
    : Pointers(lmp), rank_(rank), forces_(forces), energies_(energies) {
  events_.open(lmp, events_file);
}

void BondFailures::add(int id) {
  Bond &bond = rank_.bonds.of(id);
  if (!soften(bond)) sever(bond);
}

bool BondFailures::is_counted(const Bond &bond) const { return atom->map(bond.tag_i) < atom->nlocal; }

// Weakens a bond that failed, whose force of this step is not yet there, where it does not break.
bool BondFailures::soften(Bond &bond) {
  if (!bond.material->softens()) return false;
  BondSoftening &softening = rank_.bonds.softening();
  const BondState judged = forces_.state(bond);
  const double left = softening.yield(bond, judged.loading, judged.energy);
  if (left == 0) return false;
  if (is_counted(bond)) softening.spend(bond.id, energies_.release(bond, 1 - left));
  softening.weaken(bond);
  forces_.put_back(bond);
  return true;
}

void BondFailures::sever(const Bond &bond) {
  const double energy = is_counted(bond) ? energies_.release(bond, 1) : 0;
  rank_.bonds.sever(bond.id);
  if (!is_counted(bond)) return;
  // The kernel judges at x + tau v, damping included; so does the event.
  const BondState judged = forces_.state(bond);
  const Vec middle = 0.5 * (Vec(atom->x[atom->map(bond.tag_i)]) + Vec(atom->x[atom->map(bond.tag_j)]));
  const bool shear = judged.mode == SHEAR;
  const BondSoftening &softening = rank_.bonds.softening();
  energies_.count_broken(bond);
  char line[256];
  std::snprintf(line, sizeof line, BIGINT_FORMAT ",%d,%d,%.9g,%.9g,%.9g,%s,%.9g,%.9g,%.9g\n", update->ntimestep,
                bond.id + 1, rank_.agglomerates.of_tag(bond.tag_i) + 1, middle.x, middle.y, middle.z,
                shear ? "shear" : "tension", shear ? judged.shear : judged.tension, energy + softening.spent(bond),
                softening.area(bond));
  events_.add(line);
}

}  // namespace LAMMPS_NS
