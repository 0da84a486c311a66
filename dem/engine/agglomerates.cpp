#include "agglomerates.h"

#include <fstream>
#include <numeric>

#include "error.h"
#include "lammps.h"
#include "stone_stream.h"

namespace LAMMPS_NS {

Agglomerates::Agglomerates(LAMMPS *lmp, const std::string &file) : of_tag_(1, -1) {
  std::ifstream in(file);
  for (int size; in >> size;) {
    first_tag_.push_back(of_tag_.size());
    of_tag_.insert(of_tag_.end(), size, count());
    size_.push_back(size);
  }
  if (!in.eof() || size_.empty())
    lmp->error->all(FLERR, ("Cannot read the sizes of the agglomerates from " + file).c_str());
  all_.resize(count());
  std::iota(all_.begin(), all_.end(), 0);
}

const std::vector<int> &Agglomerates::near() const { return stream_ ? stream_->near() : all_; }

}  // namespace LAMMPS_NS
