#include "stones/stone_file.h"

#include "error.h"
#include "lammps.h"

namespace LAMMPS_NS {

StoneFile::StoneFile(LAMMPS *lmp, const std::string &file) : lmp_(lmp), file_(file) {
  in_ = std::fopen(file.c_str(), "rb");
  if (!in_) lmp->error->one(FLERR, ("cannot read " + file).c_str());
  int64_t counts[2];
  take(counts, sizeof counts);
  take(&least_radius_, 8);
  greatest_radius_.resize(counts[1]);
  take(greatest_radius_.data(), 8 * greatest_radius_.size());
  index_.resize(counts[0]);
  take(index_.data(), sizeof(Entry) * index_.size());
  int tag = 1, bond = 0;
  for (const Entry &e : index_) {
    first_tag_.push_back(tag);
    first_bond_.push_back(bond);
    tag += static_cast<int>(e.atoms), bond += static_cast<int>(e.bonds);
  }
}

StoneFile::~StoneFile() {
  if (in_) std::fclose(in_);
}

void StoneFile::take(void *to, size_t bytes) const {
  if (bytes > 0 && std::fread(to, bytes, 1, in_) != 1)
    lmp_->error->one(FLERR, (file_ + ": cut off").c_str());
}

double StoneFile::greatest_radius(int type) const {
  return type >= 1 && type <= static_cast<int>(greatest_radius_.size()) ? greatest_radius_[type - 1] : 0;
}

EnteringStone StoneFile::read(int agglomerate) const {
  const Entry &e = index_[agglomerate];
  EnteringStone s;
  s.agglomerate = agglomerate, s.first_tag = first_tag_[agglomerate], s.first_bond = first_bond_[agglomerate];
  s.spin = Vec(e.spin);
  s.atoms.resize(e.atoms * EnteringStone::ATOM_COLUMNS);
  s.bonds.resize(e.bonds * EnteringStone::BOND_COLUMNS);
  if (e.smooth) s.contact.resize(EnteringStone::CONTACT_NUMBERS);
  if (e.smooth) s.surface.resize(e.atoms * EnteringStone::SURFACE_COLUMNS);
  s.faces.resize(e.faces * EnteringStone::FACE_COLUMNS);
  if (fseeko(in_, e.at, SEEK_SET) != 0) lmp_->error->one(FLERR, (file_ + ": cut off").c_str());
  for (std::vector<double> *part : {&s.atoms, &s.bonds, &s.contact, &s.surface, &s.faces}) take(part->data(), 8 * part->size());
  return s;
}

}  // namespace LAMMPS_NS
