#include "kernels/bond_packs.h"

namespace LAMMPS_NS {
std::unique_ptr<BondKernel> make_avx2_kernel() { return std::make_unique<PackedKernel<4>>(); }
}  // namespace LAMMPS_NS
