#include "network/stone_bonds.h"

#include <mpi.h>

#include <algorithm>

#include "comm.h"

namespace LAMMPS_NS {

StoneBonds::StoneBonds(LAMMPS *lmp, Fix *fix, const std::string &file, const std::vector<BondMaterial> &materials,
                       const Agglomerates &agglomerates)
    : Pointers(lmp), input_(lmp, fix), materials_(materials), agglomerates_(agglomerates),
      volumes_(agglomerates.tags()) {
  if (file != "none") bonds_ = read_bonds(input_, file, materials_, agglomerates_);
  for (const Bond &b : bonds_) {
    const int a = agglomerates_.of_tag(b.tag_i);
    if (blocks_.empty() || a != blocks_.back().agglomerate)
      blocks_.push_back({a, b.id, static_cast<size_t>(b.id), 0});
    blocks_.back().count++;
  }
  intact_.assign(bonds_.size(), 1);
  volumes_.enter(bonds_);
  softening_.enter(bonds_);
}

double StoneBonds::longest() const {
  double longest = 0;
  for (const Bond &b : bonds_) longest = std::max(longest, b.length);
  return longest;
}

// The stones lie in ascending order, whenever each of them came.
void StoneBonds::enter(const EnteringStone &stone) {
  const size_t count = stone.bonds.size() / EnteringStone::BOND_COLUMNS;
  std::vector<Bond> added;
  for (size_t k = 0; k < count; k++)
    added.push_back(bond_of_row(input_, &stone.bonds[k * EnteringStone::BOND_COLUMNS], stone.first_bond + k, materials_,
                                agglomerates_, "the stones"));
  auto at = std::find_if(blocks_.begin(), blocks_.end(),
                         [&](const Block &b) { return b.agglomerate > stone.agglomerate; });
  const size_t start = at == blocks_.end() ? bonds_.size() : at->start;
  bonds_.insert(bonds_.begin() + start, added.begin(), added.end());
  at = blocks_.insert(at, {stone.agglomerate, stone.first_bond, start, count});
  for (++at; at != blocks_.end(); ++at) at->start += count;
  if (intact_.size() < stone.first_bond + count) intact_.resize(stone.first_bond + count, 0);
  std::fill_n(intact_.begin() + stone.first_bond, count, 1);
  volumes_.enter(added);
  softening_.enter(added);
  moves_++;
  changes_++;
}

void StoneBonds::leave(int agglomerate) {
  auto at = std::find_if(blocks_.begin(), blocks_.end(), [&](const Block &b) { return b.agglomerate == agglomerate; });
  if (at == blocks_.end()) return;
  const size_t count = at->count;
  bonds_.erase(bonds_.begin() + at->start, bonds_.begin() + at->start + count);
  at = blocks_.erase(at);
  for (; at != blocks_.end(); ++at) at->start -= count;
  volumes_.leave(agglomerates_.first_tag(agglomerate), agglomerates_.size(agglomerate));
  moves_++;
  changes_++;
}

const Bond &StoneBonds::of(int id) const {
  auto after = std::upper_bound(blocks_.begin(), blocks_.end(), id,
                                [](int number, const Block &b) { return number < b.first_id; });
  return bonds_[std::prev(after)->start + (id - std::prev(after)->first_id)];
}

void StoneBonds::sever(int id) {
  intact_[id] = 0;
  changes_++;
  if (comm->nprocs > 1) newly_broken_.push_back(id);
}

void StoneBonds::agree() {
  if (comm->nprocs == 1) return;
  int mine = newly_broken_.size(), total = 0;
  std::vector<int> count(comm->nprocs), offset(comm->nprocs);
  MPI_Allgather(&mine, 1, MPI_INT, count.data(), 1, MPI_INT, world);
  for (int p = 0; p < comm->nprocs; p++) offset[p] = total, total += count[p];
  std::vector<int> all(total);
  MPI_Allgatherv(newly_broken_.data(), mine, MPI_INT, all.data(), count.data(), offset.data(), MPI_INT, world);
  for (int id : all) changes_ += intact_[id], intact_[id] = 0;
  newly_broken_.clear();
  if (softening_.needed()) softening_.share(world, [&](int id) -> Bond & { return of(id); });
}

void StoneBonds::save(CheckpointWriter &out) const {
  std::vector<double> intact;
  for (const Bond &b : bonds_) intact.push_back(intact_[b.id]);
  out.common("bond_intact", intact);
  if (softening_.needed()) softening_.save(out, bonds_);
}

void StoneBonds::restore(const CheckpointReader &in) {
  const std::vector<double> &intact = in.common("bond_intact", bonds_.size());
  for (size_t b = 0; b < bonds_.size(); b++) intact_[bonds_[b].id] = intact[b] != 0;
  if (softening_.needed()) softening_.restore(in, bonds_);
  changes_++;
}

}  // namespace LAMMPS_NS
