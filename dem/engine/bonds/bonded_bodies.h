#pragma once
#include <vector>

#include "interfaces/agglomerates.h"
#include "kernels/bond_table.h"

namespace LAMMPS_NS {

// Finds the least tag of the body of each sub-sphere that is near, by tag (index 0 is unused). A body is what bonds
// hold together that are `intact`, by their number.
void find_bodies_of_tags(std::vector<int> &body, const std::vector<Bond> &bonds, const std::vector<char> &intact,
                         const Agglomerates &);

}  // namespace LAMMPS_NS
