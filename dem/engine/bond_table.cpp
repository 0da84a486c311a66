#include "bond_table.h"

#include <cmath>
#include <fstream>

#include "error.h"
#include "lammps.h"

namespace LAMMPS_NS {

std::vector<Bond> read_bonds(LAMMPS *lmp, const std::string &file, const std::vector<BondMaterial> &materials) {
  std::ifstream in(file);
  std::vector<Bond> bonds;
  int material;
  double d[3], strength_factor;
  for (Bond b; in >> b.tag_i >> b.tag_j >> material >> d[0] >> d[1] >> d[2] >> b.radius >> strength_factor;) {
    if (material < 1 || material > static_cast<int>(materials.size()))
      lmp->error->all(FLERR, ("A bond of " + file + " names a material that the deck does not give").c_str());
    const BondMaterial &m = materials[material - 1];
    b.length = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    for (int k = 0; k < 3; k++) b.direction[k] = d[k] / b.length;
    b.area = M_PI * b.radius * b.radius;
    b.k_normal = m.modulus * b.area / b.length;
    b.k_shear = b.k_normal / m.stiffness_ratio;
    b.k_bend = b.k_normal * b.radius * b.radius / 4;
    b.k_twist = b.k_shear * b.radius * b.radius / 2;
    b.tensile_force = strength_factor * m.tensile_strength * b.area;
    b.shear_force = strength_factor * m.shear_strength * b.area;
    b.tan_friction = m.tan_friction;
    b.material = &m;
    bonds.push_back(b);
  }
  if (!in.eof() || bonds.empty()) lmp->error->all(FLERR, ("Cannot read the bonds from " + file).c_str());
  return bonds;
}

}  // namespace LAMMPS_NS
