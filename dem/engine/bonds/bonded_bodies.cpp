#include "bonds/bonded_bodies.h"

#include <algorithm>

namespace LAMMPS_NS {

// Union of the two ends of each bond; the least tag is the root of each tree.
void find_bodies_of_tags(std::vector<int> &parent, const std::vector<Bond> &bonds, const std::vector<char> &intact,
                         const Agglomerates &agglomerates) {
  parent.resize(agglomerates.tags() + 1);
  agglomerates.each_near_tag([&](int tag) { parent[tag] = tag; });
  auto root = [&](int tag) {
    while (parent[tag] != tag) tag = parent[tag] = parent[parent[tag]];
    return tag;
  };
  for (const Bond &b : bonds) {
    if (!intact[b.id]) continue;
    const int i = root(b.tag_i), j = root(b.tag_j);
    parent[std::max(i, j)] = std::min(i, j);
  }
  agglomerates.each_near_tag([&](int tag) { parent[tag] = root(tag); });
}

}  // namespace LAMMPS_NS
