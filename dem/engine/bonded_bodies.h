#pragma once
#include <vector>

#include "bond_table.h"

namespace LAMMPS_NS {

// The least tag of the body of each sub-sphere, by tag (from 1 to `tags`; index 0 is unused). A body is what intact
// bonds hold together.
std::vector<int> bodies_of_tags(const std::vector<Bond> &bonds, const std::vector<char> &intact, int tags);

}  // namespace LAMMPS_NS
