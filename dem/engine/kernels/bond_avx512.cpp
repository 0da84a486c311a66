#include "kernels/bond_packs.h"

namespace LAMMPS_NS {
std::unique_ptr<BondKernel> make_avx512_kernel() { return std::make_unique<PackedKernel<8>>(); }
}  // namespace LAMMPS_NS
