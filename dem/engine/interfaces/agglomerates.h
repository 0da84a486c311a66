#pragma once
#include <string>
#include <vector>

namespace LAMMPS_NS {

class Fix;
class LAMMPS;
class StoneStream;

// Which agglomerate a sub-sphere belongs to. Tags 1..N are given agglomerate by agglomerate, so the file only
// lists how many sub-spheres each one has.
class Agglomerates {
 public:
  Agglomerates(LAMMPS *lmp, Fix *of, const std::string &file);
  // At `init` of the fix that it is of: refuses a deck whose sub-spheres are not these, or will not stay these.
  void init();
  int count() const { return static_cast<int>(size_.size()); }
  int tags() const { return static_cast<int>(of_tag_.size()) - 1; }
  int of_tag(int tag) const { return of_tag_[tag]; }
  int first_tag(int agglomerate) const { return first_tag_[agglomerate]; }
  int size(int agglomerate) const { return size_[agglomerate]; }  // sub-spheres

  // Those that are near, ascending: all of them, or where stones come and go (fix stones) those that are there. What
  // is done again and again goes by this list, so that its cost does not grow with what has fallen before.
  const std::vector<int> &near() const;
  template <class Visit> void each_near_tag(Visit visit) const {
    for (int a : near())
      for (int tag = first_tag_[a]; tag < first_tag_[a] + size_[a]; tag++) visit(tag);
  }

 private:
  LAMMPS *lmp_;
  Fix *fix_;
  std::vector<int> size_, first_tag_, all_;
  std::vector<int> of_tag_;  // index 0 unused, as tags start at 1
  const StoneStream *stream_ = nullptr;
};

}  // namespace LAMMPS_NS
