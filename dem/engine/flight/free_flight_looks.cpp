#include "flight/free_flight_looks.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "atom.h"
#include "base/fixes.h"
#include "force.h"
#include "interfaces/checkpoint_file.h"
#include "neigh_list.h"
#include "pair.h"
#include "flight/reach_pairs.h"
#include "interfaces/stone_stream.h"
#include "update.h"

using namespace LAMMPS_NS;

namespace {
const int CALM_LOOKS = 3;         // in a row, since an oscillation has instants without velocity
// Of the tolerance: what a body trembles with when it strikes adds to the stress, and dies out within the millisecond
// that it takes from the height at which a face could touch. Below that height a body flies only if it trembles less.
const double STILL_SHARE = 0.01;
const int LEAST_REST = 3;         // looks ahead: a body that may be touched sooner does not leave
const double UNFORESEEN_LOOKS = 1.5;  // ahead: a body comes back that may meet one in the arrays sooner
// A body leaves together with the fragments trapped in it: with those lighter than a share of it when their motion
// relative to it has less than this share of the energy of the impact, all together, for so many looks that fragments on
// their way out are gone; with a heavier one while it would part so slowly that its own energy is within the tolerance.
const double LIGHT_SHARE = 0.05, TRAPPED_ENERGY = 1e-3;
const int TRAPPED_LOOKS = 25;
const double REACH_MARGIN = 1.1;  // the reach may grow by this before all times are found anew
const double CLEARANCE_M = 1e-5;
}  // namespace

// What one look sees: the bodies in the arrays, then those in free flight, and who of them could meet soon.
struct FreeFlightLooks::Look {
  std::vector<ArrayBody> in_arrays;
  std::vector<Outline *> all;
  std::unique_ptr<ReachPairs> pairs;
  bool is_in_arrays(size_t k) const { return k < in_arrays.size(); }
};

FreeFlightLooks::FreeFlightLooks(LAMMPS *lmp, const FlightRules &rules, const Agglomerates &agglomerates,
                                 HeldBodies &held, Bodies &bodies)
    : Pointers(lmp), rules_(rules), agglomerates_(agglomerates), held_(held), bodies_(bodies),
      calm_(agglomerates.tags() + 1, 0), still_(calm_) {}

void FreeFlightLooks::init() {
  bonds_ = fix_that_is<BodyMaker>(modify);
  plate_ = fix_that_is<Obstacle>(modify);
  walls_ = fixes_that_are<SideWall>(modify);
  stream_ = fix_that_is<StoneStream>(modify);
}

void FreeFlightLooks::setup() {
  law_ = std::make_unique<HertzLaw>(lmp);
  largest_modulus_ = law_->largest_modulus(atom);
  std::fill(calm_.begin(), calm_.end(), 0);
  still_ = calm_;
  if (plate_) std::copy(plate_->extent(), plate_->extent() + 4, outline_.extent);
  outline_.patch_height = plate_ ? plate_->patch_height() : 0;
  outline_.reach = -1;  // none known
}

// Steps until the next look has been acted on.
int FreeFlightLooks::horizon() const { return rules_.every + 2; }

double FreeFlightLooks::horizon_s() const { return horizon() * update->dt; }

double FreeFlightLooks::unforeseen_s() const { return UNFORESEEN_LOOKS * rules_.every * update->dt; }

// How long a body that leaves must touch nothing.
double FreeFlightLooks::rest_s() const { return LEAST_REST * rules_.every * update->dt; }

bool FreeFlightLooks::look() {
  Look look;
  look.in_arrays = bodies_in_arrays(atom, agglomerates_.tags(), [this](int tag) { return body_of(tag); });
  for (ArrayBody &b : look.in_arrays) find_surface(b);
  update_reach();
  if (stream_) take_out_those_that_left();
  for (ArrayBody &b : look.in_arrays) look.all.push_back(&b);
  for (auto &b : bodies_) look.all.push_back(b.get());
  find_pairs(look);
  watch_bodies_in_flight(look);
  held_.count_still(look.in_arrays);
  let_calm_bodies_depart(look);
  held_.choose(look.in_arrays, [&](ArrayBody &b, double limit_N) { return is_gentle(look, b, limit_N); });
  return std::any_of(bodies_.begin(), bodies_.end(), [](auto &b) { return b->is_leaving || b->is_waking; });
}

void FreeFlightLooks::find_surface(ArrayBody &b) const {
  b.agglomerate = agglomerates_.of_tag(b.label);
  if (!plate_) return;
  std::vector<int> tags;
  for (const int i : b.atoms) tags.push_back(atom->tag[i]);
  b.outside = plate_->outside(tags);
  b.faces_outside = plate_->faces_outside();
  if (b.faces_outside > 0) b.plate = plate_;
  b.own_surface = plate_->surface(tags);
  if (b.own_surface.outer == 0) return;
  b.own_surface.x = b.own_surface.x - b.center;
  b.radius = std::max(b.radius, norm(b.own_surface.x) + b.own_surface.outer);
}

bool FreeFlightLooks::is_pushed(int label) const {
  for (int k = 0; k < modify->nfix; k++)
    if (const auto *acts = dynamic_cast<ActsInFreeFlight *>(modify->fix[k]))
      if (acts->pushes(label)) return true;
  return false;
}

// Until the last message before it can touch the plate, which then tells where it is.
double FreeFlightLooks::time_to_message(Outline &b) const {
  return std::max(0.0, time_to_plate(b, outline_, rules_.weight) - plate_->longest_message() * update->dt);
}

double FreeFlightLooks::time_to_obstacle(Outline &b) const {
  double time = plate_ ? time_to_message(b) : std::numeric_limits<double>::infinity();
  for (const SideWall *wall : walls_) time = std::min(time, time_to_wall(b, wall->outline(), rules_.weight));
  return time;
}

// The times found so far hold as long as the plate keeps within the reach with which they were found.
void FreeFlightLooks::update_reach() {
  const double reach = plate_ ? plate_->reach() : 0;
  if (reach <= outline_.reach && outline_.reach <= 2 * REACH_MARGIN * (reach + CLEARANCE_M)) return;
  outline_.reach = REACH_MARGIN * (reach + CLEARANCE_M);
  for (auto &b : bodies_) b->safe_until = 0;
}

bool FreeFlightLooks::watch_plate() {
  if (bodies_.empty() || !plate_ || plate_->reach() <= outline_.reach) return false;
  update_reach();
  for (auto &b : bodies_) b->go_to(update->ntimestep);
  bool changes = false;
  for (auto &b : bodies_) {
    if (b->is_leaving || b->is_waking) continue;
    find_safe_until(*b);
    b->is_waking = b->safe_until < update->ntimestep + horizon();
    changes |= b->is_waking;
  }
  return changes;
}

// Finds until when the body touches neither the plate nor a wall nor another body in free flight. That other body
// notes the time of the meeting as well, since it may have left the arrays first. The plate's motion is not known
// ahead, so the plate is asked more often than other bodies.
void FreeFlightLooks::find_safe_until(FreeBody &body) {
  auto step_after = [this](double time) {
    return update->ntimestep + static_cast<bigint>(std::min(time / update->dt, double(FAR_AHEAD)));
  };
  if (body.meets_at < update->ntimestep + horizon()) {
    body.meets_at = update->ntimestep + FAR_AHEAD;
    for (auto &other : bodies_) {
      if (other.get() == &body) continue;
      const bigint meeting = step_after(time_to_meet(body, *other));
      body.meets_at = std::min(body.meets_at, meeting);
      other->meets_at = std::min(other->meets_at, meeting);
      other->safe_until = std::min(other->safe_until, meeting);
    }
  }
  body.safe_until = std::min(body.meets_at, step_after(time_to_obstacle(body)));
}

// Pairs of two bodies in free flight are left out: their safe_until has their meeting in it.
void FreeFlightLooks::find_pairs(Look &look) const {
  const double time_s = std::max(rest_s(), unforeseen_s());
  look.pairs = std::make_unique<ReachPairs>(look.all, look.in_arrays.size(), time_s, rules_.speed);
}

// Finds the bodies in free flight that must come back before the next look.
void FreeFlightLooks::watch_bodies_in_flight(const Look &look) {
  bool asked = false;
  for (size_t k = 0; k < bodies_.size(); k++) {
    FreeBody *b = bodies_[k].get();
    if (b->safe_until < update->ntimestep + horizon()) {
      if (plate_ && plate_->is_quiet() && !asked && time_to_message(*b) < horizon_s()) {
        plate_->ask_reach();
        update_reach();
        asked = true;
      }
      find_safe_until(*b);
      b->is_waking = b->safe_until < update->ntimestep + horizon();
    }
    for (const int m : look.pairs->of(look.in_arrays.size() + k))  // in the arrays, all of them
      if (!b->is_waking) b->is_waking = time_to_meet(*b, *look.all[m], rules_.speed) < unforeseen_s();
  }
}

// Is all of it below the plate's top face and the foot of the walls, and never rises to them again? The plate has no
// other face to touch.
bool FreeFlightLooks::has_left(const Outline &b) const {
  const double fall = -rules_.weight.z, up = b.velocity.z;
  if (up > 0 && fall <= 0) return false;
  const double highest = b.center.z + b.radius + (up > 0 ? up * up / (2 * fall) : 0);
  double lowest = -outline_.reach;
  for (const SideWall *wall : walls_) lowest = std::min(lowest, wall->outline().low.z);
  return highest < lowest;
}

bool FreeFlightLooks::is_dust(const FreeBody &b) const {
  return static_cast<int>(b.parts.size()) < std::min(rules_.least_fragment, agglomerates_.size(b.agglomerate));
}

// Does it fly higher above the plate than any face may lie outside its sub-spheres?
bool FreeFlightLooks::is_clear(FreeBody &b) const {
  if (!plate_) return true;
  const bool still = std::exchange(b.is_still, false);
  const bool clear = time_to_plate(b, outline_, rules_.weight) > rest_s();
  b.is_still = still;
  return clear;
}

void FreeFlightLooks::take_out_those_that_left() {
  auto left = [&](const std::unique_ptr<FreeBody> &b) {
    if (b->is_leaving || b->is_waking || !(has_left(*b) || (is_dust(*b) && is_clear(*b)))) return false;
    stream_->take_out({b->agglomerate, static_cast<int>(b->parts.size()), b->mass, b->kinetic(), b->bond_elastic,
                       b->pair_elastic, b->center, b->velocity});
    return true;
  };
  bodies_.erase(std::remove_if(bodies_.begin(), bodies_.end(), left), bodies_.end());
}

// Is its inner motion, and that of the fragments trapped in it, so small that it may leave?
bool FreeFlightLooks::is_calm(ArrayBody &b) {
  const double impact = 0.5 * rules_.speed * rules_.speed * b.mass;
  double fragments = 0;
  for (const ArrayBody *fragment : b.trapped) fragments += fragment->energy_over(b);
  int &looks = calm_[b.label], &still_looks = still_[b.label];
  still_looks = b.inner_energy + fragments <= STILL_SHARE * rules_.tolerance * impact ? still_looks + 1 : 0;
  b.is_still = b.atoms.size() == 1 || still_looks >= CALM_LOOKS;
  looks = b.inner_energy <= rules_.tolerance * impact && fragments <= TRAPPED_ENERGY * impact ? looks + 1 : 0;
  return b.atoms.size() == 1 || looks >= (b.trapped.empty() ? CALM_LOOKS : TRAPPED_LOOKS);
}

void FreeFlightLooks::let_calm_bodies_depart(Look &look) {
  const size_t count = look.in_arrays.size();
  find_trapped(look.in_arrays, agglomerates_, [this](const ArrayBody &fragment, const ArrayBody &host) {
    return fragment.mass < LIGHT_SHARE * host.mass ||
           norm(fragment.velocity - host.velocity) <= std::sqrt(rules_.tolerance) * rules_.speed;
  });
  std::vector<char> leaves(count, 0), is_part(count, 0);  // of another one, with which it may leave
  for (size_t k = 0; k < count; k++) {
    ArrayBody &b = look.in_arrays[k];
    if (b.is_trapped) continue;
    const bool left = stream_ && has_left(b), calm = is_calm(b) || left;
    if (calm && !b.trapped.empty()) {
      for (const ArrayBody *p : b.trapped) is_part[p - look.in_arrays.data()] = 1;
      b.take_trapped();
      find_surface(b);
    }
    leaves[k] = left || (calm && time_to_obstacle(b) > rest_s() && !is_pushed(b.label));
  }
  if (std::count(is_part.begin(), is_part.end(), 1)) find_pairs(look);
  for (size_t k = 0; k < count; k++)
    for (const int m : look.pairs->of(k)) {
      if (look.is_in_arrays(m) || !leaves[k]) continue;
      FreeBody &other = static_cast<FreeBody &>(*look.all[m]);
      leaves[k] = time_to_meet(look.in_arrays[k], other, other.is_waking ? rules_.speed : 0) > rest_s();
    }
  keep_those_that_meet(look, is_part, leaves);
  for (size_t k = 0; k < count; k++)
    if (leaves[k]) depart(look.in_arrays[k]);
  if (std::count(leaves.begin(), leaves.end(), 1)) note_elastic_energies();
}

// A body that could leave stays if it may meet a body that stays, or soon meets another one that could leave.
void FreeFlightLooks::keep_those_that_meet(Look &look, const std::vector<char> &is_part, std::vector<char> &leaves) {
  auto meet = [&](size_t k, size_t m) {
    ArrayBody &a = look.in_arrays[k], &b = look.in_arrays[m];
    if (!leaves[m]) return time_to_meet(a, b, rules_.speed) <= rest_s();
    return !have_left(a, b) && time_to_meet(a, b) <= rest_s();
  };
  for (bool changed = true; changed;) {
    changed = false;
    for (size_t k = 0; k < look.in_arrays.size(); k++)
      for (const int m : look.pairs->of(k))
        if (leaves[k] && look.is_in_arrays(m) && !is_part[m] && meet(k, m)) leaves[k] = 0, changed = true;
  }
}

// Does no encounter ahead, with the plate, a wall or another body, push with more than `limit_N`? The peak force of an
// encounter is that of an elastic impact after Hertz.
bool FreeFlightLooks::is_gentle(const Look &look, ArrayBody &b, double limit_N) {
  double radius = 0;
  for (int i : b.atoms) radius = std::max(radius, atom->radius[i]);
  auto is_hard = [&](double mass, double closing) {
    if (closing <= 0) return false;
    const double peak = std::pow(4. / 3. * largest_modulus_ * std::sqrt(radius), 0.4) *
                        std::pow(1.25 * mass * closing * closing, 0.6);
    return peak > limit_N;
  };
  if (plate_ && is_hard(b.mass, -b.velocity.z) && time_to_plate(b, outline_, rules_.weight) <= rest_s()) return false;
  for (const SideWall *wall : walls_) {
    const Vec off = from_wall(b.center, wall->outline());
    if (is_hard(b.mass, -dot(b.velocity, off) / norm(off)) && time_to_wall(b, wall->outline(), rules_.weight) <= rest_s())
      return false;
  }
  for (const int m : look.pairs->of(&b - look.in_arrays.data())) {
    if (look.is_in_arrays(m) && look.in_arrays[m].is_trapped) continue;
    Outline &other = *look.all[m];
    const Vec apart = b.center - other.center;
    const double closing = dot(other.velocity - b.velocity, apart) / norm(apart);
    if (is_hard(b.mass * other.mass / (b.mass + other.mass), closing) && time_to_meet(b, other) <= rest_s())
      return false;
  }
  return true;
}

void FreeFlightLooks::depart(ArrayBody &b) {
  b.departs = true;
  for (ArrayBody *fragment : b.trapped) fragment->departs = true, held_.let_go(fragment->label);
  held_.let_go(b.label);
  bodies_.push_back(std::make_unique<FreeBody>(atom, b, rules_.weight, update->ntimestep, update->dt));
  if (bonds_)
    for (int i : b.atoms) bonds_->let_leave(i);
  calm_[b.label] = still_[b.label] = 0;
  departures_++;
}

// Notes the elastic energy that leaving bodies take along, in bonds and in contacts between their own sub-spheres.
void FreeFlightLooks::note_elastic_energies() {
  auto may_hold = [](auto &b) { return b->is_leaving && b->parts.size() > 1; };
  if (std::none_of(bodies_.begin(), bodies_.end(), may_hold)) return;
  bond_energy_.resize(calm_.size()), pair_energy_.resize(calm_.size());
  for (int i = 0; i < atom->nlocal; i++) bond_energy_[body_of(atom->tag[i])] = pair_energy_[body_of(atom->tag[i])] = 0;
  if (bonds_) bonds_->add_elastic_energy_by_body(bond_energy_.data());
  add_pair_energy_by_body(pair_energy_.data());
  for (auto &b : bodies_) {
    if (!b->is_leaving) continue;
    std::set<int> labels;
    for (const FreeBody::Part &p : b->parts) labels.insert(body_of(p.tag));
    for (int label : labels) b->bond_elastic += bond_energy_[label], b->pair_elastic += pair_energy_[label];
  }
}

// Elastic energy in contacts between sub-spheres in the arrays, given to the body of one of the two, J.
void FreeFlightLooks::add_pair_energy_by_body(double *energy) const {
  const NeighList *list = force->pair->list;
  for (int k = 0; k < list->inum; k++) {
    const int i = list->ilist[k];
    for (int m = 0; m < list->numneigh[i]; m++) {
      const int j = list->firstneigh[i][m] & NEIGHMASK;
      const double sum = atom->radius[i] + atom->radius[j], overlap = sum - norm(Vec(atom->x[i]) - Vec(atom->x[j]));
      if (overlap > 0)
        energy[body_of(atom->tag[i])] +=
            law_->elastic_energy(atom->type[i], atom->type[j], atom->radius[i] * atom->radius[j] / sum, overlap);
    }
  }
}

void FreeFlightLooks::save(CheckpointWriter &out) const {
  out.common("free_flight_looks", {outline_.reach, static_cast<double>(departures_)});
  std::vector<double> calm;
  agglomerates_.each_near_tag([&](int tag) {
    if (calm_[tag] != 0 || still_[tag] != 0) calm.insert(calm.end(), {tag + 0.0, calm_[tag] + 0.0, still_[tag] + 0.0});
  });
  out.rows("free_flight_calm", calm);
}

void FreeFlightLooks::restore(const CheckpointReader &in) {
  const std::vector<double> &numbers = in.common("free_flight_looks", 2), &calm = in.rows("free_flight_calm", 3);
  outline_.reach = numbers[0];
  departures_ = static_cast<bigint>(numbers[1]);
  for (size_t k = 0; k < calm.size(); k += 3) {
    const int tag = static_cast<int>(calm[k]);
    calm_[tag] = static_cast<int>(calm[k + 1]), still_[tag] = static_cast<int>(calm[k + 2]);
  }
}
