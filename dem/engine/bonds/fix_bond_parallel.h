#pragma once
#include <cstdio>
#include <memory>
#include <vector>

#include "bonds/bond_failures.h"
#include "bonds/bonded_bodies.h"
#include "fix.h"
#include "interfaces/checkpointed.h"
#include "kernels/bond_network.h"

namespace LAMMPS_NS {

// fix ID group bond/parallel bonds FILE agglomerates FILE events FILE damping_time TAU kernel NAME
//     material E stiffness_ratio tensile_strength shear_strength tan_friction   (once a material)
//         [dilatation kappa alpha p0] [fracture G]   (of this material)
//
// Parallel bonds (Potyondy and Cundall 2004, Int. J. Rock Mech. Min. Sci. 41:1329) in total form (Wang 2009, Acta
// Geotech. 4:117): a quaternion turns with each sub-sphere, and every force follows from positions and quaternions
// alone. Damping is viscous (bond_forces.h). A bond whose stress passes its strength breaks, which is an event
// (bond_events.h), and acts no more. Where FILE of the bonds is `none`, they come with the stones (fix stones).
class FixBondParallel : public Fix, public Checkpointed, public BondNetwork, public ActsInFreeFlight, public HasParts {
 public:
  FixBondParallel(class LAMMPS *, int, char **);
  ~FixBondParallel() override;

  int setmask() override;
  void init() override;
  void setup(int) override;
  void post_integrate() override;
  void pre_neighbor() override;
  void post_force(int) override;
  void post_run() override { failures_->write_events(); }

  // The quaternion travels with its sub-sphere.
  void grow_arrays(int) override;
  void copy_arrays(int, int, int) override;
  void set_arrays(int) override;
  int pack_exchange(int i, double *buf) override { return pack_border(1, &i, buf); }
  int unpack_exchange(int i, double *buf) override { return unpack_border(1, i, buf); }
  int pack_border(int, int *, double *) override;
  int unpack_border(int, int, double *) override;
  int pack_comm(int, int *, double *, int, int *) override;
  void unpack_comm(int, int, double *) override;

  void write_restart(FILE *) override;  // refuses

  void begin_anew() override;
  void save(CheckpointWriter &) override;
  void restore(const CheckpointReader &) override;

  double extend_cut_ghost() override { return 1.5 * longest_; }  // each rank that owns an end of a bond sees it
  double compute_scalar() override;  // bonds that hold

  const std::vector<Bond> &bonds() const override { return rank_->bonds.all(); }
  bool holds(size_t bond) const override { return rank_->bonds.holds(bond); }
  long long changes() const override { return rank_->bonds.changes(); }
  void agree_on_broken() override { rank_->bonds.agree(); }
  const double *quaternion(int i) const override { return rank_->motion.quaternion[i]; }

  std::vector<FixPart *> parts() override { return {&rank_->bonds, energies_.get(), bodies_.get()}; }

 private:
  std::unique_ptr<RankBonds> rank_;
  std::unique_ptr<BondForces> forces_;
  std::unique_ptr<BondEnergies> energies_;
  std::unique_ptr<BondFailures> failures_;
  std::unique_ptr<BondedBodies> bodies_;
  double longest_;                  // of the bonds, m
  bool sends_dilatations_ = false;  // or quaternions, to the ghosts

  void rebuild();
};

}  // namespace LAMMPS_NS
