#include "bond_table.h"

#include <cmath>
#include <fstream>

#include "error.h"
#include "lammps.h"

namespace LAMMPS_NS {

Bond bond_of_row(LAMMPS *lmp, const double *row, int id, const std::vector<BondMaterial> &materials,
                 const std::string &source) {
  const int material = static_cast<int>(row[2]);
  const double *d = row + 3, strength_factor = row[7];
  if (material < 1 || material > static_cast<int>(materials.size()))
    lmp->error->all(FLERR, ("A bond of " + source + " names a material that the deck does not give").c_str());
  const BondMaterial &m = materials[material - 1];
  Bond b;
  b.id = id;
  b.tag_i = static_cast<int>(row[0]), b.tag_j = static_cast<int>(row[1]);
  b.radius = row[6];
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
  return b;
}

std::vector<Bond> read_bonds(LAMMPS *lmp, const std::string &file, const std::vector<BondMaterial> &materials) {
  std::ifstream in(file);
  std::vector<Bond> bonds;
  for (double row[8]; in >> row[0] >> row[1] >> row[2] >> row[3] >> row[4] >> row[5] >> row[6] >> row[7];)
    bonds.push_back(bond_of_row(lmp, row, static_cast<int>(bonds.size()), materials, file));
  if (!in.eof() || bonds.empty()) lmp->error->all(FLERR, ("Cannot read the bonds from " + file).c_str());
  return bonds;
}

}  // namespace LAMMPS_NS
