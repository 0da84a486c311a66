#pragma once
#include <string>
#include <vector>

namespace LAMMPS_NS {

class Agglomerates;
class FixInput;

// What a material says of its bonds. SI units.
struct BondMaterial {
  double modulus = 0;           // E of the bond, Pa
  double stiffness_ratio = 1;   // k_n / k_s
  double tensile_strength = 0;  // Pa
  double shear_strength = 0;    // Pa; the cohesion where Mohr-Coulomb is chosen
  double tan_friction = 0;      // 0: shear strength independent of the normal force
  // Of the mean of both ends' dilatation. All 0: it is not found (docs/bonds.md).
  double volumetric_modulus = 0;   // kappa, Pa: what a bond's normal stress gains
  double strengthening = 0;        // alpha: tensile strength gained per pressure
  double threshold_share = 0;      // of the tensile strength: the pressure from which on it gains
  double fracture_energy = 0;      // J per m^2 of a bond's section that it takes to break; 0: it snaps

  bool feels_dilatation() const { return volumetric_modulus > 0 || strengthening > 0; }
  bool softens() const { return fracture_energy > 0; }
  double bulk_modulus() const { return modulus / 3 + volumetric_modulus; }  // stress of all bonds over dilatation, Pa
};

// One parallel bond: a short round beam between two sub-spheres. It has no memory: its forces follow from where the two
// sub-spheres are and how they are turned (total form, after Wang 2009). Where it softens, area, stiffnesses and
// strengths are those that it still has (bond_softening.h).
struct Bond {
  int id;                     // its number among those of all stones, from 0
  int tag_i, tag_j;
  double length;              // r0, m
  double direction[3];        // d0, from i to j in the undeformed agglomerate
  double radius;              // of the beam, m
  double area;                // A = pi r^2
  double k_normal;            // E A / r0, N/m
  double k_shear;             // k_normal / ratio, N/m, acting at mid-length
  double k_bend;              // k_normal r^2 / 4 = E I / r0, N m
  double k_twist;             // k_shear r^2 / 2, N m
  double tensile_force;       // strength x area, N
  double shear_force;         // strength x area, N
  double tan_friction;
  double fracture_energy;     // J per m^2 of its section; the material's times the strength factor squared
  const BondMaterial *material;
};

// The bond of `row`, which has the numbers of a line of the file below. Where they are wrong, `input` refuses it with
// the name of its `source`.
Bond bond_of_row(const FixInput &input, const double *row, int id, const std::vector<BondMaterial> &materials,
                 const Agglomerates &agglomerates, const std::string &source);

// File: a line a bond: tag_i tag_j material dx dy dz radius strength_factor, where d is the undeformed vector from
// i to j in m and material counts from 1. The bonds point into `materials`.
std::vector<Bond> read_bonds(const FixInput &input, const std::string &file, const std::vector<BondMaterial> &materials,
                             const Agglomerates &agglomerates);

}  // namespace LAMMPS_NS
