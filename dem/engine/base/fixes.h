#pragma once
#include <vector>

#include "modify.h"

namespace LAMMPS_NS {

// All fixes of the deck that are a T, in the order of the deck.
template <class T> std::vector<T *> fixes_that_are(const Modify *modify) {
  std::vector<T *> found;
  for (int k = 0; k < modify->nfix; k++)
    if (auto *one = dynamic_cast<T *>(modify->fix[k])) found.push_back(one);
  return found;
}

// The last fix of the deck that is a T, or null.
template <class T> T *fix_that_is(const Modify *modify) {
  const std::vector<T *> found = fixes_that_are<T>(modify);
  return found.empty() ? nullptr : found.back();
}

}  // namespace LAMMPS_NS
