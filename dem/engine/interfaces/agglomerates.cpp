#include "interfaces/agglomerates.h"

#include <mpi.h>

#include <cstring>
#include <fstream>
#include <numeric>

#include "atom.h"
#include "interfaces/checkpointed.h"
#include "base/fix_input.h"
#include "base/fixes.h"
#include "lammps.h"
#include "interfaces/stone_stream.h"

namespace LAMMPS_NS {

Agglomerates::Agglomerates(LAMMPS *lmp, Fix *of, const std::string &file) : lmp_(lmp), fix_(of), of_tag_(1, -1) {
  const FixInput input(lmp, of);
  if (!lmp->atom->sphere_flag) input.refuse("needs `atom_style granular`");
  if (!lmp->atom->tag_enable || !lmp->atom->map_style) input.refuse("needs `atom_modify map array`");
  std::ifstream in(file);
  for (int size; in >> size;) {
    if (size < 1) input.refuse(file + ": an agglomerate of " + std::to_string(size) + " sub-spheres; allowed is 1 on");
    first_tag_.push_back(of_tag_.size());
    of_tag_.insert(of_tag_.end(), size, count());
    size_.push_back(size);
  }
  if (!in.eof() || size_.empty()) input.refuse("cannot read the sizes of the agglomerates from " + file);
  all_.resize(count());
  std::iota(all_.begin(), all_.end(), 0);
}

void Agglomerates::init() {
  const FixInput input(lmp_, fix_);
  const Atom *atom = lmp_->atom;
  stream_ = fix_that_is<StoneStream>(lmp_->modify);
  int unknown = 0;
  for (int i = 0; i < atom->nlocal; i++) unknown += atom->tag[i] < 1 || atom->tag[i] > tags();
  MPI_Allreduce(MPI_IN_PLACE, &unknown, 1, MPI_INT, MPI_SUM, lmp_->world);
  const auto *resumed = fix_that_is<ResumesRun>(lmp_->modify);
  const bool all_are_there = stream_ || (resumed && resumed->is_resuming()) || atom->natoms == tags();
  if (unknown || !all_are_there)
    input.refuse("the deck has " + std::to_string(atom->natoms) + " sub-spheres, and the agglomerates those of tags 1 " +
                 "to " + std::to_string(tags()) + "; all of these must be there, and no others");
  for (const Fix *fix : fixes_that_are<Fix>(lmp_->modify))
    if (std::strncmp(fix->style, "insert/", 7) == 0)
      input.refuse(std::string("the deck has fix ") + fix->id + " of style " + fix->style +
                   ", whose particles are of no agglomerate; fix stones lets stones come");
}

const std::vector<int> &Agglomerates::near() const { return stream_ ? stream_->near() : all_; }

}  // namespace LAMMPS_NS
