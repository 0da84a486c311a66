#include "bond_volumes.h"

namespace LAMMPS_NS {

BondVolumes::BondVolumes(const std::vector<Bond> &bonds, int tags) {
  for (const Bond &b : bonds) needed_ = needed_ || b.material->feels_dilatation();
  if (!needed_) return;
  per_stretch_.assign(tags + 1, 0.0);
  stiffness_ = per_stretch_;
  bonds_of_.resize(tags + 1);
  std::vector<double> weight(tags + 1, 0.0);
  for (const Bond &b : bonds)
    if (b.material->feels_dilatation())
      for (int tag : {b.tag_i, b.tag_j}) weight[tag] += b.area * b.length;
  for (size_t k = 0; k < bonds.size(); k++) {
    const BondMaterial &material = *bonds[k].material;
    if (!material.feels_dilatation()) continue;
    for (int tag : {bonds[k].tag_i, bonds[k].tag_j}) {
      bonds_of_[tag].push_back(k);
      per_stretch_[tag] = 3 / weight[tag];
      stiffness_[tag] = 0.75 * material.volumetric_modulus / weight[tag];
    }
  }
}

}  // namespace LAMMPS_NS
