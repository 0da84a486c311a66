#include "network/bond_volumes.h"

#include <map>

namespace LAMMPS_NS {

void BondVolumes::enter(const std::vector<Bond> &bonds) {
  std::map<int, double> weight;
  for (const Bond &b : bonds)
    if (b.material->feels_dilatation())
      for (int tag : {b.tag_i, b.tag_j}) weight[tag] += b.area * b.length;
  needed_ = needed_ || !weight.empty();
  for (const Bond &b : bonds) {
    if (!b.material->feels_dilatation()) continue;
    for (int tag : {b.tag_i, b.tag_j}) {
      bonds_of_[tag].push_back(b.id);
      per_stretch_[tag] = 3 / weight[tag];
      stiffness_[tag] = 0.75 * b.material->volumetric_modulus / weight[tag];
    }
  }
}

void BondVolumes::leave(int first_tag, int tags) {
  for (int tag = first_tag; tag < first_tag + tags; tag++) bonds_of_[tag] = {};
}

}  // namespace LAMMPS_NS
