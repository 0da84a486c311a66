#pragma once
#include <vector>

#include "base/vec.h"

namespace LAMMPS_NS {

class BodyMaker;
class LAMMPS;

// When LIGGGHTS's lists of neighbours are made anew, and which pairs they keep, SI units.
//
// A list holds the pairs that are nearer than the skin, and is good until two sub-spheres may have come nearer by as
// much. Bodies move by metres a second, so a thin skin means many lists; a wide one means pairs within a body that never
// touch, since its bonds keep them apart. Pairs within a body are therefore listed with a thin skin of their own, and a
// body's rigid motion, which brings none of them nearer, does not count for it.
class NeighbourLists {
 public:
  explicit NeighbourLists(LAMMPS *lmp) : lmp_(lmp) {}
  // `body_skin` (m) is that of pairs within a body; 0: that of all others.
  void init(BodyMaker *bodies, double body_skin);

  bool must_build();  // asked once in each step
  void build();

 private:
  // Sub-spheres that were one body when the lists were made.
  struct Group {
    std::vector<int> members;  // local indices
    Tensor inverse_inertia;    // of points of unit mass, about their middle, 1/m^2
    Vec middle;                // m
  };
  // The motion of a group that is rigid to first order, and does not bring two of its points nearer.
  struct RigidField {
    Vec mean, turn;
    Vec operator()(const Vec &arm) const { return mean + cross(turn, arm); }
  };

  LAMMPS *lmp_;
  BodyMaker *bodies_ = nullptr;
  double body_skin_ = 0;
  bool built_ = false;
  std::vector<Vec> place_;   // of each sub-sphere when they were made
  std::vector<Group> groups_;
  std::vector<int> group_of_label_;
  std::vector<char> has_neighbour_;  // by local index

  bool is_asked_for() const;
  bool have_moved() const;
  bool has_deformed(const Group &) const;
  void note_groups();
  void thin_out();
  void leave_out_lonely();
  template <class Field> RigidField fit(const Group &, Field field) const;
};

}  // namespace LAMMPS_NS
