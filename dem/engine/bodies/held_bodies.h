#pragma once
#include <functional>
#include <memory>
#include <vector>

#include "bodies/array_body.h"
#include "interfaces/free_flight_partners.h"
#include "bodies/held_body.h"

namespace LAMMPS_NS {

class CheckpointReader;
class CheckpointWriter;
class LAMMPS;

// Bodies of several sub-spheres that touch something and do not vibrate are held: they move as rigid bodies
// (HeldBody). What is left of their inner motion when they are taken counts as damped by their bonds. A body is let go,
// with all its bonds, at the step at which contacts push it too hard:
//   on one sub-sphere with more than STRENGTH_SHARE of what its bonds together bear in tension;
//   in all with F such that F^2/(2 k) is more than the tolerance allows, k = k_n n^(1/3) being the stiffness of n
//   sub-spheres on bonds of the stiffness k_n.
class HeldBodies {
 public:
  // Inner energies below `tolerance` of m speed^2/2 count as none. The fixes that integrate and that add weight act on
  // the group with the bit `unheld`, of which a body's sub-spheres are taken out while it is held.
  HeldBodies(LAMMPS *lmp, const Vec &gravity_m_s2, double speed_m_s, double tolerance, int tags, int unheld);
  void set_bonds(BodyMaker *bonds) { bonds_ = bonds; }

  // At a look: counts looks at which each body was still, and takes those that stay in the arrays although they were
  // still for long enough, where `is_gentle` says that no encounter ahead pushes with more than the limit (N); of others
  // it lets go.
  void count_still(const std::vector<ArrayBody> &);
  void choose(std::vector<ArrayBody> &, const std::function<bool(ArrayBody &, double)> &is_gentle);
  void let_go(int label);           // if it is held

  bool has_changed() const { return changed_; }  // some were taken or let go since `find`
  void find();                      // after a change of the arrays or of bodies
  void move();                      // the first half of a step
  void push();                      // the second half, which may let go of some

  void save(CheckpointWriter &) const;
  void restore(const CheckpointReader &);

 private:
  LAMMPS *lmp_;
  BodyMaker *bonds_ = nullptr;
  const Vec gravity_;
  const double speed_, tolerance_;
  const int unheld_;
  std::vector<std::unique_ptr<HeldBody>> bodies_;
  bool changed_ = false;
  std::vector<char> held_;   // by label
  std::vector<int> still_;   // looks in a row, by label

  double energy_of_impact(const ArrayBody &b) const { return 0.5 * speed_ * speed_ * b.mass; }
  ArrayBody alone(const ArrayBody &) const;
  struct Limits {
    std::vector<double> parts_N;
    double all_N, least_N;
  };
  Limits limits(const ArrayBody &) const;
  void take(const ArrayBody &, const Limits &);
  void set_held(const HeldBody &, bool);
  void erase(size_t k);
};

}  // namespace LAMMPS_NS
