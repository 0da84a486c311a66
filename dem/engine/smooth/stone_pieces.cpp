#include "smooth/stone_pieces.h"

#include <mpi.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "atom.h"
#include "comm.h"
#include "lammps.h"

namespace LAMMPS_NS {

StonePieces::StonePieces(LAMMPS *lmp, const Agglomerates &agglomerates, const StoneSurfaces &surfaces,
                         BondNetwork &bonds)
    : lmp_(lmp), agglomerates_(agglomerates), surfaces_(surfaces), bonds_(bonds) {
  const size_t tags = agglomerates.tags();
  now_.assign(NUMBERS * (tags + 1), 0);
  bonds_first_.assign(tags + 1, 0);
  bonds_of_.resize(tags + 1);
  for (const Bond &b : bonds.bonds()) add_bond(b.id, b.tag_i, b.tag_j);
}

void StonePieces::enter(const EnteringStone &stone) {
  const double *row = stone.bonds.data();
  for (int id = stone.first_bond; row < stone.bonds.data() + stone.bonds.size(); row += EnteringStone::BOND_COLUMNS)
    add_bond(id++, static_cast<int>(row[0]), static_cast<int>(row[1]));
}

void StonePieces::add_bond(int id, int tag_i, int tag_j) {
  for (const int tag : {tag_i, tag_j}) bonds_first_[tag]++, bonds_of_[tag].push_back(id);
}

void StonePieces::leave(int agglomerate) {
  const int first = agglomerates_.first_tag(agglomerate);
  for (int tag = first; tag < first + agglomerates_.size(agglomerate); tag++) bonds_of_[tag] = {};
}

void StonePieces::look(const std::vector<int> &wanted, const std::vector<char> &touching) {
  gather(wanted, touching);
  find_pieces();
}

void StonePieces::gather(const std::vector<int> &wanted, const std::vector<char> &touching) {
  std::vector<double> found;
  for (const int a : wanted) {
    const SmoothStone &s = surfaces_.stones()[a];
    for (int tag = s.first_tag; tag < s.first_tag + s.count; tag++) {
      found.resize(found.size() + NUMBERS, 0);
      double *row = found.data() + found.size() - NUMBERS;
      row[10] = touching[tag];  // where it was at the last step, which may be another rank
      note(tag, row);
    }
  }
  if (lmp_->comm->nprocs > 1) {
    const std::vector<double> mine = found;
    MPI_Allreduce(mine.data(), found.data(), found.size(), MPI_DOUBLE, MPI_SUM, lmp_->world);
  }
  const double *row = found.data();
  for (const int a : wanted) {
    const SmoothStone &s = surfaces_.stones()[a];
    std::copy_n(row, NUMBERS * s.count, &now_[NUMBERS * static_cast<size_t>(s.first_tag)]);
    row += NUMBERS * s.count;
  }
}

// How the sub-sphere moves, if it is of this rank.
void StonePieces::note(int tag, double *row) const {
  Atom *atom = lmp_->atom;
  const int i = atom->map(tag);
  if (i < 0 || i >= atom->nlocal) return;
  std::copy_n(atom->x[i], 3, row);
  std::copy_n(atom->v[i], 3, row + 3);
  std::copy_n(bonds_.quaternion(i), 4, row + 6);
  row[11] = 1;
}

void StonePieces::find_pieces() {
  bonds_.agree_on_broken();
  if (bonds_.changes() == changes_) return;
  changes_ = bonds_.changes();
  piece_.resize(bonds_first_.size());
  bonds_now_.resize(piece_.size());
  in_surface_.resize(piece_.size());
  agglomerates_.each_near_tag([&](int tag) { piece_[tag] = tag, bonds_now_[tag] = in_surface_[tag] = 0; });
  auto root = [&](int tag) {
    while (piece_[tag] != tag) tag = piece_[tag] = piece_[piece_[tag]];
    return tag;
  };
  for (const Bond &b : bonds_.bonds()) {
    if (!bonds_.holds(b.id)) continue;
    bonds_now_[b.tag_i]++, bonds_now_[b.tag_j]++;
    const int i = root(b.tag_i), j = root(b.tag_j);
    piece_[std::max(i, j)] = std::min(i, j);
  }
  agglomerates_.each_near_tag([&](int tag) {
    piece_[tag] = root(tag);
    in_surface_[piece_[tag]] += surfaces_.is_surface(tag);
  });
}

std::map<int, StonePieces::Motion> StonePieces::motions(const SmoothStone &s) const {
  std::map<int, std::vector<int>> tags;
  for (int tag = s.first_tag; tag < s.first_tag + s.count; tag++)
    if (may_have_patch(tag)) tags[piece_[tag]].push_back(tag);
  std::map<int, Motion> found;
  for (const auto &[piece, own] : tags) found[piece] = motion(own);
  return found;
}

// A patch's centre is a mean of what its members take for the centre. Those that hold by less than half their bonds are
// in no new patch.
Shell StonePieces::surface(const std::vector<int> &tags) {
  find_pieces();
  std::map<int, std::vector<int>> pieces;
  for (const int tag : tags)
    if (may_have_patch(tag)) pieces[piece_[tag]].push_back(tag), note(tag, &now_[NUMBERS * static_cast<size_t>(tag)]);
  Shell all;
  size_t most = 0;
  std::vector<Vec> centers;
  for (const auto &[piece, own] : pieces) {
    const Motion m = motion(own);
    if (own.size() > most) most = own.size(), all.x = m.center;
    const size_t others = centers.size();
    for (const int tag : own)
      if (surfaces_.is_surface(tag) && !is_loose(tag)) centers.push_back(position(tag) - m.turned(surfaces_.place(tag)));
    if (centers.size() > others) centers.push_back(m.center);
  }
  if (centers.empty()) return all;
  double off = 0;
  for (const Vec &center : centers) off = std::max(off, norm(center - all.x));
  const SmoothStone &stone = surfaces_.stones()[agglomerates_.of_tag(tags[0])];
  all.inner = std::max(0.0, (1 - DEFORMED) * stone.radius - off), all.outer = stone.radius + off;
  all.patch = stone.patch_radius;
  return all;
}

StonePieces::Motion StonePieces::motion(const SmoothStone &s, int piece) const {
  std::vector<int> tags;
  for (int tag = s.first_tag; tag < s.first_tag + s.count; tag++)
    if (piece_[tag] == piece) tags.push_back(tag);
  return motion(tags);
}

StonePieces::Motion StonePieces::motion(const std::vector<int> &tags) const {
  Motion b;
  std::array<double, 4> sum = {0, 0, 0, 0};
  for (const int tag : tags) {
    const double *row = &now_[NUMBERS * static_cast<size_t>(tag)], *q = row + 6, m = surfaces_.mass(tag);
    b.is_here = b.is_here && row[11] != 0;
    // q and -q are the same rotation.
    const double side = sum[0] * q[0] + sum[1] * q[1] + sum[2] * q[2] + sum[3] * q[3];
    for (int k = 0; k < 4; k++) sum[k] += (side < 0 ? -m : m) * q[k];
    b.mass += m;
  }
  const double size = std::sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2] + sum[3] * sum[3]);
  if (b.is_here) b.turned = {sum[0] / size, Vec(sum[1] / size, sum[2] / size, sum[3] / size)};
  Vec middle, momentum;
  for (const int tag : tags) {
    const double *row = &now_[NUMBERS * static_cast<size_t>(tag)], part = surfaces_.mass(tag) / b.mass;
    b.center += part * (Vec(row) - b.turned(surfaces_.place(tag)));
    b.velocity += part * Vec(row + 3);
    middle += part * Vec(row);
  }
  Tensor inertia;
  for (const int tag : tags) {
    const double *row = &now_[NUMBERS * static_cast<size_t>(tag)], m = surfaces_.mass(tag), r = surfaces_.radius(tag);
    inertia.add_inertia(m, Vec(row) - middle, 0.4 * m * r * r);
    momentum += m * cross(Vec(row) - middle, Vec(row + 3));
  }
  b.spin = inertia.inverse() * momentum;
  return b;
}

// A force along the axis moves a rigid piece as weights m_i (1 + g . rho_i) do, whose mean place is on the axis.
StonePieces::Spread StonePieces::spread(const SmoothStone &s, int piece, const Motion &motion, const Vec &axis) const {
  Spread all{{}, 1 / motion.mass};
  const Vec aside = cross(axis, std::fabs(axis.x) < 0.5 ? Vec(1, 0, 0) : Vec(0, 1, 0));
  const Vec e1 = (1 / norm(aside)) * aside, e2 = cross(axis, e1);
  double u = 0, v = 0, uu = 0, uv = 0, vv = 0;
  for (int tag = s.first_tag; tag < s.first_tag + s.count; tag++) {
    if (piece_[tag] != piece) continue;
    const Vec off = position(tag) - motion.center;
    const double m = surfaces_.mass(tag) / motion.mass, a = dot(off, e1), b = dot(off, e2);
    u += m * a, v += m * b, uu += m * a * a, uv += m * a * b, vv += m * b * b;
    all.weights.push_back({tag, m});
  }
  const double det = uu * vv - uv * uv, d = det - vv * u * u + 2 * uv * u * v - uu * v * v;
  if (!(d > 1e-6 * uu * vv)) return all;
  const double g = -(vv * u - uv * v) / det, h = -(uu * v - uv * u) / det;
  for (StoneSurfaces::Weight &m : all.weights) {
    const Vec off = position(m.tag) - motion.center;
    m.weight *= (1 + g * dot(off, e1) + h * dot(off, e2)) * det / d;
  }
  all.mobility = det / d / motion.mass;
  return all;
}

}  // namespace LAMMPS_NS
