#pragma once
#include <vector>

#include "bodies/outline.h"

namespace LAMMPS_NS {

// Which bodies could come together within a time. Each body stays in a box that falls as all bodies fall; a sweep along
// x finds the boxes that overlap. For n bodies spread over a plate this costs far less than the n^2 times of all pairs,
// and no pair is left out that the times of outline.h would find.
class ReachPairs {
 public:
  // Within `time_s`, for bodies that may gain the speed `unforeseen_m_s` each. Pairs of which both come after the first
  // `wanted` bodies are left out.
  ReachPairs(const std::vector<Outline *> &, size_t wanted, double time_s, double unforeseen_m_s);
  // The others that body k could meet, ascending, as in the list of bodies.
  const std::vector<int> &of(size_t k) const { return others_[k]; }

 private:
  std::vector<std::vector<int>> others_;
};

}  // namespace LAMMPS_NS
