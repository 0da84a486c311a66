#pragma once
#include <mpi.h>

#include <functional>
#include <vector>

#include "kernels/bond_table.h"
#include "interfaces/checkpoint_file.h"

namespace LAMMPS_NS {

// Bonds that soften instead of snapping, where their material has a fracture energy G. A bond keeps the share phi of
// its undamaged area, stiffnesses and energy. With s, the largest loading of the undamaged bond so far over its strength
// (the nearer of both criteria), its strength falls in proportion to its strain, to nothing at s = e:
//
//   phi = (e - s)/(s (e - 1)) for 1 < s < e,   e = G A s^2/U at s = 1,
//
// where A and U are area and elastic energy of the beam undamaged. Loaded in proportion it then takes G A to break,
// by whatever load. A bond that holds G A or more when it yields (e <= 1) snaps.
class BondSoftening {
 public:
  void enter(const std::vector<Bond> &bonds);
  bool needed() const { return needed_; }

  // Of a bond that fails by `loading` (of the strength that it has) with the energy `energy` of its beam, J: the share of
  // area, stiffnesses and energy that is left of those before; 0: it breaks.
  double yield(const Bond &, double loading, double energy);
  void weaken(Bond &) const;  // to what is left now
  void spend(int id, double energy) { bonds_[id].spent += energy, bonds_[id].unshared += energy; }
  double spent(const Bond &b) const { return b.material->softens() ? bonds_[b.id].spent : 0; }               // J
  double area(const Bond &b) const { return b.material->softens() ? bonds_[b.id].whole.area : b.area; }  // at first

  // Of several ranks, which call it together: all of them then know each bond as the one that found it weakest does.
  void share(MPI_Comm world, const std::function<Bond &(int)> &bond_of);
  void save(CheckpointWriter &out, const std::vector<Bond> &bonds) const;
  void restore(const CheckpointReader &in, std::vector<Bond> &bonds);  // weakens the bonds, which are undamaged

 private:
  struct State {
    Bond whole;                   // undamaged
    double reached = 1, end = 0;  // s and e; e is 0 before the bond has yielded
    double spent = 0;             // J
    double unshared = 0;          // of it, what this rank alone knows
    bool changed = false;         // since the last `share`
    double left() const { return reached > 1 ? (end - reached) / (reached * (end - 1)) : 1; }
  };
  bool needed_ = false;
  std::vector<State> bonds_;  // by id
};

}  // namespace LAMMPS_NS
