#include "bonded_bodies.h"

#include <algorithm>
#include <numeric>

namespace LAMMPS_NS {

// Union of the two ends of each bond; the least tag is the root of each tree.
std::vector<int> bodies_of_tags(const std::vector<Bond> &bonds, const std::vector<char> &intact, int tags) {
  std::vector<int> parent(tags + 1);
  std::iota(parent.begin(), parent.end(), 0);
  auto root = [&](int tag) {
    while (parent[tag] != tag) tag = parent[tag] = parent[parent[tag]];
    return tag;
  };
  for (size_t k = 0; k < bonds.size(); k++) {
    if (!intact[k]) continue;
    const int i = root(bonds[k].tag_i), j = root(bonds[k].tag_j);
    parent[std::max(i, j)] = std::min(i, j);
  }
  for (int tag = 1; tag <= tags; tag++) parent[tag] = root(tag);
  return parent;
}

}  // namespace LAMMPS_NS
