#include "fix_free_flight.h"

#include <algorithm>
#include <cstring>
#include <set>

#include "atom.h"
#include "atom_vec.h"
#include "checkpoint_file.h"
#include "comm.h"
#include "error.h"
#include "fix_contact_history.h"
#include "fixes.h"
#include "force.h"
#include "neigh_list.h"
#include "output.h"
#include "pair.h"
#include "stone_stream.h"
#include "update.h"
#include "verlet_free_flight.h"

using namespace LAMMPS_NS;
using namespace FixConst;

namespace {
const int CALM_LOOKS = 3;         // in a row, since an oscillation has instants without velocity
const int LEAST_REST = 4;         // looks: a body that may be touched sooner does not leave
// A body flies together with the fragments that are trapped in it when all of them have less than this share of the
// energy of the impact relative to its motion, for so many looks that those on their way out are gone.
const double TRAPPED_ENERGY = 1e-3;
const int TRAPPED_LOOKS = 50;
const double REACH_MARGIN = 1.1;  // the reach may grow by this before all times are found anew
const double CLEARANCE_M = 1e-5;
const bigint FAR_AHEAD = 1000000000000000;  // steps
}  // namespace

FixFreeFlight::FixFreeFlight(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg) {
  std::string agglomerates;
  nevery = 0;
  for (int k = 3; k + 1 < narg; k += 2) {
    const std::string key = arg[k];
    if (key == "agglomerates") agglomerates = arg[k + 1];
    else if (key == "gravity") gravity_ = force->numeric(FLERR, arg[k + 1]);
    else if (key == "down" && k + 3 < narg) {
      for (int d = 0; d < 3; d++) (&down_.x)[d] = force->numeric(FLERR, arg[k + 1 + d]);
      k += 2;
    } else if (key == "speed") speed_ = force->numeric(FLERR, arg[k + 1]);
    else if (key == "tolerance") tolerance_ = force->numeric(FLERR, arg[k + 1]);
    else if (key == "every") nevery = force->inumeric(FLERR, arg[k + 1]);
    else if (key == "least_fragment") least_fragment_ = force->inumeric(FLERR, arg[k + 1]);
    else error->fix_error(FLERR, this, ("unknown keyword " + key).c_str());
  }
  if (agglomerates.empty() || speed_ <= 0 || tolerance_ <= 0 || nevery < 1)
    error->fix_error(FLERR, this, "needs agglomerates FILE [gravity G] speed V tolerance TOL every N");
  if (comm->nprocs > 1)
    error->fix_error(FLERR, this, "works on one rank only; `time.free_flight_tolerance = 0` leaves it out");
  if (!atom->tag_enable || !atom->map_style) error->fix_error(FLERR, this, "needs `atom_modify map array`");
  agglomerates_ = std::make_unique<Agglomerates>(lmp, agglomerates);
  calm_.assign(agglomerates_->tags() + 1, 0);
  held_ = std::make_unique<HeldBodies>(lmp, weight(), speed_, tolerance_, agglomerates_->tags());
  force_reneighbor = 1;
  next_reneighbor = -1;
  scalar_flag = vector_flag = global_freq = 1;
  size_vector = 2;
  delete update->integrate;
  update->integrate = new VerletFreeFlight(lmp);
}

int FixFreeFlight::setmask() { return INITIAL_INTEGRATE | PRE_NEIGHBOR | FINAL_INTEGRATE | END_OF_STEP; }

void FixFreeFlight::init() {
  if (!dynamic_cast<VerletFreeFlight *>(update->integrate))
    error->fix_error(FLERR, this, "needs the run style that it sets");
  bonds_ = fix_that_is<BodyMaker>(modify);
  plate_ = fix_that_is<Obstacle>(modify);
  stream_ = fix_that_is<StoneStream>(modify);
  agglomerates_->follow(stream_);
  history_ = nullptr;
  for (FixContactHistory *history : fixes_that_are<FixContactHistory>(modify))
    if (std::strcmp(history->style, "contacthistory") == 0) history_ = history;
  if (bonds_) bonds_->let_bodies_leave();
  held_->set_bonds(bonds_);
  if (history_ && history_->get_dnum() != 3)
    error->fix_error(FLERR, this, "can turn the contact history of `tangential history` only");
  if (plate_ && nevery % plate_->co_step() != 0) error->fix_error(FLERR, this, "needs `every` in whole co-steps");
}

void FixFreeFlight::setup(int) {
  law_ = std::make_unique<HertzLaw>(lmp);
  largest_modulus_ = law_->largest_modulus(atom);
  std::fill(calm_.begin(), calm_.end(), 0);
  if (plate_) std::copy(plate_->extent(), plate_->extent() + 4, outline_.extent);
  outline_.reach = -1;  // none known
  next_reneighbor = -1;
}

int FixFreeFlight::body_of(int tag) const { return bonds_ ? bonds_->body_of_tag()[tag] : tag; }

/* --- what there is ------------------------------------------------------------------------------------------- */

std::vector<FreeBody *> FixFreeFlight::bodies_in_flight() {
  std::vector<FreeBody *> all;
  for (auto &b : bodies_)
    if (!b->is_leaving) {
      b->go_to(update->ntimestep);
      all.push_back(b.get());
    }
  return all;
}

void FixFreeFlight::each_in_flight(const Visit &visit) const {
  for (const auto &body : bodies_) visit_parts(*body, visit);
}

void FixFreeFlight::each_in_flight_near(const Vec &point, double range, const Visit &visit) const {
  for (const auto &body : bodies_)
    if (norm(body->center_at(update->ntimestep) - point) <= range + body->radius) visit_parts(*body, visit);
}

// The attitude is integrated from one call to the next, so a copy is asked, and the body itself goes on as if unseen.
void FixFreeFlight::visit_parts(const FreeBody &body, const Visit &visit) const {
  if (body.is_leaving) return;
  FreeBody seen = body;
  seen.go_to(update->ntimestep);
  double x[3], v[3];
  for (const FreeBody::Part &p : seen.parts) {
    const FreeBody::State s = seen.state(p);
    s.x.to(x), s.v.to(v);
    visit(p.tag, x, v);
  }
}

// `thermo_modify lost error` cannot be asked, as it takes a run without a sub-sphere in the arrays for lost.
void FixFreeFlight::check_count() const {
  int count = atom->nlocal;
  for (const auto &b : bodies_)
    if (!b->is_leaving) count += b->parts.size();
  if (count != (stream_ ? stream_->tags_near() : agglomerates_->tags())) error->one(FLERR, "Sub-spheres were lost");
}

void FixFreeFlight::add_to(LedgerRows &rows) {
  for (const FreeBody *b : bodies_in_flight()) {
    const int a = b->agglomerate;
    rows.at(a, KINETIC) += b->kinetic();
    rows.at(a, MOMENTUM_Z) += b->mass * b->velocity.z;
    rows.at(a, MASS_HEIGHT) -= b->mass * dot(down_, b->center);
    rows.at(a, BOND_ELASTIC) += b->bond_elastic;
    rows.at(a, PAIR_ELASTIC) += b->pair_elastic;
  }
}

/* --- who leaves, who comes back ------------------------------------------------------------------------------ */

void FixFreeFlight::end_of_step() {
  for (auto &b : bodies_) b->go_to(update->ntimestep);
  check_count();
  std::vector<ArrayBody> others =
      bodies_in_arrays(atom, agglomerates_->tags(), [this](int tag) { return body_of(tag); });
  update_reach();
  if (stream_) take_out_those_that_left();
  watch_bodies_in_flight(others);
  held_->count_still(others);
  let_calm_bodies_depart(others);
  if (held_->choose(others, [&](ArrayBody &b, double limit_N) { return is_gentle(b, limit_N, others); }))
    next_reneighbor = update->ntimestep + 1;
  for (auto &b : bodies_)
    if (b->is_leaving || b->is_waking) next_reneighbor = update->ntimestep + 1;
}

// Does no encounter ahead, with the plate or with another body, push with more than `limit_N`? Of each the peak force
// is that of Hertz.
bool FixFreeFlight::is_gentle(ArrayBody &b, double limit_N, std::vector<ArrayBody> &others) {
  const double rest = LEAST_REST * nevery * update->dt;
  double radius = 0;
  for (int i : b.atoms) radius = std::max(radius, atom->radius[i]);
  auto is_hard = [&](double mass, double closing) {
    const double peak = std::pow(4. / 3. * largest_modulus_ * std::sqrt(radius), 0.4) *
                        std::pow(1.25 * mass * closing * closing, 0.6);
    return closing > 0 && peak > limit_N;
  };
  if (plate_ && is_hard(b.mass, -b.velocity.z) && time_to_plate(b, outline_, weight()) <= rest)
    return false;
  auto meets_hard = [&](Outline &other, double mass) {
    const Vec apart = b.center - other.center;
    const double closing = dot(other.velocity - b.velocity, apart) / norm(apart);
    return is_hard(b.mass * mass / (b.mass + mass), closing) && time_to_meet(b, other) <= rest;
  };
  for (ArrayBody &other : others)
    if (&other != &b && !other.is_trapped && meets_hard(other, other.mass)) return false;
  for (auto &other : bodies_)
    if (!other->is_leaving && meets_hard(*other, other->mass)) return false;
  return true;
}

void FixFreeFlight::final_integrate() {
  if (held_->push()) next_reneighbor = update->ntimestep + 1;
}

// The times found so far hold as long as the plate keeps within the reach with which they were found.
void FixFreeFlight::update_reach() {
  const double reach = plate_ ? plate_->reach() : 0;
  if (reach <= outline_.reach && outline_.reach <= 2 * REACH_MARGIN * (reach + CLEARANCE_M)) return;
  outline_.reach = REACH_MARGIN * (reach + CLEARANCE_M);
  for (auto &b : bodies_) b->safe_until = 0;
}

// Finds until when it touches neither the plate nor another body in free flight. The other one may not have known of
// this body, which left the arrays after it.
void FixFreeFlight::find_safe_until(FreeBody &body) {
  auto step_after = [this](double time) {
    return update->ntimestep + static_cast<bigint>(std::min(time / update->dt, double(FAR_AHEAD)));
  };
  body.safe_until = step_after(plate_ ? time_to_plate(body, outline_, weight()) : FAR_AHEAD);
  for (auto &other : bodies_) {
    if (other.get() == &body) continue;
    const bigint meeting = step_after(time_to_meet(body, *other));
    body.safe_until = std::min(body.safe_until, meeting);
    other->safe_until = std::min(other->safe_until, meeting);
  }
}

// Finds the bodies in free flight that must come back before the next look.
void FixFreeFlight::watch_bodies_in_flight(std::vector<ArrayBody> &others) {
  const double horizon = (nevery + 2) * update->dt;
  bool asked = false;
  for (auto &b : bodies_) {
    if (b->safe_until < update->ntimestep + nevery + 2) {
      if (plate_ && plate_->is_quiet() && !asked && time_to_plate(*b, outline_, weight()) < horizon) {
        plate_->ask_reach();
        update_reach();
        asked = true;
      }
      find_safe_until(*b);
      b->is_waking = b->safe_until < update->ntimestep + nevery + 2;
    }
    for (ArrayBody &other : others)
      if (!b->is_waking) b->is_waking = time_to_meet(*b, other, speed_) < 1.5 * horizon;
  }
}

// Is all of it below the plate's top face, and never rises to it again? The plate has no other face to touch.
bool FixFreeFlight::has_left(const Outline &b) const {
  const double fall = -weight().z, up = b.velocity.z;
  if (up > 0 && fall <= 0) return false;
  const double highest = b.center.z + b.radius + (up > 0 ? up * up / (2 * fall) : 0);
  return highest < -outline_.reach;
}

bool FixFreeFlight::is_dust(const FreeBody &b) const {
  return b.parts.size() < least_fragment_ && static_cast<int>(b.parts.size()) < agglomerates_->size(b.agglomerate);
}

void FixFreeFlight::take_out_those_that_left() {
  auto left = [&](const std::unique_ptr<FreeBody> &b) {
    if (b->is_leaving || b->is_waking || !(has_left(*b) || is_dust(*b))) return false;
    stream_->take_out({b->agglomerate, static_cast<int>(b->parts.size()), b->mass, b->kinetic(), b->bond_elastic,
                       b->pair_elastic, b->center, b->velocity});
    return true;
  };
  bodies_.erase(std::remove_if(bodies_.begin(), bodies_.end(), left), bodies_.end());
}

// Is its inner motion, and that of the fragments trapped in it, so small that it may leave?
bool FixFreeFlight::is_calm(const ArrayBody &b) {
  const double impact = 0.5 * speed_ * speed_ * b.mass;
  double fragments = 0;
  for (const ArrayBody *fragment : b.trapped) fragments += fragment->energy_over(b);
  int &looks = calm_[b.label];
  looks = b.inner_energy <= tolerance_ * impact && fragments <= TRAPPED_ENERGY * impact ? looks + 1 : 0;
  return b.atoms.size() == 1 || looks >= (b.trapped.empty() ? CALM_LOOKS : TRAPPED_LOOKS);
}

void FixFreeFlight::let_calm_bodies_depart(std::vector<ArrayBody> &others) {
  const double rest = LEAST_REST * nevery * update->dt;
  find_trapped(others, *agglomerates_);
  std::vector<ArrayBody *> all;
  std::vector<char> leaves;
  for (ArrayBody &b : others) {
    if (b.is_trapped) continue;
    const bool left = stream_ && has_left(b), calm = is_calm(b) || left;
    if (calm && !b.trapped.empty()) b.take_trapped();
    all.push_back(&b);
    leaves.push_back(left || (calm && (!plate_ || time_to_plate(b, outline_, weight()) > rest)));
    for (auto &other : bodies_)
      leaves.back() = leaves.back() && time_to_meet(b, *other, other->is_waking ? speed_ : 0) > rest;
    if (!calm)
      for (ArrayBody *p : b.trapped) all.push_back(p), leaves.push_back(false);
  }
  keep_those_that_meet(all, leaves, rest);
  for (size_t k = 0; k < all.size(); k++)
    if (leaves[k]) depart(*all[k]);
  if (std::count(leaves.begin(), leaves.end(), 1)) note_elastic_energies();
}

// Of those that could leave, one that meets a body that stays, or another one too soon, stays as well.
void FixFreeFlight::keep_those_that_meet(const std::vector<ArrayBody *> &all, std::vector<char> &leaves, double rest) {
  for (bool changed = true; changed;) {
    changed = false;
    for (size_t k = 0; k < all.size(); k++)
      for (size_t l = 0; l < all.size() && leaves[k]; l++)
        if (l != k && !(leaves[l] && have_left(*all[k], *all[l])) && (leaves[l] ? time_to_meet(*all[k], *all[l]) : time_to_meet(*all[k], *all[l], speed_)) <= rest)
          leaves[k] = false, changed = true;
  }
}

void FixFreeFlight::depart(ArrayBody &b) {
  b.departs = true;
  for (ArrayBody *fragment : b.trapped) fragment->departs = true, held_->let_go(fragment->label);
  held_->let_go(b.label);
  const int agglomerate = agglomerates_->of_tag(b.label);
  bodies_.push_back(std::make_unique<FreeBody>(atom, b, agglomerate, weight(), update->ntimestep, update->dt));
  if (bonds_)
    for (int i : b.atoms) bonds_->forget_forces(i);
  calm_[b.label] = 0;
  departures_++;
}

// What the bodies that leave hold in their bonds, and in contacts between their own sub-spheres.
void FixFreeFlight::note_elastic_energies() {
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
void FixFreeFlight::add_pair_energy_by_body(double *energy) const {
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

/* --- out of the arrays and back ------------------------------------------------------------------------------ */

void FixFreeFlight::change_arrays() {
  remove_leaving();
  auto wakes = [](const std::unique_ptr<FreeBody> &b) { return b->is_waking; };
  for (auto &b : bodies_)
    if (b->is_waking) {
      b->go_to(update->ntimestep);
      insert(*b, 0.5 * update->dt);
    }
  bodies_.erase(std::remove_if(bodies_.begin(), bodies_.end(), wakes), bodies_.end());
}

void FixFreeFlight::remove_leaving() {
  std::vector<char> gone(atom->nlocal, 0);
  std::vector<double> record(4096 + comm->maxexchange_fix);
  for (auto &b : bodies_) {
    if (!b->is_leaving) continue;
    b->is_leaving = false;
    for (FreeBody::Part &p : b->parts) {
      const int i = atom->map(p.tag), size = atom->avec->pack_exchange(i, record.data());
      p.packed = b->packed.size();
      b->packed.insert(b->packed.end(), record.begin(), record.begin() + size);
      gone[i] = 1;
      atom->map_one(p.tag, -1);
    }
  }
  int kept = 0;  // the order in memory stays, in which neighbours in space are neighbours
  for (size_t i = 0; i < gone.size(); i++) {
    if (gone[i]) continue;
    if (kept != static_cast<int>(i)) atom->avec->copy(i, kept, 1);
    kept++;
  }
  atom->nlocal = kept;
}

// Appends the body as it is at its present step; velocities `half_step` seconds earlier, as they are within a step.
int FixFreeFlight::insert(FreeBody &b, double half_step) {
  const Vec down = weight();
  for (const FreeBody::Part &p : b.parts) {
    atom->avec->unpack_exchange(&b.packed[p.packed]);
    const int i = atom->nlocal - 1;
    const FreeBody::State s = b.state(p);
    s.x.to(atom->x[i]);
    (s.v - half_step * (s.acceleration + down)).to(atom->v[i]);
    (s.omega - half_step * s.spin_acceleration).to(atom->omega[i]);
    if (bonds_) bonds_->rotate(i, b.attitude());
    for (int k = 0; history_ && k < history_->n_partner(i); k++) {
      double *shear = history_->contacthistory(i, k);
      b.attitude()(Vec(shear)).to(shear);
    }
  }
  return b.parts.size();
}

void FixFreeFlight::show() {
  const bigint now = update->ntimestep;
  if (output->next_dump_any != now && !output->restart_requested(now)) return;
  for (const auto &body : bodies_) {
    if (body->is_leaving) continue;
    FreeBody seen = *body;  // as in each_in_flight
    seen.go_to(now);
    shown_ += insert(seen, 0);
  }
  atom->natoms += shown_;
}

void FixFreeFlight::hide() {
  atom->nlocal -= shown_;
  atom->natoms -= shown_;
  shown_ = 0;
}

void FixFreeFlight::bring_back() {
  for (FreeBody *b : bodies_in_flight()) atom->natoms += insert(*b, 0);
  bodies_.clear();
}

/* --- time jumps ---------------------------------------------------------------------------------------------- */

void FixFreeFlight::jump() {
  if (atom->nlocal > 0 || (bodies_.empty() && !stream_) || (plate_ && !plate_->is_quiet())) return;
  const bigint now = update->ntimestep;
  for (auto &b : bodies_)
    if (b->is_waking) return;
  const int unit = plate_ ? plate_->co_step() : 1;
  const bigint co_steps = (next_event() - 1 - now) / unit;
  if (co_steps < 1) return;
  update->ntimestep += co_steps * unit;
  jumped_ += co_steps * unit;
  if (plate_) plate_->skip(co_steps);
}

// The next step at which something happens while all bodies are in free flight.
bigint FixFreeFlight::next_event() const {
  const bigint now = update->ntimestep;
  auto next_multiple = [&](int every) { return (now / every + 1) * every; };
  bigint event = std::min(update->laststep, output->next);
  if (stream_) event = std::min(event, stream_->next_entry());
  bigint safe = FAR_AHEAD;
  for (auto &b : bodies_) safe = std::min(safe, b->safe_until);
  event = std::min(event, std::max(next_multiple(nevery), safe / nevery * nevery));
  for (int k = 0; k < modify->nfix; k++) {
    Fix *fix = modify->fix[k];
    if (fix == this) continue;
    int every = (modify->fmask[k] & END_OF_STEP) && fix->nevery > 1 ? fix->nevery : 0;
    if (const auto *acts = dynamic_cast<ActsInFreeFlight *>(fix)) every = acts->acts_every();
    if (every > 0) event = std::min(event, next_multiple(every));
  }
  return event;
}

double FixFreeFlight::compute_scalar() {
  double count = 0;
  for (FreeBody *b : bodies_in_flight()) count += b->parts.size();
  return count;
}

double FixFreeFlight::compute_vector(int n) { return n == 0 ? jumped_ : departures_; }

/* --- checkpoint: bodies that are away stay away -------------------------------------------------------------- */

// The attitude is integrated from one call to the next, so every run must call at the same steps.
void FixFreeFlight::begin_anew() {
  for (FreeBody *b : bodies_in_flight()) b->attitude();
}

void FixFreeFlight::save(CheckpointWriter &out) {
  std::vector<double> row;
  for (const auto &b : bodies_) b->append_to(row);
  out.common("free_flight", {static_cast<double>(bodies_.size()), outline_.reach, static_cast<double>(jumped_),
                             static_cast<double>(departures_)});
  std::vector<double> calm;
  agglomerates_->each_near_tag([&](int tag) {
    if (calm_[tag] != 0) calm.insert(calm.end(), {tag + 0.0, calm_[tag] + 0.0});
  });
  out.rows("free_flight_calm", calm);
  out.rows("free_flight_bodies", row);
  held_->save(out);
}

void FixFreeFlight::restore(const CheckpointReader &in) {
  const std::vector<double> &numbers = in.common("free_flight", 4), &calm = in.rows("free_flight_calm", 2);
  outline_.reach = numbers[1];
  jumped_ = static_cast<bigint>(numbers[2]);
  departures_ = static_cast<bigint>(numbers[3]);
  for (size_t k = 0; k < calm.size(); k += 2) calm_[static_cast<int>(calm[k])] = static_cast<int>(calm[k + 1]);
  bodies_.clear();
  held_->restore(in);
  const double *row = in.rows("free_flight_bodies", 1).data();
  for (int k = 0; k < static_cast<int>(numbers[0]); k++) {
    bodies_.push_back(std::make_unique<FreeBody>(row));
    bodies_.back()->go_to(update->ntimestep);
  }
  for (FreeBody *b : bodies_in_flight()) shown_ += insert(*b, 0);  // until the end of the set-up
  atom->natoms += shown_;
}
