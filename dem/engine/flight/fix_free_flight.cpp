#include "flight/fix_free_flight.h"

#include <algorithm>
#include <cstring>

#include "atom.h"
#include "atom_vec.h"
#include "interfaces/checkpoint_file.h"
#include "comm.h"
#include "error.h"
#include "base/fix_input.h"
#include "flight/known_in_flight.h"
#include "fix_contact_history.h"
#include "base/fixes.h"
#include "group.h"
#include "output.h"
#include "interfaces/stone_stream.h"
#include "update.h"
#include "flight/verlet_free_flight.h"

using namespace LAMMPS_NS;
using namespace FixConst;

FixFreeFlight::FixFreeFlight(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg) {
  std::string agglomerates, unheld;
  double gravity = 0;
  FlightRules rules;
  FixInput(lmp, this)
      .text("agglomerates", agglomerates)
      .number("gravity", gravity, Allowed::FROM_0)
      .direction("down", down_)
      .number("speed", rules.speed, Allowed::ABOVE_0)
      .number("tolerance", rules.tolerance, Allowed::ABOVE_0)
      .whole("every", nevery, 1)
      .text("unheld", unheld)
      .whole("least_fragment", rules.least_fragment, 0)
      .number("body_skin", body_skin_, Allowed::FROM_0)
      .read(arg, 3, narg, {"agglomerates", "speed", "tolerance", "every", "unheld"});
  const FixInput input(lmp, this);
  if (down_.z >= 0) input.refuse("down: must have a Z below 0");
  if (group->find(unheld.c_str()) <= 0) input.refuse("unheld " + unheld + ": must be a group of the deck, not `all`");
  unheld_ = group->bitmask[group->find(unheld.c_str())];
  if (comm->nprocs > 1) input.refuse("works on one rank only; `time.free_flight_tolerance = 0` leaves it out");
  note_radii();
  rules.weight = weight_ = gravity * down_;
  rules.every = nevery;
  agglomerates_ = std::make_unique<Agglomerates>(lmp, this, agglomerates);
  held_ = std::make_unique<HeldBodies>(lmp, weight_, rules.speed, rules.tolerance, agglomerates_->tags(), unheld_);
  looks_ = std::make_unique<FreeFlightLooks>(lmp, rules, *agglomerates_, *held_, bodies_);
  create_attribute = 1;
  force_reneighbor = 1;
  next_reneighbor = -1;
  scalar_flag = vector_flag = global_freq = 1;
  size_vector = 2;
  delete update->integrate;
  update->integrate = new VerletFreeFlight(lmp);
}

int FixFreeFlight::setmask() { return INITIAL_INTEGRATE | PRE_EXCHANGE | PRE_NEIGHBOR | FINAL_INTEGRATE | END_OF_STEP; }

void FixFreeFlight::pre_exchange() {
  if (!stream_) return;
  std::vector<Vec> flying;
  for (const StoneStream::Ball &ball : stream_->wanted())
    for (const auto &body : bodies_)
      if (norm(body->center_at(update->ntimestep) - ball.center) <= ball.radius + body->radius)
        visit_parts(*body, [&](int, const double *x, const double *) { flying.emplace_back(x); });
  stream_->let_enter(flying);
}

void FixFreeFlight::init() {
  const FixInput input(lmp, this);
  if (!dynamic_cast<VerletFreeFlight *>(update->integrate)) input.refuse("needs the run style that it sets");
  bonds_ = fix_that_is<BodyMaker>(modify);
  plate_ = fix_that_is<Obstacle>(modify);
  stream_ = fix_that_is<StoneStream>(modify);
  agglomerates_->init();
  looks_->init();
  refuse_what_free_flight_does_not_know(lmp, this, unheld_, weight_);
  history_ = nullptr;
  for (FixContactHistory *history : fixes_that_are<FixContactHistory>(modify))
    if (std::strcmp(history->style, "contacthistory") == 0) history_ = history;
  if (bonds_) bonds_->let_bodies_leave();
  held_->set_bonds(bonds_);
  if (plate_ && nevery % plate_->co_step() != 0) input.refuse("needs `every` in whole co-steps");
}

void FixFreeFlight::setup(int) {
  looks_->setup();
  next_reneighbor = -1;
}

void FixFreeFlight::end_of_step() {
  for (auto &b : bodies_) b->go_to(update->ntimestep);
  check_count();
  if (looks_->look()) next_reneighbor = update->ntimestep + 1;
}

void FixFreeFlight::final_integrate() {
  held_->push();
  if (looks_->watch_plate()) next_reneighbor = update->ntimestep + 1;
}

// Bodies in flight, which may be all of a type, are not in the arrays when a resumed run is set up. LIGGGHTS asks for
// the radii of each type then, so the fix notes them when it is made.
void FixFreeFlight::note_radii() {
  least_radius_.assign(atom->ntypes + 1, 0.0);
  greatest_radius_ = least_radius_;
  for (int i = 0; i < atom->nlocal; i++) {
    double &least = least_radius_[atom->type[i]], &greatest = greatest_radius_[atom->type[i]];
    least = least == 0 ? atom->radius[i] : std::min(least, atom->radius[i]);
    greatest = std::max(greatest, atom->radius[i]);
  }
}

int FixFreeFlight::min_type() {
  for (int type = 1; type <= atom->ntypes; type++)
    if (greatest_radius_[type] > 0) return type;
  return 0;
}

int FixFreeFlight::max_type() {
  int type = atom->ntypes;
  while (type > 0 && greatest_radius_[type] == 0) type--;
  return type;
}

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

// A body integrates its attitude from one call to the next. A copy is asked, so that the body goes on as if unseen.
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

// The fix counts by itself: `thermo_modify lost error` takes a run without a sub-sphere in the arrays for lost.
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

/* --- out of the arrays and back ------------------------------------------------------------------------------ */

void FixFreeFlight::change_arrays() {
  remove_leaving();
  auto wakes = [](const std::unique_ptr<FreeBody> &b) { return b->is_waking; };
  if (std::none_of(bodies_.begin(), bodies_.end(), wakes)) return;
  for (ActsInFreeFlight *fix : fixes_that_are<ActsInFreeFlight>(modify)) fix->came_back();
  for (auto &b : bodies_)
    if (b->is_waking) {
      b->go_to(update->ntimestep);
      put_in_arrays(*b, 0.5 * update->dt);
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

// Appends the sub-spheres of the body as they are at its present step, with the velocities of `half_step` seconds
// before: within a step, velocity Verlet has those of the half step. Returns how many sub-spheres it appended.
int FixFreeFlight::put_in_arrays(FreeBody &b, double half_step) {
  for (const FreeBody::Part &p : b.parts) {
    atom->avec->unpack_exchange(&b.packed[p.packed]);
    const int i = atom->nlocal - 1;
    const FreeBody::State s = b.state(p);
    s.x.to(atom->x[i]);
    (s.v - half_step * (s.acceleration + weight_)).to(atom->v[i]);
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
    shown_ += put_in_arrays(seen, 0);
  }
  atom->natoms += shown_;
}

void FixFreeFlight::hide() {
  atom->nlocal -= shown_;
  atom->natoms -= shown_;
  shown_ = 0;
}

void FixFreeFlight::bring_back() {
  for (FreeBody *b : bodies_in_flight()) atom->natoms += put_in_arrays(*b, 0);
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
  event = std::min(event, std::max(next_multiple(nevery), (safe - looks_->horizon()) / nevery * nevery));
  for (int k = 0; k < modify->nfix; k++) {
    Fix *fix = modify->fix[k];
    if (fix == this) continue;
    int every = modify->fmask[k] & END_OF_STEP ? fix->nevery : 0;
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

double FixFreeFlight::compute_vector(int n) { return n == 0 ? jumped_ : looks_->departures(); }

/* --- checkpoint: bodies that are away stay away -------------------------------------------------------------- */

// A body integrates its attitude from one call to the next, so a run that is resumed must call at the same steps.
void FixFreeFlight::begin_anew() {
  for (FreeBody *b : bodies_in_flight()) b->attitude();
}

void FixFreeFlight::save(CheckpointWriter &out) {
  std::vector<double> row;
  for (const auto &b : bodies_) b->append_to(row);
  out.common("free_flight", {static_cast<double>(bodies_.size()), static_cast<double>(jumped_)});
  looks_->save(out);
  out.rows("free_flight_bodies", row);
  held_->save(out);
}

void FixFreeFlight::restore(const CheckpointReader &in) {
  const std::vector<double> &numbers = in.common("free_flight", 2);
  jumped_ = static_cast<bigint>(numbers[1]);
  looks_->restore(in);
  bodies_.clear();
  held_->restore(in);
  const double *row = in.rows("free_flight_bodies", 1).data();
  for (int k = 0; k < static_cast<int>(numbers[0]); k++) {
    bodies_.push_back(std::make_unique<FreeBody>(row));
    bodies_.back()->go_to(update->ntimestep);
  }
  for (FreeBody *b : bodies_in_flight()) shown_ += put_in_arrays(*b, 0);  // until the end of the set-up
  atom->natoms += shown_;
}
