#pragma once
#include <vector>

#include "kernels/bond_table.h"

namespace LAMMPS_NS {

// What a contact law of whole stones must know of their bonds.
class BondNetwork {
 public:
  virtual ~BondNetwork() {}
  virtual const std::vector<Bond> &bonds() const = 0;      // of the stones that are near, broken ones as well
  virtual bool holds(size_t bond) const = 0;               // by its number, Bond::id
  virtual long long changes() const = 0;                   // counts whatever changes `bonds` or `holds`
  virtual void agree_on_broken() = 0;                      // makes `holds` the same on all ranks; all call it
  virtual const double *quaternion(int i) const = 0;       // of sub-sphere i: rotation since the undeformed state
};

}  // namespace LAMMPS_NS
