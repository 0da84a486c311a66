#include "contact/sphere_memory.h"

#include <algorithm>
#include <vector>

#include "atom.h"
#include "interfaces/checkpoint_file.h"
#include "lammps.h"
#include "memory.h"

namespace LAMMPS_NS {

SphereMemory::SphereMemory(LAMMPS *lmp, int columns, const char *name) : lmp_(lmp), columns_(columns), name_(name) {
  grow_arrays(lmp->atom->nmax);
  for (int i = 0; i < lmp->atom->nlocal; i++) set_arrays(i);
}

SphereMemory::~SphereMemory() { lmp_->memory->destroy(rows_); }

void SphereMemory::grow_arrays(int nmax) { lmp_->memory->grow(rows_, nmax, columns_, name_); }

void SphereMemory::copy_arrays(int i, int j) { std::copy_n(rows_[i], columns_, rows_[j]); }

void SphereMemory::set_arrays(int i) { std::fill_n(rows_[i], columns_, 0.0); }

int SphereMemory::pack_exchange(int i, double *buf) const {
  std::copy_n(rows_[i], columns_, buf);
  return columns_;
}

int SphereMemory::unpack_exchange(int i, const double *buf) {
  std::copy_n(buf, columns_, rows_[i]);
  return columns_;
}

void SphereMemory::save(CheckpointWriter &out, const std::string &name) const {
  const Atom *atom = lmp_->atom;
  std::vector<double> rows;
  for (int i = 0; i < atom->nlocal; i++) {
    if (std::all_of(rows_[i], rows_[i] + columns_, [](double value) { return value == 0; })) continue;
    rows.push_back(atom->tag[i]);
    rows.insert(rows.end(), rows_[i], rows_[i] + columns_);
  }
  out.rows(name, rows);
}

void SphereMemory::restore(const CheckpointReader &in, const std::string &name) {
  Atom *atom = lmp_->atom;
  const std::vector<double> &rows = in.rows(name, 1 + columns_);
  for (size_t k = 0; k < rows.size(); k += 1 + columns_) {
    const int i = atom->map(static_cast<int>(rows[k]));
    if (i >= 0 && i < atom->nlocal) std::copy_n(&rows[k + 1], columns_, rows_[i]);
  }
}

}  // namespace LAMMPS_NS
