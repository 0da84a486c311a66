#pragma once
#include <memory>
#include <vector>

#include "atom.h"
#include "network/rank_bonds.h"

namespace LAMMPS_NS {

// The forces of the bonds in one step, on sub-spheres by local index. Their damping is viscous and proportional to
// stiffness: forces and failure are those at x + tau v, which to first order is F + tau dF/dt.
class BondForces : private Pointers {
 public:
  BondForces(LAMMPS *lmp, const RankBonds &rank, std::unique_ptr<BondKernel> kernel, double damping_time)
      : Pointers(lmp), rank_(rank), kernel_(std::move(kernel)), damping_time_(damping_time) {}
  double damping_time() const { return damping_time_; }  // tau, s

  void list(const std::vector<LocalBond> &computed);
  void begin_step();        // no forces yet
  void find_dilatations();  // of the sub-spheres of this rank, before `find`
  std::vector<int> find();  // the forces; returns the numbers of bonds that fail, which exert none
  void give() const;        // to the sub-spheres of this rank

  ForceRecord &on(int i) { return forces_[i]; }
  const ForceRecord &on(int i) const { return forces_[i]; }
  double &dilatation(int i) { return places_[i].dilatation; }
  BondState state(const Bond &) const;
  void put_back(const Bond &);  // one that failed, and goes on with the numbers that it has now
  void clear() { forces_.assign(atom->nlocal + atom->nghost + 2, ForceRecord()); }

 private:
  const RankBonds &rank_;
  const std::unique_ptr<BondKernel> kernel_;
  const double damping_time_;
  std::vector<AtomRecord> places_;
  std::vector<ForceRecord> forces_;
  std::vector<double> stretches_;  // of each sub-sphere, m^3
  std::vector<int> failed_;        // room for the kernel's findings
};

}  // namespace LAMMPS_NS
