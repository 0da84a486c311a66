#include "agglomerates.h"

#include <fstream>

#include "error.h"
#include "lammps.h"

namespace LAMMPS_NS {

Agglomerates::Agglomerates(LAMMPS *lmp, const std::string &file) : of_tag_(1, -1) {
  std::ifstream in(file);
  for (int size; in >> size;) {
    of_tag_.insert(of_tag_.end(), size, count());
    size_.push_back(size);
  }
  if (!in.eof() || size_.empty())
    lmp->error->all(FLERR, ("Cannot read the sizes of the agglomerates from " + file).c_str());
}

}  // namespace LAMMPS_NS
