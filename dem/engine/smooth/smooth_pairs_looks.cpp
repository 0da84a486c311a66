// The looks of fix smooth_pairs: which stones meet with patches, who leaves these, and what touches alone from then on.
#include <mpi.h>

#include <algorithm>
#include <cmath>

#include "atom.h"
#include "comm.h"
#include "base/pair_list.h"
#include "laws/plastic_law.h"
#include "smooth/fix_smooth_pairs.h"
#include "update.h"

using namespace LAMMPS_NS;

namespace {
const int LOOK_STEPS = 32;
const double LEAST_SHARE = 0.5;     // of a patch's surface that must belong to the piece
const double OUT_OF_PLACE = 0.1;    // of its radius: further off, one that lost half its bonds leaves the patch
const double FIRST_AXIS_rad = 0.1;  // about the lowest point at the start, whose own compliance is known
const double HEADROOM = 1e-3;       // of the radius: a pair is found before it comes so near

double ahead_s(double dt) { return 2 * LOOK_STEPS * dt; }
}  // namespace

// Often enough, and at once when a bond under a patch broke or a body came back from free flight.
bool FixSmoothPairs::must_look() const {
  if (!looked_ || update->ntimestep % LOOK_STEPS == 0) return true;
  std::vector<double> broke(watched_.empty() ? 0 : 1, 0);
  for (const int k : watched_) broke[0] += !bonds_->holds(k);
  sum(broke);
  return !broke.empty() && broke[0] > 0;
}

void FixSmoothPairs::look() {
  looked_ = true;
  pieces_->find_pieces();
  const std::vector<std::pair<int, int>> near = who_is_near();
  if (near.empty() && pairs_.empty() && singles_.empty() && taken_.empty()) return;
  std::set<int> stones;
  for (const auto &pieces : near) stones.insert({agglomerate_of(pieces.first), agglomerate_of(pieces.second)});
  for (const auto &pieces : taken_) stones.insert({agglomerate_of(pieces.first), agglomerate_of(pieces.second)});
  for (const Single &s : singles_) stones.insert({agglomerate_of(s.tag[0]), agglomerate_of(s.tag[1])});
  pieces_->look({stones.begin(), stones.end()}, std::vector<char>(piece_then_.size(), 0));

  measure();
  for (Pair &p : pairs_) {
    p.n.sliding_before = p.n.sliding;
    if (p.n.presses != 0 && p.n.q > 0) press_to_q(p);
  }
  for (Single &s : singles_) press(s);
  const std::map<int, Vec> before = elastic_forces();
  for (Pair &p : pairs_)
    if (p.n.presses != 0) renew(p);
  auto is_over = [](const Pair &p) { return p.n.presses == 0 || p.side[0].members.empty(); };
  pairs_.erase(std::remove_if(pairs_.begin(), pairs_.end(), is_over), pairs_.end());
  for (const auto &[i, j] : near) find_pair(i, j);
  note_pairs();
  watch();
  measure();
  release_half_a_step(before);
}

// Pairs of pieces of different stones whose surfaces may touch before the next look.
std::vector<std::pair<int, int>> FixSmoothPairs::who_is_near() const {
  std::vector<int> roots;
  agglomerates_->each_near_tag([&](int tag) {
    if (pieces_->piece_of(tag) == tag && pieces_->may_have_patch(tag)) roots.push_back(tag);
  });
  static std::vector<int> slot;
  slot.resize(piece_then_.size(), -1);
  for (size_t k = 0; k < roots.size(); k++) slot[roots[k]] = k;
  const double NOWHERE = -1e30;
  std::vector<double> box(6 * roots.size(), NOWHERE);  // highest, and against each axis highest
  for (int i = 0; i < atom->nlocal; i++) {
    const int k = slot[pieces_->piece_of(atom->tag[i])];
    if (k < 0) continue;
    const Vec v(atom->v[i]);
    const double around = atom->radius[i] + surfaces_->outside() + ahead_s(update->dt) * norm(v);
    for (int d = 0; d < 3; d++) {
      box[6 * k + d] = std::max(box[6 * k + d], atom->x[i][d] + around);
      box[6 * k + 3 + d] = std::max(box[6 * k + 3 + d], around - atom->x[i][d]);
    }
  }
  for (const int root : roots) slot[root] = -1;
  if (comm->nprocs > 1 && !box.empty()) {
    const std::vector<double> mine = box;
    MPI_Allreduce(mine.data(), box.data(), box.size(), MPI_DOUBLE, MPI_MAX, world);
  }
  auto overlap = [&](size_t k, size_t m) {
    for (int d = 0; d < 3; d++)
      if (box[6 * k + d] + box[6 * m + 3 + d] < 0 || box[6 * m + d] + box[6 * k + 3 + d] < 0) return false;
    return true;
  };
  std::vector<std::pair<int, int>> near;
  for (size_t k = 0; k < roots.size(); k++)
    for (size_t m = 0; m < k; m++)
      if (agglomerate_of(roots[k]) != agglomerate_of(roots[m]) && overlap(k, m)) near.emplace_back(roots[m], roots[k]);
  return near;
}

// Of the sub-spheres in all ranks, along the lines of centres.
std::map<int, Vec> FixSmoothPairs::elastic_forces() const {
  std::map<int, Vec> force;
  for (const Pair &p : pairs_)
    if (p.n.presses != 0 && p.n.q > 0)
      for (int k = 0; k < 2; k++)
        for (const Weight &m : p.side[k].members)
          force[m.tag] += ((k == 0 ? -1 : 1) * m.weight * p.share() * p.n.state.force) * p.n.line;
  for (const Single &s : singles_)
    for (int k = 0; k < 2; k++) force[static_cast<int>(s.tag[k])] += ((k == 0 ? -1 : 1) * s.elastic) * s.normal;
  return force;
}

// A pressing pair: who has left it, and weights about the present line of the centres.
void FixSmoothPairs::renew(Pair &p) {
  if (p.n.q <= 0) return;
  StonePieces::Motion motion[2];
  for (int k = 0; k < 2; k++) {
    Side &s = p.side[k];
    std::map<int, double> weight_of;
    for (const Weight &m : s.members) weight_of[pieces_->piece_of(m.tag)] += m.weight;
    s.n.piece = std::max_element(weight_of.begin(), weight_of.end(), [](const auto &a, const auto &b) {
                  return a.second < b.second;
                })->first;
    motion[k] = pieces_->motion(stone(s), static_cast<int>(s.n.piece));
  }
  for (int k = 0; k < 2; k++)
    if (!leave_members(p, k, motion[k])) return dissolve(p);
  if (!place(p, motion[0], motion[1], false)) dissolve(p);
}

// Who has come off. False where nothing of the patch is left.
bool FixSmoothPairs::leave_members(Pair &p, int side, const StonePieces::Motion &motion) {
  Side &s = p.side[side];
  for (size_t k = s.members.size(); k-- > 0 && s.members.size() > 1;) {
    const int tag = s.members[k].tag;
    if (!pieces_->is_loose(tag) && pieces_->piece_of(tag) == static_cast<int>(s.n.piece)) continue;
    const Vec off = pieces_->position(tag) - motion.turned(surfaces_->place(tag)) - motion.center;
    if (pieces_->is_free(tag) || norm(off) > OUT_OF_PLACE * surfaces_->radius(tag)) leave(p, side, k);
  }
  return s.n.share > 0;
}

// Both patches about the line of the centres as it is now. A pair that presses keeps q and its members; what its patches
// have lost is released. False where a patch is too small.
bool FixSmoothPairs::place(Pair &p, const StonePieces::Motion &first, const StonePieces::Motion &second, bool anew) {
  const Vec apart = second.center - first.center, line = (1 / norm(apart)) * apart;
  // As on the plate, half way until the next look the patches are about the line.
  const double half = 0.5 * LOOK_STEPS * update->dt;
  const Vec passing = second.velocity - first.velocity;
  const Vec line_then = line + (half / norm(apart)) * (passing - dot(passing, line) * line);
  double reach = 0;
  Vec center[2];
  for (int k = 0; k < 2; k++) {
    Side &s = p.side[k];
    const StonePieces::Motion &motion = k == 0 ? first : second;
    const Vec axis = motion.in_stone((k == 0 ? 1 : -1) * line_then, half);
    std::set<int> before;
    for (const Weight &m : s.members) before.insert(m.tag);
    double share = 0;
    std::vector<Weight> members = surfaces_->weights(stone(s), axis, [&](int tag) {
      return before.count(tag) || (pieces_->piece_of(tag) == static_cast<int>(s.n.piece) && !pieces_->is_loose(tag));
    }, share);
    if (members.empty()) return false;
    if (anew) {
      const bool is_first = -axis.z > std::cos(FIRST_AXIS_rad);
      s.n.compliance = is_first ? stone(s).compliance_first : stone(s).compliance;
      s.n.compliance_across = is_first ? stone(s).across_first : stone(s).across;
      s.n.share = share;
    } else if (share < s.n.share) {
      count(books_.released, p.agglomerate(0), p.agglomerate(1),
            (s.n.share - share) * p.side[1 - k].n.share * p.n.state.stored);
      s.n.share = share;
    }
    if (s.n.share < LEAST_SHARE) return false;
    s.members = std::move(members);
    s.n.base = Vec();
    for (const Weight &m : s.members) {
      s.n.base += m.weight * motion.turned(surfaces_->place(m.tag));
      center[k] += m.weight * pieces_->position(m.tag);
    }
    center[k] = center[k] - s.n.base;
    const StonePieces::Spread all = pieces_->spread(stone(s), static_cast<int>(s.n.piece), motion, line);
    s.body = all.weights;
    s.n.mass = motion.mass, s.n.body_mobility = all.mobility;
    reach += stone(s).radius;
  }
  const double q = reach - norm(center[1] - center[0]);
  if (anew) p.n.q = q, p.n.point = first.center + stone(p.side[0]).radius * line;
  else p.n.off = p.n.q - q;
  return true;
}

// A member leaves a pressing patch with its share of the force, and pushes on with the nearest one opposite.
void FixSmoothPairs::leave(Pair &p, int side, size_t member) {
  Side &s = p.side[side];
  const std::vector<Weight> &opposite = p.side[1 - side].members;
  const Weight m = s.members[member];
  const double share = p.share() * m.weight;
  auto gap = [&](const Weight &o) {
    return norm(pieces_->position(o.tag) - pieces_->position(m.tag)) - surfaces_->radius(o.tag);
  };
  const auto nearest = std::min_element(opposite.begin(), opposite.end(), [&](const Weight &a, const Weight &b) {
    return gap(a) < gap(b);
  });
  if (nearest == opposite.end())
    count(books_.released, p.agglomerate(0), p.agglomerate(1), share * p.n.state.stored);
  else begin_single(m.tag, nearest->tag, share * p.n.state.force, share * p.n.state.stored);
  s.members.erase(s.members.begin() + member);
  double rest = 0;
  for (const Weight &other : s.members) rest += other.weight;
  s.n.share *= rest > 0 ? rest / (rest + m.weight) : 0;
  if (rest > 0)
    for (Weight &other : s.members) other.weight /= rest;
}

void FixSmoothPairs::dissolve(Pair &p) {
  release_spring(p);
  while (!p.side[0].members.empty()) leave(p, 0, p.side[0].members.size() - 1);
}

void FixSmoothPairs::release_spring(Pair &p) {
  count(books_.released, p.agglomerate(0), p.agglomerate(1),
        0.5 * p.n.spring * dot(p.n.slip, p.n.slip + update->dt * p.n.sliding_before));
  p.n.spring = 0;
}

// Of two sub-spheres, with `force` as far as the `available` energy bears it; the rest is released.
void FixSmoothPairs::begin_single(int tag_i, int tag_j, double force, double available) {
  const int a = agglomerate_of(tag_i), b = agglomerate_of(tag_j);
  const double ri = surfaces_->radius(tag_i), rj = surfaces_->radius(tag_j), radius = ri * rj / (ri + rj);
  const double modulus = hertz_->modulus(type_[a], type_[b]);
  const double overlap = ri + rj - norm(pieces_->position(tag_i) - pieces_->position(tag_j));
  double depth = 0, energy = 0;
  if (has_single(tag_i, tag_j)) return count(books_.released, a, b, available);
  if (force > 0 && available > 0 && overlap > -surfaces_->outside()) {
    depth = PlasticLaw::hertz_overlap(modulus, radius, force);
    energy = 0.4 * force * depth;
    if (energy > available) {
      energy = available;
      depth = std::pow(available / (8. / 15. * modulus * std::sqrt(radius)), 0.4);
    }
  }
  count(books_.released, a, b, available - energy);
  if (depth == 0 && overlap <= 0) return;
  Single s;
  s.tag[0] = tag_i, s.tag[1] = tag_j;
  s.offset = overlap - depth;
  singles_.push_back(s);
  list_is_new_ = true;
}

bool FixSmoothPairs::has_single(int tag_i, int tag_j) const {
  return std::any_of(singles_.begin(), singles_.end(), [&](const Single &s) {
    return std::minmax(s.tag[0], s.tag[1]) == std::minmax<double>(tag_i, tag_j);
  });
}

// Two pieces that come near with their smooth surfaces, and do not touch yet.
void FixSmoothPairs::find_pair(int piece_i, int piece_j) {
  const std::pair<int, int> pieces = std::minmax(piece_i, piece_j);
  if (std::any_of(pairs_.begin(), pairs_.end(), [&](const Pair &p) { return p.pieces() == pieces; })) return;
  Pair p;
  StonePieces::Motion motion[2];
  for (int k = 0; k < 2; k++) {
    Side &s = p.side[k];
    s.n.piece = k == 0 ? pieces.first : pieces.second;
    s.n.agglomerate = agglomerate_of(s.n.piece);
    motion[k] = pieces_->motion(stone(s), static_cast<int>(s.n.piece));
    if (!motion[k].is_here) return;
  }
  const double r0 = stone(p.side[0]).radius, r1 = stone(p.side[1]).radius;
  const double speed = norm(motion[1].velocity - motion[0].velocity);
  const double lowest = -ahead_s(update->dt) * speed - HEADROOM * std::min(r0, r1);  // q at the next look
  const double q = r0 + r1 - norm(motion[1].center - motion[0].center);
  if (std::fabs(q - 0.5 * lowest) > 0.5 * std::fabs(lowest) + StonePieces::DEFORMED * (r0 + r1)) return;
  if (!place(p, motion[0], motion[1], true) || p.n.q < lowest || touch_alone(pieces)) return;
  pairs_.push_back(p);
}

// Sub-spheres that touch already keep their contact until they are free.
bool FixSmoothPairs::touch_alone(const std::pair<int, int> &pieces) const {
  std::vector<double> touch(1, 0);
  const auto are_these = [&](int tag_i, int tag_j) {
    return std::pair<int, int>(std::minmax(pieces_->piece_of(tag_i), pieces_->piece_of(tag_j))) == pieces;
  };
  const NeighList *list = force->pair->list;
  for (int k = 0; k < list->inum; k++) {
    const int i = list->ilist[k];
    for (int m = 0; m < list->numneigh[i]; m++) {
      const int j = list->firstneigh[i][m] & NEIGHMASK;
      if (!are_these(atom->tag[i], atom->tag[j])) continue;
      touch[0] += norm(Vec(atom->x[i]) - Vec(atom->x[j])) < atom->radius[i] + atom->radius[j];
    }
  }
  sum(touch);
  for (const Single &s : singles_) touch[0] += are_these(static_cast<int>(s.tag[0]), static_cast<int>(s.tag[1]));
  return touch[0] > 0;
}

// What is taken out of the list of neighbours, and what must be in it again.
void FixSmoothPairs::note_pairs() {
  std::set<std::pair<int, int>> now;
  for (const Pair &p : pairs_) now.insert(std::minmax(p.pieces().first, p.pieces().second));
  free_what_is_taken_no_more(now);
  const size_t singles = singles_.size();
  singles_.erase(std::remove_if(singles_.begin(), singles_.end(), [](const Single &s) {
                   return s.distance > 0 && s.elastic == 0 && s.overlap <= 0;
                 }), singles_.end());
  if (singles_.size() < singles) next_reneighbor = update->ntimestep + 1;
  list_is_new_ = list_is_new_ || now != taken_;
  taken_ = now;
  std::fill(is_paired_.begin(), is_paired_.end(), 0);
  for (const Pair &p : pairs_) is_paired_[p.agglomerate(0)] = is_paired_[p.agglomerate(1)] = 1;
  for (const Single &s : singles_) is_paired_[agglomerate_of(s.tag[0])] = is_paired_[agglomerate_of(s.tag[1])] = 1;
  agglomerates_->each_near_tag([&](int tag) {
    if (is_paired_[agglomerates_->of_tag(tag)]) piece_then_[tag] = pieces_->piece_of(tag);
  });
}

// Pairs of sub-spheres that overlap as their pieces come apart, or lose a patch, begin without force.
void FixSmoothPairs::free_what_is_taken_no_more(const std::set<std::pair<int, int>> &now) {
  std::set<std::pair<int, int>> stones;
  for (const auto &[i, j] : taken_) stones.insert({agglomerate_of(i), agglomerate_of(j)});
  auto pair_of = [](int i, int j) { return std::pair<int, int>(std::minmax(i, j)); };
  for (const auto &[a, b] : stones) {
    auto came_apart = [&](int agglomerate) {
      for (int k = 0; k < agglomerates_->size(agglomerate); k++) {
        const int tag = agglomerates_->first_tag(agglomerate) + k;
        if (piece_then_[tag] != pieces_->piece_of(tag)) return true;
      }
      return false;
    };
    const bool none_ends = std::all_of(taken_.begin(), taken_.end(), [&](const auto &pieces) {
      return agglomerate_of(pieces.first) != a || agglomerate_of(pieces.second) != b || now.count(pieces);
    });
    if (none_ends && !came_apart(a) && !came_apart(b)) continue;
    next_reneighbor = update->ntimestep + 1;
    for (int i = agglomerates_->first_tag(a); i < agglomerates_->first_tag(a) + agglomerates_->size(a); i++)
      for (int j = agglomerates_->first_tag(b); j < agglomerates_->first_tag(b) + agglomerates_->size(b); j++) {
        const Vec apart = pieces_->position(j) - pieces_->position(i);
        const double reach = surfaces_->radius(i) + surfaces_->radius(j);
        if (dot(apart, apart) >= reach * reach || !pieces_->is_here(i) || !pieces_->is_here(j)) continue;
        if (!taken_.count(pair_of(piece_then_[i], piece_then_[j]))) continue;
        if (now.count(pair_of(pieces_->piece_of(i), pieces_->piece_of(j))) || has_single(i, j)) continue;
        begin_single(i, j, 0, 0);
      }
  }
}

// The list is the same on all ranks.
void FixSmoothPairs::watch() {
  watched_.clear();
  for (const Pair &p : pairs_)
    for (const Side &s : p.side)
      for (const Weight &m : s.members)
        for (const int k : pieces_->bonds_of(m.tag))
          if (p.n.presses != 0 && bonds_->holds(k)) watched_.push_back(k);
}

// The integrator does half a step's work with the force before a look, and half with the one after it. So what a
// transition at the look releases is the difference of the energies half a step ago.
void FixSmoothPairs::release_half_a_step(const std::map<int, Vec> &before) {
  const double half_dt = 0.5 * update->dt;
  for (Pair &p : pairs_)
    if (p.n.presses != 0 && p.n.q > 0) {
      press_to_q(p);
      count(books_.released, p.agglomerate(0), p.agglomerate(1),
            half_dt * p.n.spring * dot(p.n.slip, p.n.sliding_before - p.n.sliding));
    }
  for (Single &s : singles_) press(s);
  std::map<int, Vec> gained = elastic_forces();
  for (const auto &[tag, f] : before) gained[tag] += -1 * f;
  for (const auto &[tag, f] : gained)
    if (const int i = here(tag); i >= 0) books_.released[agglomerate_of(tag)] -= half_dt * dot(f, Vec(atom->v[i]));
}
