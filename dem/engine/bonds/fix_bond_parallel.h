#pragma once
#include <cstdio>
#include <memory>
#include <unordered_map>
#include <utility>
#include <vector>

#include "interfaces/agglomerates.h"
#include "bonds/bond_events.h"
#include "kernels/bond_kernel.h"
#include "kernels/bond_network.h"
#include "bonds/bond_softening.h"
#include "kernels/bond_table.h"
#include "bonds/bond_volumes.h"
#include "interfaces/checkpointed.h"
#include "interfaces/energy_holder.h"
#include "fix.h"
#include "interfaces/free_flight_partners.h"
#include "interfaces/stone_stream.h"

namespace LAMMPS_NS {

// fix ID group bond/parallel bonds FILE agglomerates FILE events FILE damping_time TAU kernel NAME
//     material E stiffness_ratio tensile_strength shear_strength tan_friction   (once a material)
//         [dilatation kappa alpha p0] [fracture G]   (of this material)
//
// Parallel bonds (Potyondy and Cundall 2004, Int. J. Rock Mech. Min. Sci. 41:1329) in total form (Wang 2009, Acta
// Geotech. 4:117): the fix turns a quaternion with each sub-sphere, and every force follows from positions and
// quaternions alone. Damping is viscous and proportional to stiffness: the forces are taken at x + tau v, which to
// first order is F + tau dF/dt. A bond whose stress passes its strength breaks, which is an event (bond_events.h), and
// acts no more. Where FILE of the bonds is `none`, they come with the stones (fix stones).
class FixBondParallel : public Fix, public Checkpointed, public EnergyHolder, public BodyMaker, public BondNetwork,
                        public StoneKeeper, public ActsInFreeFlight {
 public:
  FixBondParallel(class LAMMPS *, int, char **);
  ~FixBondParallel() override;

  int setmask() override;
  void init() override;
  void setup(int) override;
  void post_integrate() override;
  void pre_neighbor() override;
  void post_force(int) override;
  void post_run() override;

  void grow_arrays(int) override;
  void copy_arrays(int, int, int) override;
  void set_arrays(int) override;
  int pack_exchange(int, double *) override;
  int unpack_exchange(int, double *) override;
  int pack_border(int, int *, double *) override;
  int unpack_border(int, int, double *) override;
  int pack_comm(int, int *, double *, int, int *) override;
  void unpack_comm(int, int, double *) override;

  void write_restart(FILE *) override;  // refuses

  void begin_anew() override { listed_ = knows_motion_ = false; }  // the kernel sums in the order of its list
  void save(CheckpointWriter &) override;
  void restore(const CheckpointReader &) override;

  double extend_cut_ghost() override;
  double memory_usage() override;
  double compute_scalar() override;  // bonds that hold

  void add_to(LedgerRows &) override;

  void let_bodies_leave() override { bodies_may_leave_ = true; }
  const std::vector<int> &body_of_tag() override;
  void add_elastic_energy_by_body(double *energy) override;
  const std::vector<Support> &supports_of_tags() override;
  void hold(int tag, bool held) override;
  bool is_held(int tag) const override { return held_[tag]; }
  void take_energy(int tag, double energy) override;
  void let_leave(int i) override;
  void rotate(int i, const Rotation &) override;

  const std::vector<Bond> &bonds() const override { return bonds_; }
  bool holds(size_t bond) const override { return intact_[bond]; }
  long long changes() const override { return changes_; }

  void enter(const EnteringStone &) override;
  void leave(int agglomerate) override;

  void agree_on_broken() override;
  const double *quaternion(int i) const override { return quaternion_[i]; }

 private:
  std::unique_ptr<Agglomerates> agglomerates_;
  std::vector<BondMaterial> materials_;
  std::vector<Bond> bonds_;
  struct Block {                   // the bonds of a stone that came with it, in bonds_
    int agglomerate, first_id;
    size_t start, count;
  };
  std::vector<Block> blocks_;      // ascending; none where all stones are there from the start
  struct Stretch {                 // of bonds_ that belong to one agglomerate
    int agglomerate;
    size_t start, end;
  };
  std::vector<Stretch> stretches_of_bonds_;  // none: not found yet
  std::vector<char> intact_;       // of every bond by its number, the same on all ranks after each neighbour build
  long long changes_ = 0;
  std::vector<int> newly_broken_;  // since the last neighbour build, on this rank
  std::vector<LocalBond> local_;
  std::vector<int> broken_;        // room for the kernel's findings
  bool listed_ = false;            // does the kernel have a list that may be kept?
  std::vector<int> known_tags_;    // local order at the last build: if it stands, so does the kernel
  std::vector<AtomRecord> atoms_;
  std::vector<ForceRecord> forces_;
  struct Motion {
    double v[3], omega[3];
  };
  std::vector<Motion> before_;     // of the sub-spheres in the step before, by local index
  bool knows_motion_ = false;      // else it is taken to be that of this step
  struct Shift {                   // times with the velocities of this step and of the one before, s
    double now, before;
  };
  std::unique_ptr<BondKernel> kernel_;
  BondVolumes volumes_;
  BondSoftening softening_;
  std::vector<double> stretches_;    // of each sub-sphere where the bonds are computed, m^3
  bool sends_dilatations_ = false;   // or quaternions, to the ghosts
  // By agglomerate, on this rank: work done by bonds on sub-spheres, J; elastic energy of bonds when they broke, J; what
  // their damping took, J; and how many broke.
  std::vector<double> work_, released_, damped_, broken_count_;
  double **quaternion_;
  double damping_time_;
  double longest_ = 0;  // of the bonds, m
  bool bodies_may_leave_ = false;
  std::vector<int> body_of_tag_;
  long long changes_at_bodies_ = -1;  // when the bodies were found
  std::vector<Support> supports_;
  long long changes_at_supports_ = -1;
  std::vector<char> held_;         // by tag
  std::vector<int> computed_;      // local indices of the sub-spheres with bonds that the kernel has
  std::vector<char> is_turned_;    // of this rank: those with any bond that holds, and not on their way out
  std::vector<std::pair<int, int>> turned_;  // these: first ones and numbers; none: not known
  BondEvents events_;

  const Bond &bond_of(int id) const;
  Bond &bond_of(int id);
  void add_work(int side);
  void remember_motion();
  std::unordered_map<int, Motion> motion_by_tag() const;
  void take_motion(const std::unordered_map<int, Motion> &before);
  void rebuild();
  void list_bonds(const Stretch &);
  const std::vector<Stretch> &stretches_of_bonds();
  void share_broken();
  void fill_records();
  void list_sub_spheres(const std::vector<LocalBond> &computed);
  void list_turned();
  AtomRecord record(int i) const;
  AtomRecord record(int i, const Shift &) const;
  void find_dilatations();
  std::vector<double> stretches_now() const;
  double stretch(const Bond &, const Shift &) const;  // area times elongation, m^3
  double lost_energy(const Bond &, double share, const Shift &, const Shift &others) const;
  double release(const Bond &, double share);
  template <class Add> void each_elastic_energy(Add add) const;
  void note_broken(int n);
  bool soften(int bond);
  void break_bond(int bond);
};

}  // namespace LAMMPS_NS
