#pragma once
#include <string>

namespace LAMMPS_NS {

class LAMMPS;

// The file of the bonds that broke, a CSV table with a line a bond. Lines are kept until `write`, which all ranks call
// together; rank 0 appends them to the file.
class BondEvents {
 public:
  void open(LAMMPS *lmp, const std::string &file);  // writes the head of a new file
  void add(const char *line) { lines_ += line; }
  void write();

 private:
  LAMMPS *lmp_ = nullptr;
  std::string file_;
  std::string lines_;  // not yet written
};

}  // namespace LAMMPS_NS
