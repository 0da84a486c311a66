#include "kernels/bond_table.h"

#include <cmath>
#include <fstream>

#include "interfaces/agglomerates.h"
#include "base/fix_input.h"

namespace LAMMPS_NS {

namespace {

bool is_whole_from_1(double number, int most) { return number >= 1 && number <= most && number == std::floor(number); }

void check_row(const FixInput &input, const double *row, int materials, const Agglomerates &agglomerates,
               const std::string &bond) {
  for (int end = 0; end < 2; end++)
    if (!is_whole_from_1(row[end], agglomerates.tags()))
      input.refuse(bond + ": a tag must be one of 1 to " + std::to_string(agglomerates.tags()));
  const int i = static_cast<int>(row[0]), j = static_cast<int>(row[1]);
  if (i == j || agglomerates.of_tag(i) != agglomerates.of_tag(j))
    input.refuse(bond + ": joins the tags " + std::to_string(i) + " and " + std::to_string(j) +
                 ", which must be two sub-spheres of one agglomerate");
  if (!is_whole_from_1(row[2], materials))
    input.refuse(bond + ": the material must be one of 1 to " + std::to_string(materials) + ", which the deck gives");
  input.checked(bond + ": length", norm(Vec(row + 3)), Allowed::ABOVE_0);
  input.checked(bond + ": radius", row[6], Allowed::ABOVE_0);
  input.checked(bond + ": strength_factor", row[7], Allowed::ABOVE_0);
}

}  // namespace

Bond bond_of_row(const FixInput &input, const double *row, int id, const std::vector<BondMaterial> &materials,
                 const Agglomerates &agglomerates, const std::string &source) {
  check_row(input, row, static_cast<int>(materials.size()), agglomerates, source + ", bond " + std::to_string(id + 1));
  const int material = static_cast<int>(row[2]);
  const double *d = row + 3, strength_factor = row[7];
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
  b.fracture_energy = strength_factor * strength_factor * m.fracture_energy;  // the energy that it can hold does likewise
  b.material = &m;
  return b;
}

std::vector<Bond> read_bonds(const FixInput &input, const std::string &file, const std::vector<BondMaterial> &materials,
                             const Agglomerates &agglomerates) {
  std::ifstream in(file);
  std::vector<Bond> bonds;
  for (double row[8]; in >> row[0];) {
    for (int k = 1; k < 8; k++) in >> row[k];
    if (!in) in.clear(std::ios::failbit);  // cut off, which is not the end
    else bonds.push_back(bond_of_row(input, row, static_cast<int>(bonds.size()), materials, agglomerates, file));
  }
  if (!in.eof() || bonds.empty())
    input.refuse(file + ": after " + std::to_string(bonds.size()) + " bonds must come one of eight numbers");
  return bonds;
}

}  // namespace LAMMPS_NS
