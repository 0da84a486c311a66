#pragma once
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "agglomerates.h"
#include "bond_kernel.h"
#include "bond_table.h"
#include "checkpointed.h"
#include "fix.h"

namespace LAMMPS_NS {

// fix ID group bond/parallel bonds FILE agglomerates FILE events FILE damping_time TAU kernel NAME
//     material E stiffness_ratio tensile_strength shear_strength tan_friction   (once a material)
//
// Parallel bonds in total form: the fix turns a quaternion with each sub-sphere, and every force follows from
// positions and quaternions alone. Damping is viscous and proportional to stiffness: the forces are taken at
// x + tau v, which is F + tau dF/dt. A bond whose stress passes its strength is an event and is gone.
class FixBondParallel : public Fix, public Checkpointed {
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
  int pack_restart(int, double *) override;
  void unpack_restart(int, int) override;
  int size_restart(int) override;
  int maxsize_restart() override;
  void write_restart(FILE *) override;
  void restart(char *) override;

  void begin_anew() override { listed_ = false; }  // the kernel sums in the order of its list
  void save(CheckpointWriter &) override;
  void restore(const CheckpointReader &) override;

  double extend_cut_ghost() override;
  double memory_usage() override;
  double compute_scalar() override;  // bonds that hold

  // Each indexed by agglomerate, summed over ranks by the caller.
  void add_elastic_energy(double *energy) const;
  const std::vector<double> &work() const { return work_; }          // done by bonds on sub-spheres so far, J
  const std::vector<double> &released() const { return released_; }  // elastic energy of bonds when they broke, J
  const std::vector<double> &broken_count() const { return broken_count_; }
  // For bodies that leave the arrays (fix idle).
  void let_bodies_leave() { bodies_may_leave_ = true; }  // bonds without sub-spheres here are then no error
  const std::vector<int> &body_of_tag();  // sub-spheres that bonds hold together: the least tag among them, by tag
  void add_elastic_energy_by_body(double *energy);  // of bonds whose sub-spheres are here, indexed by body, J
  void forget_forces(int i);                          // no work of the bonds on i in the coming half step
  void rotate(int i, const struct Rotation &);        // turns the quaternion of sub-sphere i
  int bond_count() const { return static_cast<int>(bonds_.size()); }

 private:
  std::unique_ptr<Agglomerates> agglomerates_;
  std::vector<BondMaterial> materials_;
  std::vector<Bond> bonds_;
  std::vector<char> intact_;       // of every bond, the same on all ranks after each neighbour build
  std::vector<int> newly_broken_;  // since the last neighbour build, on this rank
  std::vector<LocalBond> local_;
  std::vector<int> broken_;        // room for the kernel's findings
  bool listed_ = false;            // does the kernel have a list that may be kept?
  std::vector<int> known_tags_;    // local order at the last build: if it stands, so does the kernel
  std::vector<AtomRecord> atoms_;
  std::vector<ForceRecord> forces_;
  std::unique_ptr<BondKernel> kernel_;
  std::vector<double> work_, released_, broken_count_;
  double **quaternion_;
  double damping_time_;
  double longest_ = 0;  // of the bonds, m
  bool bodies_may_leave_ = false;
  std::vector<int> body_of_tag_;
  double broken_at_bodies_ = -1;  // bonds broken when the bodies were found
  std::string events_;  // text not yet written
  std::string events_file_;

  static void turn(double *q, const double *omega, double half_dt);
  template <class Power> void add_work(double time, Power power);
  void rebuild();
  void share_broken();
  void fill_records();
  void fill_delayed_records(int nall);
  AtomRecord record(int i) const;
  AtomRecord half_a_step_ago(int i) const;
  void note_broken(int n);
  void write_events();
};

}  // namespace LAMMPS_NS
