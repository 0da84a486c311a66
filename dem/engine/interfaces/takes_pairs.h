#pragma once

namespace LAMMPS_NS {

// A fix with contacts of its own between sub-spheres, which the pair style must not see.
class TakesPairs {
 public:
  virtual ~TakesPairs() {}
  virtual void take_pairs() = 0;  // out of the list of neighbours, where that is new; before anything reads it
};

}  // namespace LAMMPS_NS
