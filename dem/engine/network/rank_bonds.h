#pragma once
#include <memory>
#include <string>

#include "network/local_bonds.h"
#include "network/sphere_motion.h"
#include "network/stone_bonds.h"

namespace LAMMPS_NS {

// What a rank knows of bonds: all that there are, those of its sub-spheres, and how these move.
struct RankBonds {
  RankBonds(LAMMPS *lmp, Fix *fix, const std::string &agglomerates_file, const std::string &bonds_file,
            const std::vector<BondMaterial> &materials)
      : agglomerates(lmp, fix, agglomerates_file), bonds(lmp, fix, bonds_file, materials, agglomerates),
        local(lmp, bonds, agglomerates), motion(lmp, local) {}
  Agglomerates agglomerates;
  StoneBonds bonds;
  LocalBonds local;
  SphereMotion motion;
};

}  // namespace LAMMPS_NS
