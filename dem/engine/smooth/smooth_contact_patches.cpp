// The patches of SmoothContact: where they are found, and who leaves them.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "atom.h"
#include "lammps.h"
#include "smooth/smooth_contact.h"
#include "update.h"

namespace LAMMPS_NS {

namespace {
const int LOOK_STEPS = 32;
const double LEAST_SHARE = 0.5;     // of a patch's surface that must belong to the piece
const double OUT_OF_PLACE = 0.1;    // of its radius: further off, one that lost half its bonds leaves the patch
const double TURN_rad = 1e-4;       // of the axis in the stone: the lever of a push that far beside the middle is nothing
const double FIRST_AXIS_rad = 0.1;  // about the lowest point at the start, whose own compliance is known
const double BEYOND = 0.1;          // of its radius: with an axis further beyond the outline a patch dissolves
const double HEADROOM = 1e-3;       // of the radius: a patch is found before it comes so near
}  // namespace

void SmoothContact::index(const std::vector<NearSphere> &near) {
  for (const int tag : indexed_) near_of_tag_[tag] = -1;
  indexed_.resize(near.size());
  for (size_t k = 0; k < near.size(); k++) {
    indexed_[k] = lmp_->atom->tag[near[k].i];
    near_of_tag_[indexed_[k]] = k;
  }
}

// Often enough, and at once when a bond under a patch broke or a body came back from free flight.
bool SmoothContact::must_look() const {
  if (!looked_ || lmp_->update->ntimestep % LOOK_STEPS == 0) return true;
  std::vector<double> broke(watched_.empty() ? 0 : 1, 0);
  for (const int k : watched_) broke[0] += !bonds_->holds(k);
  sum(broke);
  return !broke.empty() && broke[0] > 0;
}

void SmoothContact::list(std::vector<NearSphere> &near) {
  pieces_->find_pieces();
  index(near);
  mark_feet(near);
  for (NearSphere &p : near) {
    const int tag = lmp_->atom->tag[p.i];
    p.outside = pieces_->may_have_patch(tag) || is_pushed_outside(tag) ? outside() : 0;
  }
}

// In a patch it is pushed wherever it is, and where it left one while it was above the plate that is higher for it.
bool SmoothContact::is_pushed_outside(int tag) const { return patch_of_tag_[tag] >= 0 || moved_[tag].z > 0; }

// Weights that stand still may keep a patch pressing where the surface of today is above the plate.
double SmoothContact::outside(const std::vector<int> &tags) const {
  auto is_pushed = [this](int tag) {
    return moved_[tag].z > 0 || (patch_of_tag_[tag] >= 0 && patches_[patch_of_tag_[tag]].presses);
  };
  return std::any_of(tags.begin(), tags.end(), is_pushed) ? outside() : 0;
}

// The list is the same on all ranks.
void SmoothContact::watch() {
  watched_.clear();
  for (const Patch &p : patches_)
    for (const Weight &m : p.members)
      for (const int k : pieces_->bonds_of(m.tag))
        if (p.presses && bonds_->holds(k)) watched_.push_back(k);
}

void SmoothContact::look(std::vector<NearSphere> &near, double reach) {
  before_look_.clear();
  const std::vector<int> &there = agglomerates_.near();
  std::vector<double> wanted(there.size(), 0);
  auto want = [&](int a) { wanted[std::lower_bound(there.begin(), there.end(), a) - there.begin()] = 1; };
  for (const NearSphere &p : near)
    if (p.outside > 0) want(agglomerates_.of_tag(lmp_->atom->tag[p.i]));
  for (const int tag : alone_now_) touching_[tag] = 1;  // a list of what is near may be new and know nothing
  sum(wanted);
  for (const Patch &p : patches_) want(p.agglomerate);
  std::vector<int> stones;
  for (size_t k = 0; k < there.size(); k++)
    if (wanted[k] > 0) stones.push_back(there[k]);
  if (stones.empty()) return;
  pieces_->look(stones, touching_);
  for (const int tag : alone_now_) touching_[tag] = 0;

  for (Patch &p : patches_)
    if (p.presses) renew(p);
  const std::vector<Patch> before = patches_;
  drop_idle_patches();
  for (const int a : stones) find_patches(a, reach);
  index_patches();
  for (const Patch &p : before)
    for (const Weight &m : p.members)
      if (patch_of_tag_[m.tag] < 0) stand_alone(m.tag);
  watch();
  find_feet(near);
}

// A patch presses on the plate at the mean place of its members, which is on the axis, and not beneath the largest one.
void SmoothContact::find_feet(std::vector<NearSphere> &near) {
  for (Patch &p : patches_) {
    p.to_foot = -1 * pieces_->position(p.central());
    for (const Weight &m : p.members) p.to_foot += m.weight * pieces_->position(m.tag);
  }
  for (NearSphere &n : near) n.stands_for_patch = false, n.to_foot[0] = n.to_foot[1] = 0;
  mark_feet(near);
  for (size_t k = 0; k < near.size(); k++)
    if (near[k].stands_for_patch) beneath_.find_plate(k);
}

void SmoothContact::mark_feet(std::vector<NearSphere> &near) const {
  for (const Patch &p : patches_) {
    const int k = near_of_tag_[p.central()];
    if (k < 0) continue;  // of another rank
    near[k].stands_for_patch = true;
    near[k].to_foot[0] = p.to_foot.x, near[k].to_foot[1] = p.to_foot.y;
  }
}

void SmoothContact::index_patches() {
  for (const int tag : in_patches_) patch_of_tag_[tag] = -1;
  in_patches_.clear();
  for (size_t k = 0; k < patches_.size(); k++)
    for (const Weight &m : patches_[k].members) {
      patch_of_tag_[m.tag] = k;
      in_patches_.push_back(m.tag);
    }
}

// Those that do not press are found anew.
void SmoothContact::drop_idle_patches() {
  patches_.erase(std::remove_if(patches_.begin(), patches_.end(),
                                [](const Patch &p) { return !p.presses || p.members.empty(); }),
                 patches_.end());
}

bool SmoothContact::is_taken(int tag) const {
  if (pieces_->touched_alone(tag)) return true;
  return std::any_of(patches_.begin(), patches_.end(), [&](const Patch &p) {
    return std::any_of(p.members.begin(), p.members.end(), [&](const Weight &m) { return m.tag == tag; });
  });
}

// The members stay until the next look, and move on as the stone turns: half way until then they are about the axis. With
// the axis of now the push would be behind the middle all the time, and turn the stone.
Vec SmoothContact::axis_until_next(const StonePieces::Motion &motion) const {
  return motion.in_stone(Vec(0, 0, -1), 0.5 * LOOK_STEPS * lmp_->update->dt);
}

// Of each piece of a stone that comes near the plate with its smooth surface.
void SmoothContact::find_patches(int agglomerate, double reach) {
  const SmoothStone &s = surfaces_.stones()[agglomerate];
  const double span = 2 * LOOK_STEPS * lmp_->update->dt;
  for (const auto &[piece, motion] : pieces_->motions(s)) {
    if (!motion.is_here || norm(beyond_outline(motion.center)) > 0) continue;
    const double lowest = -span * std::fabs(motion.velocity.z) - HEADROOM * s.radius - reach;  // q at the next look
    if (s.radius - motion.center.z < lowest - StonePieces::DEFORMED * s.radius) continue;
    Patch p;
    p.agglomerate = agglomerate;
    p.piece = piece;
    p.axis = axis_until_next(motion);
    p.mass = motion.mass;
    p.members = surfaces_.weights(s, p.axis, [&, piece = piece](int tag) {
      return pieces_->piece_of(tag) == piece && !pieces_->is_loose(tag);
    }, p.share);
    if (p.members.empty() || p.share < LEAST_SHARE) continue;
    // A sub-sphere that touches already, alone or in another patch, keeps its contact until it is free.
    if (std::any_of(p.members.begin(), p.members.end(), [&](const Weight &m) { return is_taken(m.tag); })) continue;
    p.base = s.radius;
    for (const Weight &m : p.members) p.base += m.weight * motion.turned(surfaces_.place(m.tag)).z;
    if (p.base - height_of_members(p) < lowest) continue;
    if (!is_near(p)) continue;
    const bool first = -p.axis.z > std::cos(FIRST_AXIS_rad);
    p.compliance = first ? s.compliance_first : s.compliance;
    p.compliance_across = first ? s.across_first : s.across;
    spread_over_body(p, motion);
    patches_.push_back(p);
  }
}

// Are all its members in the lists of what is near the plate?
bool SmoothContact::is_near(const Patch &p) const {
  std::vector<double> listed(1, 0);
  for (const Weight &m : p.members) listed[0] += near_of_tag_[m.tag] >= 0;
  sum(listed);
  return listed[0] == static_cast<double>(p.members.size());
}

// As pieces_ found them.
double SmoothContact::height_of_members(const Patch &p) const {
  double z = 0;
  for (const Weight &m : p.members) z += m.weight * pieces_->position(m.tag).z;
  return z;
}

// A pressing patch: who has left it, and weights about the present axis.
void SmoothContact::renew(Patch &p) {
  p.q = p.base - height_of_members(p) + p.w;
  if (p.q <= 0) return;
  press_to_q(p);
  for (const Weight &m : p.members) before_look_.emplace_back(m.tag, p.share * m.weight * p.state.force);
  std::map<int, double> weight_of;
  for (const Weight &m : p.members) weight_of[pieces_->piece_of(m.tag)] += m.weight;
  p.piece = std::max_element(weight_of.begin(), weight_of.end(), [](const auto &a, const auto &b) {
              return a.second < b.second;
            })->first;
  const StonePieces::Motion motion = pieces_->motion(stone(p), p.piece);
  for (size_t k = p.members.size(); k-- > 0 && p.members.size() > 1;) {
    const int tag = p.members[k].tag;
    if (!pieces_->is_loose(tag) && pieces_->piece_of(tag) == p.piece) continue;
    const Vec off = pieces_->position(tag) - motion.turned(surfaces_.place(tag)) - motion.center;
    if (pieces_->is_free(tag) || norm(off) > OUT_OF_PLACE * surfaces_.radius(tag)) leave(p, k);
  }
  if (p.share == 0 || norm(beyond_outline(motion.center)) > BEYOND * stone(p).patch_radius) return dissolve(p);
  follow_axis(p, motion);
  spread_over_body(p, motion);
}

void SmoothContact::spread_over_body(Patch &p, const StonePieces::Motion &motion) {
  p.body.clear();
  p.mass = motion.mass;
  p.body_mobility = 1 / motion.mass;
  if (stone(p).damping_ratio == 0) return;
  const StonePieces::Spread all = pieces_->spread(stone(p), p.piece, motion, Vec(0, 0, 1));
  p.body = all.weights, p.body_mobility = all.mobility;
}

void SmoothContact::dissolve(Patch &p) {
  if (is_first_rank())
    released_[p.agglomerate] += 0.5 * p.spring * dot(p.slip, p.slip + lmp_->update->dt * p.sliding_before);
  p.spring = 0;
  while (!p.members.empty()) leave(p, p.members.size() - 1);
}

// How far a place is beside the plate, m.
Vec SmoothContact::beyond_outline(const Vec &place) const {
  const double *e = beneath_.extent();
  return Vec(place.x - std::clamp(place.x, e[0], e[1]), place.y - std::clamp(place.y, e[2], e[3]), 0);
}

// The members, and what has come into the patch as the stone turned, share the force by weights about the present axis. q
// stays, since it is that of this step.
void SmoothContact::follow_axis(Patch &p, const StonePieces::Motion &motion) {
  const Vec axis = axis_until_next(motion);
  if (norm(cross(axis, p.axis)) < TURN_rad) return;
  p.axis = axis;
  std::set<int> before;
  for (const Weight &m : p.members) before.insert(m.tag);
  double share = 0;
  const std::vector<Weight> members = surfaces_.weights(stone(p), p.axis, [&](int tag) {
    return before.count(tag) || (pieces_->piece_of(tag) == p.piece && !pieces_->is_loose(tag) && !pieces_->touched_alone(tag));
  }, share);
  if (members.empty()) return;
  if (share < p.share) {
    if (is_first_rank()) released_[p.agglomerate] += (p.share - share) * p.state.stored;
    p.share = share;
  }
  p.members = members;
  p.base = p.q - p.w + height_of_members(p);
  for (const Weight &m : members) before.erase(m.tag);
  for (const int tag : before) stand_alone(tag);
}

// A member leaves a pressing patch with its share of the force, as a contact of its own.
void SmoothContact::leave(Patch &p, size_t member) {
  const SmoothStone &s = stone(p);
  const Weight m = p.members[member];
  const double force = p.share * m.weight * p.state.force, available = p.share * m.weight * p.state.stored;
  const double r = surfaces_.radius(m.tag), depth = depth_of(m.tag);
  double overlap = 0, energy = 0;
  if (force > 0 && available > 0 && depth > -outside()) {  // what is higher has nothing to push it
    overlap = PlasticLaw::hertz_overlap(s.modulus, r, force);
    energy = 0.4 * force * overlap;
    if (energy > available) {
      energy = available;
      overlap = std::pow(available / (8. / 15. * s.modulus * std::sqrt(r)), 0.4);
    }
  }
  if (is_first_rank()) released_[p.agglomerate] += available - energy;
  moved_[m.tag] = beyond_outline(pieces_->position(m.tag));  // beside the plate it is pushed as above it
  moved_[m.tag].z = overlap > 0 ? overlap - depth : std::min(0.0, -depth);
  // The others keep q, and share the rest of the force. All of them may weigh nothing, as a patch can be centred only
  // as far as its weights stay positive.
  p.members.erase(p.members.begin() + member);
  double rest = 0;
  for (const Weight &other : p.members) rest += other.weight;
  p.share *= rest > 0 ? rest / (rest + m.weight) : 0;
  if (p.share == 0) return;
  for (Weight &other : p.members) other.weight /= rest;
  p.base = p.q - p.w + height_of_members(p);
}

// The force across the plate of half a step ago moves those that were members then. What it gave to them and not to the
// members of now is released too.
void SmoothContact::remember_sliding() {
  std::vector<double> sums(2 * patches_.size(), 0);
  for (size_t k = 0; k < patches_.size(); k++)
    for (const Weight &m : patches_[k].members) {
      const int i = here(m.tag);
      if (i >= 0) add_sliding(m, i, patches_[k].w, &sums[2 * k]);
    }
  sum(sums);
  for (size_t k = 0; k < patches_.size(); k++)
    patches_[k].sliding_before = Vec(sums[2 * k], sums[2 * k + 1], 0) - patches_[k].drift;
}

// The integrator does half a step's work with the force before a look, and half with the one after it. So what a
// transition at the look releases is the difference of the energies half a step ago.
void SmoothContact::release_half_a_step(const std::vector<NearSphere> &near) {
  std::map<int, double> gained;
  for (const auto &[tag, force] : before_look_) gained[tag] -= force;
  for (auto &[tag, force] : gained)
    if (const int k = near_of_tag_[tag]; k >= 0 && patch_of_tag_[tag] < 0 && near[k].touches)
      force += alone_.pressing(near[k]).force_N;
  for (const Patch &p : patches_)
    if (!gained.empty() && p.presses)
      for (const Weight &m : p.members) gained[m.tag] += p.share * m.weight * p.state.force;
  for (const auto &[tag, force] : gained) {
    const int i = here(tag), k = near_of_tag_[tag];
    if (i < 0 || k < 0) continue;
    const double closing = near[k].plate_v - lmp_->atom->v[i][2];
    released_[agglomerates_.of_tag(tag)] += 0.5 * lmp_->update->dt * force * closing;
  }
}

// How far a sub-sphere reaches below the surface of the plate, as pieces_ found it, m.
double SmoothContact::depth_of(int tag) const {
  std::vector<double> plate_z(1, 0);
  if (near_of_tag_[tag] >= 0) plate_z[0] = (*near_)[near_of_tag_[tag]].plate_z;
  sum(plate_z);
  return surfaces_.radius(tag) - (pieces_->position(tag).z - plate_z[0]);
}

// The contact of a sub-sphere whose patch is gone begins without force, wherever it is.
void SmoothContact::stand_alone(int tag) {
  const double depth = depth_of(tag);
  if (depth > -moved_[tag].z) moved_[tag].z = std::min(0.0, -depth);
}

}  // namespace LAMMPS_NS
