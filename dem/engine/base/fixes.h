#pragma once
#include <vector>

#include "modify.h"

namespace LAMMPS_NS {

// A fix may consist of parts, each of which is to other fixes what the fix itself would be without parts.
class FixPart {
 public:
  virtual ~FixPart() {}
};
class HasParts {
 public:
  virtual ~HasParts() {}
  virtual std::vector<FixPart *> parts() = 0;
};

// All fixes of the deck that are a T, or have a part that is one, in the order of the deck.
template <class T> std::vector<T *> fixes_that_are(const Modify *modify) {
  std::vector<T *> found;
  for (int k = 0; k < modify->nfix; k++) {
    if (auto *one = dynamic_cast<T *>(modify->fix[k])) found.push_back(one);
    if (auto *whole = dynamic_cast<HasParts *>(modify->fix[k]))
      for (FixPart *part : whole->parts())
        if (auto *one = dynamic_cast<T *>(part)) found.push_back(one);
  }
  return found;
}

// The last fix of the deck that is a T, or has a part that is one, or null.
template <class T> T *fix_that_is(const Modify *modify) {
  const std::vector<T *> found = fixes_that_are<T>(modify);
  return found.empty() ? nullptr : found.back();
}

}  // namespace LAMMPS_NS
