#pragma once
#include <utility>
#include <vector>

#include "kernels/bond_kernel.h"
#include "network/stone_bonds.h"
#include "pointers.h"

namespace LAMMPS_NS {

// The bonds that hold and have an end on this rank, by local index, and with them the sub-spheres which bonds push or
// turn. Bonds of bodies that are held are not computed, but their sub-spheres turn. On one rank the list stands until
// sub-spheres have moved in memory, bodies are held or let go, or stones came or went.
class LocalBonds : private Pointers {
 public:
  LocalBonds(LAMMPS *, const StoneBonds &, const Agglomerates &);

  void let_bodies_leave() { bodies_may_leave_ = true; }  // a body that is not in the arrays is no error
  void hold(int tag, bool held) { held_[tag] = held, listed_ = false; }
  void let_leave(int i) { is_turned_[i] = 0, turned_.clear(); }  // sub-sphere i leaves at the next build

  void list_anew() { listed_ = false; }
  bool stands() const;
  std::vector<LocalBond> list();  // makes it, and returns the bonds that are computed

  const std::vector<LocalBond> &all() const { return all_; }  // broken ones since then as well
  const std::vector<int> &tags() const { return tags_; }      // of the sub-spheres when it was made, by local index
  const std::vector<int> &computed() const { return computed_; }  // sub-spheres with bonds that are, ascending
  bool is_turned(int i) const { return is_turned_[i]; }           // one of this rank
  const std::vector<std::pair<int, int>> &turned();  // first ones and numbers of those that lie together
  void restore(const std::vector<int> &computed, const std::vector<char> &is_turned);

 private:
  const StoneBonds &bonds_;
  const Agglomerates &agglomerates_;
  bool bodies_may_leave_ = false, listed_ = false;
  int moves_ = -1;               // StoneBonds::moves when the list was made
  std::vector<char> held_;       // by tag
  std::vector<LocalBond> all_;
  std::vector<int> tags_, computed_;
  std::vector<char> is_turned_;  // those with any bond, and not on their way out
  std::vector<std::pair<int, int>> turned_;  // none: not known

  void add(const StoneBonds::Block &);
  void list_sub_spheres(const std::vector<LocalBond> &computed);
};

}  // namespace LAMMPS_NS
