#include "bonds/bonded_bodies.h"

#include <algorithm>

namespace LAMMPS_NS {

// Union of the two ends of each bond; the least tag is the root of each tree.
const std::vector<int> &BondedBodies::body_of_tag() {
  if (changes_at_bodies_ == rank_.bonds.changes()) return body_;
  changes_at_bodies_ = rank_.bonds.changes();
  std::vector<int> &parent = body_;
  parent.resize(rank_.agglomerates.tags() + 1);
  rank_.agglomerates.each_near_tag([&](int tag) { parent[tag] = tag; });
  auto root = [&](int tag) {
    while (parent[tag] != tag) tag = parent[tag] = parent[parent[tag]];
    return tag;
  };
  for (const Bond &b : rank_.bonds.all()) {
    if (!rank_.bonds.holds(b.id)) continue;
    const int i = root(b.tag_i), j = root(b.tag_j);
    parent[std::max(i, j)] = std::min(i, j);
  }
  rank_.agglomerates.each_near_tag([&](int tag) { parent[tag] = root(tag); });
  return body_;
}

void BondedBodies::add_elastic_energy_by_body(double *energy) {
  const std::vector<int> &body = body_of_tag();
  energies_.each_elastic([&](int tag, double own) { energy[body[tag]] += own; });
}

const std::vector<BodyMaker::Support> &BondedBodies::supports_of_tags() {
  if (changes_at_supports_ == rank_.bonds.changes()) return supports_;
  changes_at_supports_ = rank_.bonds.changes();
  supports_.assign(rank_.agglomerates.tags() + 1, Support());
  for (const Bond &b : rank_.bonds.all())
    for (int tag : {b.tag_i, b.tag_j})
      if (rank_.bonds.holds(b.id))
        supports_[tag].tensile_N += b.tensile_force, supports_[tag].stiffness_N_m += b.k_normal, supports_[tag].bonds++;
  return supports_;
}

}  // namespace LAMMPS_NS
