#pragma once
#include <string>

#include "bonds/bond_energies.h"
#include "record/bond_events.h"

namespace LAMMPS_NS {

// What becomes of bonds that fail in a step: those of a material that softens go on weaker, as long as anything is left
// of them, and all others break, which is an event.
class BondFailures : private Pointers {
 public:
  BondFailures(LAMMPS *, const std::string &events_file, RankBonds &, BondForces &, BondEnergies &);
  void add(int id);
  void write_events() { events_.write(); }  // all ranks together

 private:
  RankBonds &rank_;
  BondForces &forces_;
  BondEnergies &energies_;
  BondEvents events_;

  bool is_counted(const Bond &) const;  // by this rank, which owns sub-sphere i
  bool soften(Bond &);
  void sever(const Bond &);
};

}  // namespace LAMMPS_NS
