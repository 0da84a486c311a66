#pragma once
#include <memory>
#include <string>
#include <vector>

#include "kernels/bond_table.h"

namespace LAMMPS_NS {

// What a bond needs of a sub-sphere and gives to it: one cache line each.
struct alignas(64) AtomRecord {
  double x[3];
  double q[4];  // rotation from the undeformed state, (w, x, y, z)
  double dilatation;  // relative change of volume at the sub-sphere, 0 where no material asks for it
};
struct alignas(64) ForceRecord {
  double f[3];
  double torque[3];
  double unused[2];
};

struct LocalBond {
  int i, j;  // local indices of the two sub-spheres
  int id;    // place in the bond table
  const Bond *bond;
};

enum BreakMode { INTACT = 0, TENSION = 1, SHEAR = 2 };

// Everything about one bond at one instant.
struct BondState {
  double force_j[3];   // on sub-sphere j; i gets the opposite
  double torque_i[3], torque_j[3];
  double energy;       // of the beam, J; that of the dilatation belongs to the sub-spheres
  double tension;      // -F_n/A + |M_b| r/I written as pull: F_n/A + |M_b| r/I, Pa
  double shear;        // |F_s|/A + |M_t| r/J, Pa
  double normal;       // F_n/A, pull positive, Pa
  double loading;      // of the criterion that is nearer, over its strength: 1 where the bond fails (no threshold)
  BreakMode mode;
};
BondState bond_state(const Bond &, const AtomRecord &i, const AtomRecord &j);
void add_to_ends(const BondState &, ForceRecord &i, ForceRecord &j);

// Adds the forces of all bonds and finds those that break. A bond found broken exerts no force and leaves the list.
class BondKernel {
 public:
  virtual ~BondKernel() {}
  // `spare` is the index of two records that exist only to fill the last pack.
  virtual void build(const std::vector<LocalBond> &bonds, int spare) = 0;
  // Adds to both ends' `stretch` the area times elongation, in m^3, of each bond whose material feels the dilatation.
  virtual void add_stretches(const AtomRecord *atom, double *stretch) = 0;
  // Writes the ids of bonds that break to `broken` (room for all of them) and returns how many. A plain array, since a
  // library template compiled here for a wide instruction set could be linked into code meant for every processor.
  virtual int add_forces(const AtomRecord *atom, ForceRecord *force, int *broken) = 0;
  // A bond of a material that softens, found broken by the last `add_forces`, goes on with the numbers that it now has.
  virtual void revive(const LocalBond &) = 0;
};

std::unique_ptr<BondKernel> make_plain_kernel();  // bond by bond from bond_state: the naive twin
std::unique_ptr<BondKernel> make_sse2_kernel();
std::unique_ptr<BondKernel> make_avx2_kernel();
std::unique_ptr<BondKernel> make_avx512_kernel();
// name: plain, sse2, avx2, avx512, or auto for the widest that the processor has. Null for another name, or where
// the processor cannot.
std::unique_ptr<BondKernel> make_bond_kernel(const std::string &name);

}  // namespace LAMMPS_NS
