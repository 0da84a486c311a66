#pragma once
#include <functional>
#include <vector>

#include "bonds/bond_forces.h"
#include "interfaces/energy_holder.h"

namespace LAMMPS_NS {

// The energies of the bonds on this rank, for the ledger: what is elastic now, and of each agglomerate so far the
// work on its sub-spheres, what bonds lost as they broke or softened, what their damping took, and how many broke.
class BondEnergies : public FixPart, public EnergyHolder, private Pointers {
 public:
  BondEnergies(LAMMPS *, const RankBonds &, BondForces &);
  void add_to(LedgerRows &) override;
  // add(tag, J) of each bond that this rank counts, and of each of its sub-spheres where the dilatation has energy.
  void each_elastic(const std::function<void(int, double)> &add) const;

  void add_work(int side);
  double release(const Bond &, double share);  // what a bond has lost whose force fell by `share` at this step, J
  void count_broken(const Bond &bond) { broken_[rank_.agglomerates.of_tag(bond.tag_i)] += 1; }
  void take_energy(int tag, double energy);    // J, as the damping would have, soon
  void without_work(const std::function<void()> &step);  // neither its work nor its damping is counted

  void save(CheckpointWriter &) const;
  void restore(const CheckpointReader &);

 private:
  using Shift = SphereMotion::Shift;
  const RankBonds &rank_;
  BondForces &forces_;
  std::vector<double> work_, released_, damped_, broken_;  // by agglomerate, J and bonds

  std::vector<double> stretches_now() const;
  double stretch(const Bond &, const Shift &) const;  // area times elongation, m^3
  double lost(const Bond &, double share, const Shift &, const Shift &others) const;
};

}  // namespace LAMMPS_NS
