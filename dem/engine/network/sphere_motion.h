#pragma once
#include <unordered_map>
#include <vector>

#include "base/vec.h"
#include "kernels/bond_kernel.h"
#include "kernels/bond_network.h"
#include "network/local_bonds.h"
#include "pointers.h"

namespace LAMMPS_NS {

// The rows of LIGGGHTS's arrays lie beside each other in memory; a rank may have none.
inline double *flat(double **rows) { return rows ? rows[0] : nullptr; }

// How the sub-spheres with bonds are turned since the undeformed state, and how they moved in the step before: with
// positions and velocities of this step, where they are at times near it.
class SphereMotion : private Pointers {
 public:
  SphereMotion(LAMMPS *lmp, LocalBonds &local) : Pointers(lmp), local_(local) {}
  ~SphereMotion() override;

  double **quaternion = nullptr;  // (w, x, y, z) by local index, which LIGGGHTS carries from rank to rank
  void turn_on();                 // all of them by their spin over one step
  void rotate(int i, const Rotation &);

  struct Velocities {
    double v[3], omega[3];
  };
  const Velocities &before(int i) const { return before_[i]; }  // in the step before; of this one where that is unknown
  void know_before() { if (!knows_before_) remember(); }
  void remember();  // this step is the one before from now on
  void step_is_done() { remember(), knows_before_ = true; }
  void forget() { knows_before_ = false; }
  using ByTag = std::unordered_map<int, Velocities>;
  ByTag before_by_tag() const;      // before the list of bonds is made anew
  void take_before(const ByTag &);  // and after it

  struct Shift {  // times with the velocities of this step and of the one before, s
    double now, before;
  };
  AtomRecord at(int i) const;                 // at x
  AtomRecord at(int i, const Shift &) const;  // at x + s.now v + s.before u
  Vec place(int i, const Shift &) const;      // the same, without the turn
  void all_at(double time, std::vector<AtomRecord> &) const;  // computed ones at x + time v

 private:
  LocalBonds &local_;
  std::vector<Velocities> before_;  // by local index
  bool knows_before_ = false;
};

}  // namespace LAMMPS_NS
