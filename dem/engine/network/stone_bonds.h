#pragma once
#include <string>
#include <utility>
#include <vector>

#include "base/fix_input.h"
#include "base/fixes.h"
#include "interfaces/agglomerates.h"
#include "interfaces/stone_stream.h"
#include "kernels/bond_table.h"
#include "network/bond_softening.h"
#include "network/bond_volumes.h"
#include "pointers.h"

namespace LAMMPS_NS {

// The bonds of the stones that are near, and which of them hold. They are read from `file` and stay, or where that is
// `none` each stone brings its bonds and takes them with it (fix stones).
class StoneBonds : public FixPart, public StoneKeeper, private Pointers {
 public:
  StoneBonds(LAMMPS *, Fix *, const std::string &file, const std::vector<BondMaterial> &, const Agglomerates &);

  void enter(const EnteringStone &) override;
  void leave(int agglomerate) override;
  int moves() const { return moves_; }  // counts how often the bonds moved in memory, as stones came or went

  const std::vector<Bond> &all() const { return bonds_; }
  const Bond &of(int id) const;
  Bond &of(int id) { return const_cast<Bond &>(std::as_const(*this).of(id)); }
  double longest() const;  // of those read from the file, m

  bool holds(int id) const { return intact_[id]; }  // by its number, Bond::id
  long long changes() const { return changes_; }    // counts whatever changes `all` or `holds`
  void sever(int id);                               // it does not hold from now on; other ranks learn it by `agree`
  // Each rank finds the bonds broken or softened that it computes; all must know before bonds change hands.
  void agree();

  struct Block {  // of all(), bonds of one agglomerate that lie together and have numbers in a row
    int agglomerate, first_id;
    size_t start, count;
  };
  const std::vector<Block> &blocks() const { return blocks_; }

  const BondVolumes &volumes() const { return volumes_; }
  BondSoftening &softening() { return softening_; }

  void save(CheckpointWriter &) const;
  void restore(const CheckpointReader &);

 private:
  const FixInput input_;
  const std::vector<BondMaterial> materials_;  // bonds point into these
  const Agglomerates &agglomerates_;
  std::vector<Bond> bonds_;
  std::vector<Block> blocks_;      // ascending
  std::vector<char> intact_;       // the same on all ranks when they have agreed
  std::vector<int> newly_broken_;  // on this rank, since then
  long long changes_ = 0;
  int moves_ = 0;
  BondVolumes volumes_;
  BondSoftening softening_;
};

}  // namespace LAMMPS_NS
