#pragma once
#include <map>
#include <vector>

#include "bodies/outline.h"
#include "kernels/bond_network.h"
#include "contact/plate_contact.h"
#include "base/rigid_motion.h"
#include "smooth/stone_surface.h"

namespace LAMMPS_NS {

class LAMMPS;

// Pieces of stones, which intact bonds hold together, and how each has moved as a rigid body since the undeformed
// state. All ranks find the same.
class StonePieces {
 public:
  StonePieces(LAMMPS *, const Agglomerates &, const StoneSurfaces &, BondNetwork &);

  void enter(const EnteringStone &);
  void leave(int agglomerate);

  struct Motion {
    Rotation turned;           // mean of the rotations of its sub-spheres
    Vec center;                // where the centre of the whole stone would be if it moved with the piece, m
    Vec velocity;              // of its mass, m/s
    Vec spin;                  // rad/s
    double mass = 0;
    bool is_here = true;       // and not in free flight

    // A direction in space as the undeformed stone has it `ahead` s from now, in which the piece turns on.
    Vec in_stone(const Vec &direction, double ahead) const {
      const Vec then = turned.inverse()(direction - ahead * cross(spin, direction));
      return (1 / norm(then)) * then;
    }
  };

  // Of the radius: a piece's surface is no further from where the whole stone has it.
  static constexpr double DEFORMED = 0.02;

  // Between its spheres are the surfaces about all centres that patches of these sub-spheres, a body in the arrays, can
  // have. Patches of two stones do not begin to press where the inner spheres overlap. On one rank.
  Shell surface(const std::vector<int> &tags);

  // Looks at the stones `wanted`; `touching` says which sub-spheres of this rank touch the plate by themselves, by tag.
  void look(const std::vector<int> &wanted, const std::vector<char> &touching);

  void find_pieces();

  int piece_of(int tag) const { return piece_[tag]; }                      // least tag in the piece
  bool is_loose(int tag) const { return 2 * bonds_now_[tag] < bonds_first_[tag]; }  // has lost more than half its bonds
  bool is_free(int tag) const { return bonds_now_[tag] == 0; }
  const std::vector<int> &bonds_of(int tag) const { return bonds_of_[tag]; }  // their numbers, broken ones as well
  Vec position(int tag) const { return Vec(&now_[NUMBERS * static_cast<size_t>(tag)]); }
  bool is_here(int tag) const { return now_[NUMBERS * static_cast<size_t>(tag) + 11] != 0; }  // not in free flight
  bool touched_alone(int tag) const { return now_[NUMBERS * static_cast<size_t>(tag) + 10] != 0; }
  bool may_have_patch(int tag) const { return in_surface_[piece_[tag]] >= PlateContact::LEAST_IN_PATCH; }  // its piece
  Motion motion(const SmoothStone &, int piece) const;
  std::map<int, Motion> motions(const SmoothStone &) const;  // by piece, of those that may have a patch

  // How a force along a line through the centre of the whole stone is shared by a piece that it moves as a rigid body,
  // and the speed that it gives to the point where it acts, per impulse, 1/kg. They are those of the
  // masses where the piece is nearly a line, or all in one place beside the axis.
  struct Spread {
    std::vector<StoneSurfaces::Weight> weights;
    double mobility = 0;
  };
  Spread spread(const SmoothStone &, int piece, const Motion &, const Vec &axis) const;

 private:
  static constexpr size_t NUMBERS = 12;  // of a sub-sphere: x, v, quaternion, does it touch alone, is it here
  LAMMPS *lmp_;
  const Agglomerates &agglomerates_;
  const StoneSurfaces &surfaces_;
  BondNetwork &bonds_;
  std::vector<double> now_;              // by tag
  std::vector<int> piece_, bonds_now_, bonds_first_;
  std::vector<int> in_surface_;          // sub-spheres of the surface, of each piece
  std::vector<std::vector<int>> bonds_of_;  // by tag
  long long changes_ = -1;               // of the bonds when the pieces were found

  void add_bond(int id, int tag_i, int tag_j);
  void note(int tag, double *row) const;
  void gather(const std::vector<int> &wanted, const std::vector<char> &touching);
  Motion motion(const std::vector<int> &tags) const;
};

}  // namespace LAMMPS_NS
