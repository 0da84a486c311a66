#include "smooth/fix_smooth_pairs.h"

#include <mpi.h>

#include <algorithm>
#include <cmath>

#include "atom.h"
#include "base/fix_input.h"
#include "base/fixes.h"
#include "bodies/flat_row.h"
#include "comm.h"
#include "base/pair_list.h"
#include "interfaces/checkpoint_file.h"
#include "laws/tangential_law.h"
#include "modify.h"
#include "update.h"

using namespace LAMMPS_NS;
using namespace FixConst;

FixSmoothPairs::FixSmoothPairs(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg) {
  std::string agglomerates, surface;
  FixInput input(lmp, this);
  input.text("agglomerates", agglomerates)
      .text("surface", surface)
      .words("pair", 8, [&](char **words, int) {
        double n[6];
        for (int k = 0; k < 6; k++) n[k] = input.number("pair", words[k + 2], k < 2 ? Allowed::ABOVE_0 : Allowed::FROM_0);
        laws_[std::minmax(input.whole("pair", words[0], 1), input.whole("pair", words[1], 1))] = {n[0], n[1], n[2],
                                                                                                 n[3], n[4], n[5]};
      })
      .read(arg, 3, narg, {"agglomerates", "surface", "pair"});
  agglomerates_ = std::make_unique<Agglomerates>(lmp, this, agglomerates);
  surfaces_ = std::make_unique<StoneSurfaces>(lmp, surface, *agglomerates_);
  books_.work.assign(agglomerates_->count(), 0);
  books_.damped = books_.released = books_.plastic = books_.friction = books_.work;
  piece_then_.assign(agglomerates_->tags() + 1, 0);
  is_paired_.assign(agglomerates_->count(), 0);
  std::vector<int> mine(agglomerates_->count(), 0);
  for (int i = 0; i < atom->nlocal; i++) mine[agglomerates_->of_tag(atom->tag[i])] = atom->type[i];
  type_ = mine;
  MPI_Allreduce(mine.data(), type_.data(), mine.size(), MPI_INT, MPI_MAX, world);
  force_reneighbor = 1;
  next_reneighbor = -1;
}

int FixSmoothPairs::setmask() { return POST_INTEGRATE | PRE_NEIGHBOR | PRE_FORCE | POST_FORCE; }

void FixSmoothPairs::init() {
  const FixInput input(lmp, this);
  agglomerates_->init();
  bonds_ = fix_that_is<BondNetwork>(modify);
  if (!bonds_) input.refuse("needs fix bond/parallel");
  for (int a = 0; a < agglomerates_->count(); a++)
    for (int b = 0; b < a; b++)
      if (type_[a] > 0 && type_[b] > 0 && !laws_.count(std::minmax(type_[a], type_[b])))
        input.refuse("needs a pair of the types " + std::to_string(type_[b]) + " and " + std::to_string(type_[a]));
  list_is_new_ = true;
}

// The step that ends here was counted by the run before, or never was.
void FixSmoothPairs::setup(int vflag) {
  hertz_ = std::make_unique<HertzLaw>(lmp);
  if (!pieces_) pieces_ = std::make_unique<StonePieces>(lmp, *agglomerates_, *surfaces_, *bonds_);
  next_reneighbor = -1;
  if (resuming) return;
  const Books counted = books_;
  post_force(vflag);
  books_ = counted;
}

void FixSmoothPairs::enter(const EnteringStone &stone) {
  surfaces_->enter(stone);
  type_[stone.agglomerate] = static_cast<int>(stone.atoms[0]);
  if (pieces_) pieces_->enter(stone);
}

bool FixSmoothPairs::pushes(int label) const {
  if (!pieces_) return false;
  return std::any_of(pairs_.begin(), pairs_.end(), [&](const Pair &p) {
    const auto of_it = [&](const Side &s) { return s.n.piece == pieces_->piece_of(label); };
    return p.n.presses != 0 && (of_it(p.side[0]) || of_it(p.side[1]));
  });
}

void FixSmoothPairs::leave(int agglomerate) {
  if (pieces_) pieces_->leave(agglomerate);
}

int FixSmoothPairs::here(int tag) const {
  const int i = atom->map(tag);
  return i >= 0 && i < atom->nlocal ? i : -1;
}

void FixSmoothPairs::sum(std::vector<double> &values) const {
  if (comm->nprocs == 1 || values.empty()) return;
  const std::vector<double> mine = values;
  MPI_Allreduce(mine.data(), values.data(), values.size(), MPI_DOUBLE, MPI_SUM, world);
}

bool FixSmoothPairs::is_first_rank() const { return comm->me == 0; }

// Half of it for each of the two, by the first rank, as all know of it.
void FixSmoothPairs::count(std::vector<double> &book, int a, int b, double energy) const {
  if (is_first_rank()) book[a] += 0.5 * energy, book[b] += 0.5 * energy;
}

SmoothLaw FixSmoothPairs::smooth_law(const Pair &p) const {
  const Law &l = law(p.agglomerate(0), p.agglomerate(1));
  const double r0 = stone(p.side[0]).radius, r1 = stone(p.side[1]).radius;
  return {l.modulus, r0 * r1 / (r0 + r1), l.yield_pressure};
}

// Pairs of sub-spheres that this fix knows about.
void FixSmoothPairs::take_pairs() {
  if (!list_is_new_) return;
  list_is_new_ = false;
  if (taken_.empty() && singles_.empty()) return;
  std::set<std::pair<int, int>> single;
  for (const Single &s : singles_) single.insert(std::minmax(static_cast<int>(s.tag[0]), static_cast<int>(s.tag[1])));
  keep_in_pair_list(lmp, [&](int i, int j) {
    const int ti = atom->tag[i], tj = atom->tag[j];
    if (!is_paired_[agglomerates_->of_tag(ti)] || !is_paired_[agglomerates_->of_tag(tj)]) return true;
    return !taken_.count(std::minmax(piece_then_[ti], piece_then_[tj])) && !single.count(std::minmax(ti, tj));
  });
}

/* --- the step ---------------------------------------------------------------------------------------------- */

void FixSmoothPairs::post_force(int) {
  drop_what_flies();
  if (must_look()) look();
  measure();
  for (Pair &p : pairs_) press(p);
  for (Pair &p : pairs_)
    if (p.n.elastic > 0) dampen(p), rub(p);
  for (Single &s : singles_) press(s);
  hand_out();
  add_half();
}

// What is in free flight touches nothing, or has left for good together with what it touches.
void FixSmoothPairs::drop_what_flies() {
  if (comm->nprocs > 1) return;
  auto flies = [&](const Pair &p) {
    for (const Side &s : p.side)
      if (std::any_of(s.members.begin(), s.members.end(), [&](const Weight &m) { return here(m.tag) < 0; })) return true;
    return false;
  };
  for (Pair &p : pairs_)
    if (flies(p) && p.n.presses != 0) {
      const double held = p.share() * p.n.state.stored + 0.5 * p.n.spring * dot(p.n.slip, p.n.slip);
      count(books_.released, p.agglomerate(0), p.agglomerate(1), held);
    }
  pairs_.erase(std::remove_if(pairs_.begin(), pairs_.end(), flies), pairs_.end());
  auto is_off = [&](const Single &s) { return here(static_cast<int>(s.tag[0])) < 0 || here(static_cast<int>(s.tag[1])) < 0; };
  for (const Single &s : singles_)
    if (is_off(s)) count(books_.released, agglomerate_of(s.tag[0]), agglomerate_of(s.tag[1]), stored(s));
  singles_.erase(std::remove_if(singles_.begin(), singles_.end(), is_off), singles_.end());
}

// Means over the members of all ranks.
void FixSmoothPairs::measure() {
  const size_t SIDE = 16, SINGLE = 18;
  std::vector<double> sums(2 * SIDE * pairs_.size() + SINGLE * singles_.size(), 0);
  double *at = sums.data();
  auto add = [&at](double w, const Vec &a) { at[0] += w * a.x, at[1] += w * a.y, at[2] += w * a.z, at += 3; };
  for (const Pair &p : pairs_)
    for (const Side &s : p.side) {
      double *const row = at;
      for (const Weight &m : s.members) {
        const int i = here(m.tag);
        if (i < 0) continue;
        const Vec x(atom->x[i]), spin(atom->omega[i]);
        at = row;
        add(m.weight, x), add(m.weight, Vec(atom->v[i])), add(m.weight, spin), add(m.weight, cross(spin, x));
        const Vec arm = p.n.point - x;
        row[15] += m.weight * m.weight / atom->rmass[i] * (1 + 2.5 * dot(arm, arm) / (atom->radius[i] * atom->radius[i]));
      }
      for (const Weight &m : s.body)
        if (const int i = here(m.tag); i >= 0) at = row + 12, add(m.weight, Vec(atom->v[i]));
      at = row + SIDE;
    }
  for (const Single &s : singles_)
    for (const double tag : s.tag) {
      const int i = here(static_cast<int>(tag));
      if (i < 0) at += 9;
      else add(1, Vec(atom->x[i])), add(1, Vec(atom->v[i])), add(1, Vec(atom->omega[i]));
    }
  sum(sums);
  at = sums.data();
  auto take = [&at]() { return at += 3, Vec(at - 3); };
  for (Pair &p : pairs_) {
    for (Side &s : p.side) {
      s.n.x = take(), s.n.v = take(), s.n.spin = take(), s.n.spin_x = take(), s.n.body_v = take();
      s.n.mobility = *at++;
    }
    const Vec apart = p.side[1].center() - p.side[0].center();
    const double distance = norm(apart), r0 = stone(p.side[0]).radius, r1 = stone(p.side[1]).radius;
    p.n.line = (1 / distance) * apart;
    p.n.q = r0 + r1 + p.n.off - distance;
    p.n.q_rate = dot(p.side[0].n.v - p.side[1].n.v, p.n.line);
    p.n.point = p.side[0].center() + (0.5 * (distance + r0 - r1)) * p.n.line;
    const Vec sliding = p.side[0].velocity_at(p.n.point) - p.side[1].velocity_at(p.n.point);
    p.n.sliding = sliding - dot(sliding, p.n.line) * p.n.line;
  }
  for (Single &s : singles_)
    for (int k = 0; k < 2; k++) s.x[k] = take(), s.v[k] = take(), s.spin[k] = take();
}

void FixSmoothPairs::press(Pair &p) {
  auto &n = p.n;
  if (n.is_new != 0 && n.q > 2 * std::fabs(n.q_rate) * update->dt) n.off -= n.q, n.q = 0;  // no force from nothing
  n.is_new = 0;
  n.elastic = n.dashpot = n.rubbing = 0, n.across = Vec();
  n.state = SmoothLaw::State();
  n.presses = n.q > 0;
  if (n.q > 0) press_to_q(p);
  else n.largest = 0;
  n.elastic = p.share() * n.state.force;
  if (n.elastic <= 0) stretch(p, 0, Vec(), Vec());
}

void FixSmoothPairs::press_to_q(Pair &p) {
  const SmoothLaw law = smooth_law(p);
  const double before = p.n.largest;
  p.n.state = law.at(p.n.q, p.side[0].n.compliance + p.side[1].n.compliance, p.n.largest);
  count(books_.plastic, p.agglomerate(0), p.agglomerate(1), p.share() * (law.taken(p.n.largest) - law.taken(before)));
}

// Hertz' dashpot between the two pieces. It never pulls more than the patches push.
void FixSmoothPairs::dampen(Pair &p) {
  const double m0 = p.side[0].n.mass, m1 = p.side[1].n.mass, ratio = law(p.agglomerate(0), p.agglomerate(1)).damping_ratio;
  if (ratio == 0) return;
  const double c = 2 * std::sqrt(5. / 6.) * ratio * std::sqrt(p.share() * p.n.state.stiffness * m0 * m1 / (m0 + m1));
  const double most = 1 / ((p.side[0].n.body_mobility + p.side[1].n.body_mobility) * update->dt);
  const double closing = dot(p.side[0].n.body_v - p.side[1].n.body_v, p.n.line);
  p.n.dashpot = std::max(-p.n.elastic, std::min(c, most) * closing);
}

// As with the plate (SmoothContact::rub). The spring turns with the line of the centres.
void FixSmoothPairs::rub(Pair &p) {
  const Law &l = law(p.agglomerate(0), p.agglomerate(1));
  if (l.friction == 0) return;
  const double m0 = p.side[0].n.mass, m1 = p.side[1].n.mass;
  const double mindlin = mindlin_stiffness(l.shear_modulus, l.modulus, p.n.state.stiffness);
  const double stops = 1 / ((p.side[0].n.mobility + p.side[1].n.mobility) * update->dt);
  const double spring = spring_before_bonds(p.share(), mindlin, p.side[0].n.compliance_across + p.side[1].n.compliance_across,
                                            stops / update->dt);
  const Vec kept = kept_stretch(p.n.spring, p.n.slip, spring), turned = kept + update->dt * p.n.sliding;
  const Vec tried = turned - dot(turned, p.n.line) * p.n.line;
  const double sticks = share_that_sticks(spring * norm(tried), l.friction, p.n.elastic + p.n.dashpot);
  stretch(p, spring, sticks * tried, tried - kept);
  if (sticks == 1) {
    const double dashpot = p.share() * 2 * std::sqrt(5. / 6.) * l.damping_ratio_across * std::sqrt(mindlin * m0 * m1 / (m0 + m1));
    p.n.rubbing = std::min(dashpot, stops);
  }
  p.n.across = -spring * p.n.slip - p.n.rubbing * p.n.sliding;
}

void FixSmoothPairs::stretch(Pair &p, double spring, const Vec &slip, const Vec &moved) {
  const Vec way = spring > 0 ? moved : update->dt * p.n.sliding;
  const TangentialStep step = tangential_step(p.n.spring, p.n.slip, spring, slip, way);
  count(books_.friction, p.agglomerate(0), p.agglomerate(1), step.friction - step.gained);
  p.n.spring = spring, p.n.slip = slip;
}

// Hertz' contact of two sub-spheres with its dashpot. The offset goes down as they part. Friction is Coulomb's, without a
// spring: no more than half of what stops the two in one step.
void FixSmoothPairs::press(Single &s) {
  const int tag[2] = {static_cast<int>(s.tag[0]), static_cast<int>(s.tag[1])};
  const int types[2] = {type_[agglomerates_->of_tag(tag[0])], type_[agglomerates_->of_tag(tag[1])]};
  const double r0 = surfaces_->radius(tag[0]), r1 = surfaces_->radius(tag[1]), radius = r0 * r1 / (r0 + r1);
  const double m0 = surfaces_->mass(tag[0]), m1 = surfaces_->mass(tag[1]);
  const Vec apart = s.x[1] - s.x[0];
  s.distance = norm(apart);
  s.normal = (1 / s.distance) * apart;
  s.overlap = r0 + r1 - s.distance;
  if (s.offset > 0) s.offset = std::max(0.0, std::min(s.offset, s.overlap));
  const double depth = s.overlap - s.offset;
  s.elastic = s.dashpot = 0, s.across = Vec();
  if (depth <= 0) return;
  const double modulus = hertz_->modulus(types[0], types[1]);
  s.elastic = HertzLaw::normal_force(modulus, radius, depth);
  const double c = hertz_->dashpot(types[0], types[1], 2 * modulus * std::sqrt(radius * depth), m0 * m1 / (m0 + m1));
  s.dashpot = c * dot(s.v[0] - s.v[1], s.normal);
  const Vec velocity = s.v[0] + cross(s.spin[0], s.arm(0)) - s.v[1] - cross(s.spin[1], s.arm(1));
  const Vec sliding = velocity - dot(velocity, s.normal) * s.normal;
  const double mu = law(agglomerates_->of_tag(tag[0]), agglomerates_->of_tag(tag[1])).friction;
  const double stops = 0.5 / (3.5 * (1 / m0 + 1 / m1) * update->dt), speed = norm(sliding);
  if (speed > 0) s.across = -std::min(stops, mu * std::max(0.0, s.elastic + s.dashpot) / speed) * sliding;
}

void FixSmoothPairs::feel(int tag, const Vec &force, const Vec &torque) {
  if (here(tag) >= 0) felt_.push_back({tag, force, torque});
}

// What one sub-sphere feels of several contacts becomes one, in the order in which it was felt.
void FixSmoothPairs::add_up_felt() {
  std::stable_sort(felt_.begin(), felt_.end(), [](const Felt &a, const Felt &b) { return a.tag < b.tag; });
  size_t n = 0;
  for (const Felt &felt : felt_)
    if (n > 0 && felt_[n - 1].tag == felt.tag) felt_[n - 1].force += felt.force, felt_[n - 1].torque += felt.torque;
    else felt_[n++] = felt;
  felt_.resize(n);
}

void FixSmoothPairs::hand_out() {
  felt_.clear();
  for (const Pair &p : pairs_) {
    if (p.n.elastic <= 0) continue;
    for (int k = 0; k < 2; k++) {
      const double sign = k == 0 ? -1 : 1;
      for (const Weight &m : p.side[k].members) {
        const int i = here(m.tag);
        if (i < 0) continue;
        const Vec across = -sign * m.weight * p.n.across;
        feel(m.tag, sign * m.weight * p.n.elastic * p.n.line + across, cross(p.n.point - Vec(atom->x[i]), across));
      }
      if (p.n.dashpot != 0)
        for (const Weight &m : p.side[k].body) feel(m.tag, sign * m.weight * p.n.dashpot * p.n.line, Vec());
    }
  }
  for (const Single &s : singles_)
    for (int k = 0; k < 2; k++)
      if (const double sign = k == 0 ? -1 : 1; s.elastic > 0)
        feel(static_cast<int>(s.tag[k]), sign * ((s.elastic + s.dashpot) * s.normal - s.across),
             cross(s.arm(k), -sign * s.across));
  add_up_felt();
  for (const Felt &felt : felt_) {
    const int i = here(felt.tag);
    (Vec(atom->f[i]) + felt.force).to(atom->f[i]);
    (Vec(atom->torque[i]) + felt.torque).to(atom->torque[i]);
  }
}

// The integrator does half a step's work with the velocities at which the force is found, and half with the next ones:
// all works here, and what of them the dashpots take, of the sub-spheres of this rank.
void FixSmoothPairs::add_half() {
  const double half_dt = 0.5 * update->dt;
  auto velocity = [&](const std::vector<Weight> &weights) {
    Vec v;
    for (const Weight &m : weights)
      if (const int i = here(m.tag); i >= 0) v += m.weight * Vec(atom->v[i]);
    return v;
  };
  for (const Felt &felt : felt_) {
    const int i = here(felt.tag);
    if (i < 0) continue;
    books_.work[agglomerate_of(felt.tag)] += half_dt * (dot(felt.force, Vec(atom->v[i])) + dot(felt.torque, Vec(atom->omega[i])));
  }
  for (const Pair &p : pairs_)
    for (int k = 0; k < 2; k++) {
      if (p.n.elastic <= 0) continue;
      const double sign = k == 0 ? 1 : -1;
      double power = p.n.dashpot == 0 ? 0 : p.n.dashpot * dot(velocity(p.side[k].body), p.n.line);
      if (p.n.rubbing != 0)
        for (const Weight &m : p.side[k].members)
          if (const int i = here(m.tag); i >= 0) {
            const Vec at_point = Vec(atom->v[i]) + cross(Vec(atom->omega[i]), p.n.point - Vec(atom->x[i]));
            power += p.n.rubbing * m.weight * dot(p.n.sliding, at_point);
          }
      books_.damped[p.agglomerate(k)] += sign * half_dt * power;
    }
  for (const Single &s : singles_)
    for (int k = 0; k < 2; k++)
      if (const int i = here(static_cast<int>(s.tag[k])); i >= 0 && s.elastic > 0) {
        const Vec v(atom->v[i]), at_contact = v + cross(Vec(atom->omega[i]), s.arm(k));
        const double half = (k == 0 ? 1 : -1) * half_dt;
        books_.damped[agglomerate_of(s.tag[k])] += half * s.dashpot * dot(v, s.normal);
        books_.friction[agglomerate_of(s.tag[k])] -= half * dot(s.across, at_contact);
      }
}

/* --- for the ledger ------------------------------------------------------------------------------------------ */

void FixSmoothPairs::add_to(LedgerRows &rows) {
  rows.add(PAIR_WORK, books_.work);
  rows.add(PAIR_DAMPED, books_.damped);
  rows.add(WALL_RELEASED, books_.released);
  rows.add(WALL_PLASTIC, books_.plastic);
  rows.add(FRICTION, books_.friction);
  std::vector<double> elastic(agglomerates_->count(), 0);
  for (const Pair &p : pairs_)
    if (p.n.presses != 0)
      count(elastic, p.agglomerate(0), p.agglomerate(1),
            p.share() * p.n.state.stored + 0.5 * p.n.spring * dot(p.n.slip, p.n.slip));
  for (const Single &s : singles_)
    count(elastic, agglomerate_of(s.tag[0]), agglomerate_of(s.tag[1]), stored(s));
  rows.add(PAIR_ELASTIC, elastic);
}

/* --- checkpoint ---------------------------------------------------------------------------------------------- */

// Pairs and singles are the same on all ranks.
void FixSmoothPairs::save(CheckpointWriter &out) {
  std::vector<double> row, felt, taken, piece;
  for (const Pair &p : pairs_) {
    append_bytes(row, &p.n, 1);
    for (const Side &s : p.side) {
      append_bytes(row, &s.n, 1);
      row.insert(row.end(), {s.members.size() + 0.0, s.body.size() + 0.0});
      for (const auto *weights : {&s.members, &s.body})
        for (const Weight &m : *weights) row.insert(row.end(), {m.tag + 0.0, m.weight});
    }
  }
  append_bytes(row, singles_.data(), singles_.size());
  for (const Felt &f : felt_)
    felt.insert(felt.end(), {f.tag + 0.0, f.force.x, f.force.y, f.force.z, f.torque.x, f.torque.y, f.torque.z});
  for (const auto &[i, j] : taken_) taken.insert(taken.end(), {i + 0.0, j + 0.0});
  agglomerates_->each_near_tag([&](int tag) {
    if (is_paired_[agglomerates_->of_tag(tag)]) piece.insert(piece.end(), {tag + 0.0, piece_then_[tag] + 0.0});
  });
  out.common("pairs_counts", {pairs_.size() + 0.0, singles_.size() + 0.0, row.size() + 0.0, taken.size() + 0.0,
                              piece.size() + 0.0, watched_.size() + 0.0});
  out.common("pairs", row);
  out.common("pairs_taken", taken);
  out.common("pairs_pieces", piece);
  out.common("pairs_watched", std::vector<double>(watched_.begin(), watched_.end()));
  out.rows("pairs_felt", felt);
  out.sum("pairs_work", books_.work);
  out.sum("pairs_damped", books_.damped);
  out.sum("pairs_released", books_.released);
  out.sum("pairs_plastic", books_.plastic);
  out.sum("pairs_friction", books_.friction);
}

void FixSmoothPairs::restore(const CheckpointReader &in) {
  const std::vector<double> counts = in.common("pairs_counts", 6);
  const double *row = in.common("pairs", counts[2]).data();
  pairs_.assign(counts[0], Pair());
  for (Pair &p : pairs_) {
    take_bytes(row, &p.n, 1);
    for (Side &s : p.side) {
      take_bytes(row, &s.n, 1);
      s.members.resize(*row++), s.body.resize(*row++);
      for (auto *weights : {&s.members, &s.body})
        for (Weight &m : *weights) m.tag = *row++, m.weight = *row++;
    }
  }
  singles_.assign(counts[1], Single());
  take_bytes(row, singles_.data(), singles_.size());
  taken_.clear();
  const std::vector<double> &taken = in.common("pairs_taken", counts[3]), &piece = in.common("pairs_pieces", counts[4]);
  for (size_t k = 0; k < taken.size(); k += 2) taken_.insert({static_cast<int>(taken[k]), static_cast<int>(taken[k + 1])});
  std::fill(is_paired_.begin(), is_paired_.end(), 0);
  for (size_t k = 0; k < piece.size(); k += 2) {
    piece_then_[static_cast<int>(piece[k])] = static_cast<int>(piece[k + 1]);
    is_paired_[agglomerate_of(piece[k])] = 1;
  }
  const std::vector<double> &watched = in.common("pairs_watched", counts[5]);
  watched_.assign(watched.begin(), watched.end());
  felt_.clear();
  const std::vector<double> &felt = in.rows("pairs_felt", 7);
  for (size_t k = 0; k < felt.size(); k += 7)
    feel(static_cast<int>(felt[k]), Vec(&felt[k + 1]), Vec(&felt[k + 4]));
  add_up_felt();
  const size_t n = books_.work.size();
  books_ = {in.sum("pairs_work", n), in.sum("pairs_damped", n), in.sum("pairs_released", n), in.sum("pairs_plastic", n),
            in.sum("pairs_friction", n)};
  list_is_new_ = looked_ = true;
}
