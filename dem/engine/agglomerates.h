#pragma once
#include <string>
#include <vector>

namespace LAMMPS_NS {

class LAMMPS;

// Which agglomerate a sub-sphere belongs to. Tags 1..N are given agglomerate by agglomerate, so the file only
// lists how many sub-spheres each one has.
class Agglomerates {
 public:
  Agglomerates(LAMMPS *lmp, const std::string &file);
  int count() const { return static_cast<int>(size_.size()); }
  int tags() const { return static_cast<int>(of_tag_.size()) - 1; }
  int of_tag(int tag) const { return of_tag_[tag]; }

 private:
  std::vector<int> size_;
  std::vector<int> of_tag_;  // index 0 unused, as tags start at 1
};

}  // namespace LAMMPS_NS
