#include "kernels/bond_packs.h"

namespace LAMMPS_NS {
std::unique_ptr<BondKernel> make_sse2_kernel() { return std::make_unique<PackedKernel<2>>(); }
}  // namespace LAMMPS_NS
