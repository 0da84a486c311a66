#pragma once
#include <vector>

#include "bonds/bond_energies.h"
#include "interfaces/free_flight_partners.h"

namespace LAMMPS_NS {

// Bodies: the sub-spheres that bonds which hold keep together, for free flight.
class BondedBodies : public FixPart, public BodyMaker {
 public:
  BondedBodies(RankBonds &rank, BondForces &forces, BondEnergies &energies)
      : rank_(rank), forces_(forces), energies_(energies) {}
  void let_bodies_leave() override { rank_.local.let_bodies_leave(); }
  const std::vector<int> &body_of_tag() override;
  void add_elastic_energy_by_body(double *energy) override;
  const std::vector<Support> &supports_of_tags() override;
  void hold(int tag, bool held) override { rank_.local.hold(tag, held); }
  void take_energy(int tag, double energy) override { energies_.take_energy(tag, energy); }
  void let_leave(int i) override { forces_.on(i) = ForceRecord(), rank_.local.let_leave(i); }
  void rotate(int i, const Rotation &turned) override { rank_.motion.rotate(i, turned); }

 private:
  RankBonds &rank_;
  BondForces &forces_;
  BondEnergies &energies_;
  std::vector<int> body_;  // by tag
  std::vector<Support> supports_;
  long long changes_at_bodies_ = -1, changes_at_supports_ = -1;  // when they were found
};

}  // namespace LAMMPS_NS
