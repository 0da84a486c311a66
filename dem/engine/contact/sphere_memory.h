#pragma once
#include <string>

namespace LAMMPS_NS {

class CheckpointReader;
class CheckpointWriter;
class LAMMPS;

// A row of numbers of each sub-sphere, all zero at first, that stays with the sub-sphere when it moves in memory or to
// another rank. The fix that owns it passes on its calls of the same names.
class SphereMemory {
 public:
  SphereMemory(LAMMPS *lmp, int columns, const char *name);
  ~SphereMemory();
  SphereMemory(const SphereMemory &) = delete;
  SphereMemory &operator=(const SphereMemory &) = delete;

  int columns() const { return columns_; }
  double *row(int i) { return rows_[i]; }
  const double *row(int i) const { return rows_[i]; }

  void grow_arrays(int nmax);
  void copy_arrays(int i, int j);
  void set_arrays(int i);
  int pack_exchange(int i, double *buf) const;
  int unpack_exchange(int i, const double *buf);

  void save(CheckpointWriter &, const std::string &name) const;  // rows that are not all zero
  void restore(const CheckpointReader &, const std::string &name);

 private:
  LAMMPS *lmp_;
  int columns_;
  const char *name_;
  double **rows_ = nullptr;
};

}  // namespace LAMMPS_NS
