#pragma once
#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

#include "interfaces/stone_stream.h"

namespace LAMMPS_NS {

class LAMMPS;

// The stones of a stream on disk, each read when it enters. All numbers are of 8 bytes, in the order of the machine:
//
//   int64 stones, int64 materials, double least radius of a sub-sphere, double greatest of each material
//   of each stone, in the order of the agglomerates: int64 step at which it enters, where it begins in the file in
//     bytes, sub-spheres, bonds, whether it has a smooth surface, columns behind its faces; double spin[3]
//   of each stone: its sub-spheres, bonds, numbers of the smooth contact, surface, faces, as doubles (EnteringStone)
class StoneFile {
 public:
  StoneFile(LAMMPS *, const std::string &file);
  ~StoneFile();
  StoneFile(const StoneFile &) = delete;
  StoneFile &operator=(const StoneFile &) = delete;

  int count() const { return static_cast<int>(index_.size()); }
  int64_t size(int agglomerate) const { return index_[agglomerate].atoms; }  // sub-spheres
  bigint entry(int agglomerate) const { return index_[agglomerate].entry; }
  int types() const { return static_cast<int>(greatest_radius_.size()); }
  double least_radius() const { return least_radius_; }
  double greatest_radius(int type) const;  // of a type of LIGGGHTS; 0 for one that no stone has
  EnteringStone read(int agglomerate) const;

 private:
  struct Entry {
    int64_t entry, at, atoms, bonds, smooth, faces;
    double spin[3];
  };
  LAMMPS *lmp_;
  std::string file_;
  std::FILE *in_ = nullptr;
  std::vector<Entry> index_;
  std::vector<int> first_tag_, first_bond_;
  std::vector<double> greatest_radius_;
  double least_radius_ = 0;

  void take(void *to, size_t bytes) const;
};

}  // namespace LAMMPS_NS
