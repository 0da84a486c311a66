#include "fix_idle.h"

#include <algorithm>
#include <cstring>
#include <set>

#include "atom.h"
#include "atom_vec.h"
#include "checkpoint_file.h"
#include "comm.h"
#include "error.h"
#include "fix_bond_parallel.h"
#include "fix_contact_history.h"
#include "fix_ledger.h"
#include "fix_monitor.h"
#include "fix_wall_plate.h"
#include "force.h"
#include "modify.h"
#include "neigh_list.h"
#include "output.h"
#include "pair.h"
#include "update.h"
#include "verlet_idle.h"

using namespace LAMMPS_NS;
using namespace FixConst;

namespace {
const int CALM_LOOKS = 3;         // in a row, since an oscillation has instants without velocity
const int LEAST_REST = 4;         // looks: a body that may be touched sooner does not leave
// Loose pieces in the cracks of a body, of its own agglomerate, fly with it as if they were lodged: pieces below the
// first share of its mass, within the second share of their radius, when all of them have less than the third share of
// the energy of the impact relative to its motion, for so many looks that those on their way out are gone.
const double PIECE_MASS = 0.05, PIECE_GAP = 0.1, PIECES_ENERGY = 1e-3;
const int PIECES_LOOKS = 50;
const double REACH_MARGIN = 1.1;  // the reach may grow by this before all times are found anew
const double CLEARANCE_M = 1e-5;
const bigint FAR_AHEAD = 1000000000000000;
}  // namespace

class FixIdle::AwakeBody : public Outline {
 public:
  int label;  // least tag
  std::vector<int> atoms;
  double mass, inner_energy;
  Vec momentum, omega;  // angular, about the centre of mass
  Tensor inertia;
  bool is_lodged = false;          // in another one
  std::vector<AwakeBody *> lodged; // in this one

  AwakeBody(const Atom *atom, int label) : label(label), atom(atom) {}
  void measure();
  void take_lodged();
  double energy_over(const AwakeBody &) const;

 protected:
  void place(std::vector<Sphere> &spheres) override {
    for (int i : atoms) spheres.push_back({Vec(atom->x[i]), atom->radius[i]});
  }

 private:
  const Atom *atom;
  double own_inertia(int i) const { return 0.4 * atom->rmass[i] * atom->radius[i] * atom->radius[i]; }
};

FixIdle::FixIdle(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg) {
  std::string agglomerates;
  nevery = 0;
  for (int k = 3; k + 1 < narg; k += 2) {
    const std::string key = arg[k];
    if (key == "agglomerates") agglomerates = arg[k + 1];
    else if (key == "gravity") gravity_ = force->numeric(FLERR, arg[k + 1]);
    else if (key == "speed") speed_ = force->numeric(FLERR, arg[k + 1]);
    else if (key == "tolerance") tolerance_ = force->numeric(FLERR, arg[k + 1]);
    else if (key == "every") nevery = force->inumeric(FLERR, arg[k + 1]);
    else error->fix_error(FLERR, this, ("unknown keyword " + key).c_str());
  }
  if (agglomerates.empty() || speed_ <= 0 || tolerance_ <= 0 || nevery < 1)
    error->fix_error(FLERR, this, "needs agglomerates FILE [gravity G] speed V tolerance TOL every N");
  if (comm->nprocs > 1) error->fix_error(FLERR, this, "works on one rank only; `time.idle_tolerance = 0` leaves it out");
  if (!atom->tag_enable || !atom->map_style) error->fix_error(FLERR, this, "needs `atom_modify map array`");
  agglomerates_ = std::make_unique<Agglomerates>(lmp, agglomerates);
  calm_.assign(agglomerates_->tags() + 1, 0);
  force_reneighbor = 1;
  next_reneighbor = -1;
  scalar_flag = vector_flag = global_freq = 1;
  size_vector = 2;
  delete update->integrate;
  update->integrate = new VerletIdle(lmp);
}

FixIdle::~FixIdle() {}

int FixIdle::setmask() { return END_OF_STEP; }

void FixIdle::init() {
  if (!dynamic_cast<VerletIdle *>(update->integrate)) error->fix_error(FLERR, this, "needs the run style that it sets");
  bonds_ = nullptr, wall_ = nullptr, ledger_ = nullptr, history_ = nullptr;
  for (int k = 0; k < modify->nfix; k++) {
    Fix *fix = modify->fix[k];
    if (auto *bonds = dynamic_cast<FixBondParallel *>(fix)) bonds_ = bonds;
    if (auto *wall = dynamic_cast<FixWallPlate *>(fix)) wall_ = wall;
    if (auto *ledger = dynamic_cast<FixLedger *>(fix)) ledger_ = ledger;
    if (std::strcmp(fix->style, "contacthistory") == 0) history_ = dynamic_cast<FixContactHistory *>(fix);
  }
  if (bonds_) bonds_->let_bodies_leave();
  if (history_ && history_->get_dnum() != 3)
    error->fix_error(FLERR, this, "can turn the contact history of `tangential history` only");
  if (wall_ && nevery % wall_->co_step() != 0) error->fix_error(FLERR, this, "needs `every` in whole co-steps");
}

void FixIdle::setup(int) {
  law_ = std::make_unique<HertzLaw>(lmp);
  std::fill(calm_.begin(), calm_.end(), 0);
  if (wall_) std::copy(wall_->extent(), wall_->extent() + 4, plate_.extent);
  plate_.reach = -1;  // none known
  next_reneighbor = -1;
}

int FixIdle::body_of(int tag) const { return bonds_ ? bonds_->body_of_tag()[tag] : tag; }

/* --- what there is ------------------------------------------------------------------------------------------- */

std::vector<FixIdle::AwakeBody> FixIdle::find_awake() {
  std::vector<AwakeBody> bodies;
  std::vector<int> index(agglomerates_->tags() + 1, -1);
  for (int i = 0; i < atom->nlocal; i++) {
    const int label = body_of(atom->tag[i]);
    if (index[label] < 0) {
      index[label] = bodies.size();
      bodies.emplace_back(atom, label);
    }
    bodies[index[label]].atoms.push_back(i);
  }
  for (AwakeBody &b : bodies) b.measure();
  return bodies;
}

void FixIdle::AwakeBody::measure() {
  mass = inner_energy = radius = 0;
  center = velocity = momentum = Vec();
  inertia = Tensor();
  for (int i : atoms) {
    mass += atom->rmass[i];
    center += atom->rmass[i] * Vec(atom->x[i]);
    velocity += atom->rmass[i] * Vec(atom->v[i]);
  }
  center = (1 / mass) * center, velocity = (1 / mass) * velocity;
  for (int i : atoms) {
    const double m = atom->rmass[i];
    const Vec arm = Vec(atom->x[i]) - center;
    inertia.add_inertia(m, arm, own_inertia(i));
    momentum += m * cross(arm, Vec(atom->v[i]) - velocity) + own_inertia(i) * Vec(atom->omega[i]);
    radius = std::max(radius, norm(arm) + atom->radius[i]);
  }
  omega = inertia.inverse() * momentum;
  spin = norm(omega);
  inner_energy = energy_over(*this);
}

// Makes one body of this and what is lodged in it.
void FixIdle::AwakeBody::take_lodged() {
  for (const AwakeBody *p : lodged) atoms.insert(atoms.end(), p->atoms.begin(), p->atoms.end());
  std::sort(atoms.begin(), atoms.end());
  spheres_.clear();
  measure();
}

// Kinetic energy relative to the rigid motion of `host`.
double FixIdle::AwakeBody::energy_over(const AwakeBody &host) const {
  double energy = 0;
  for (int i : atoms) {
    const Vec v = Vec(atom->v[i]) - host.velocity - cross(host.omega, Vec(atom->x[i]) - host.center);
    const Vec w = Vec(atom->omega[i]) - host.omega;
    energy += 0.5 * (atom->rmass[i] * dot(v, v) + own_inertia(i) * dot(w, w));
  }
  return energy;
}

std::vector<IdleBody *> FixIdle::bodies() {
  std::vector<IdleBody *> all;
  for (auto &b : bodies_)
    if (!b->is_leaving) {
      b->go_to(update->ntimestep);
      all.push_back(b.get());
    }
  return all;
}

/* --- who leaves, who comes back ------------------------------------------------------------------------------ */

void FixIdle::end_of_step() {
  int count = atom->nlocal;
  for (auto &b : bodies_) {
    b->go_to(update->ntimestep);
    if (!b->is_leaving) count += b->parts.size();
  }
  // `thermo_modify lost error` cannot be asked, as it takes a run without a sub-sphere in the arrays for lost.
  if (count != agglomerates_->tags()) error->one(FLERR, "Sub-spheres were lost");
  std::vector<AwakeBody> awake = find_awake();
  update_reach();
  watch_idle(awake);
  retire_calm(awake);
  for (auto &b : bodies_)
    if (b->is_leaving || b->is_waking) next_reneighbor = update->ntimestep + 1;
}

// Times found so far hold as long as the plate keeps within the reach that they were found with.
void FixIdle::update_reach() {
  const double reach = wall_ ? wall_->reach() : 0;
  if (reach <= plate_.reach && plate_.reach <= 2 * REACH_MARGIN * (reach + CLEARANCE_M)) return;
  plate_.reach = REACH_MARGIN * (reach + CLEARANCE_M);
  for (auto &b : bodies_) b->safe_until = 0;
}

// Time before it could touch the plate or another idle body.
double FixIdle::free_time(IdleBody &body) {
  double time = wall_ ? time_to_plate(body, plate_, gravity_) : FAR_AHEAD;
  for (auto &other : bodies_)
    if (other.get() != &body && time > 0) time = std::min(time, time_to_meet(body, *other));
  return time;
}

void FixIdle::watch_idle(std::vector<AwakeBody> &awake) {
  const double dt = update->dt, horizon = (nevery + 2) * dt;
  bool asked = false;
  for (auto &b : bodies_) {
    if (b->safe_until < update->ntimestep + nevery + 2) {
      if (wall_ && wall_->is_quiet() && !asked && time_to_plate(*b, plate_, gravity_) < horizon) {
        wall_->ask_reach();
        update_reach();
        asked = true;
      }
      const double time = free_time(*b);
      b->is_waking = time < horizon;
      b->safe_until = update->ntimestep + static_cast<bigint>(std::min(time / dt, double(FAR_AHEAD)));
    }
    for (AwakeBody &other : awake)
      if (!b->is_waking) b->is_waking = time_to_meet(*b, other, speed_) < 1.5 * horizon;
  }
}

// Finds the loose pieces in the cracks of each body.
void FixIdle::find_lodged(std::vector<AwakeBody> &awake) {
  for (AwakeBody &host : awake) {
    if (host.atoms.size() < 1 / PIECE_MASS) continue;
    bool found = true;
    while (found) {
      found = false;
      for (AwakeBody &piece : awake) {
        if (piece.is_lodged || piece.mass > PIECE_MASS * host.mass) continue;
        if (agglomerates_->of_tag(piece.label) != agglomerates_->of_tag(host.label)) continue;
        if (norm(piece.center - host.center) > host.radius + 2 * piece.radius) continue;
        const double limit = PIECE_GAP * piece.spheres()[0].radius;
        bool near = gap(piece, host) < limit;
        for (AwakeBody *other : host.lodged) near = near || gap(piece, *other) < limit;
        if (!near) continue;
        piece.is_lodged = found = true;
        host.lodged.push_back(&piece);
      }
    }
  }
}

// Is its inner motion, and that of the pieces lodged in it, so small that it may leave?
bool FixIdle::is_calm(const AwakeBody &b) {
  const double impact = 0.5 * speed_ * speed_ * b.mass;
  double pieces = 0;
  for (const AwakeBody *p : b.lodged) pieces += p->energy_over(b);
  int &looks = calm_[b.label];
  looks = b.inner_energy <= tolerance_ * impact && pieces <= PIECES_ENERGY * impact ? looks + 1 : 0;
  return b.atoms.size() == 1 || looks >= (b.lodged.empty() ? CALM_LOOKS : PIECES_LOOKS);
}

void FixIdle::retire_calm(std::vector<AwakeBody> &awake) {
  const double rest = LEAST_REST * nevery * update->dt;
  find_lodged(awake);
  std::vector<AwakeBody *> all;
  std::vector<char> leaves;
  for (AwakeBody &b : awake) {
    if (b.is_lodged) continue;
    const bool calm = is_calm(b);
    if (calm && !b.lodged.empty()) b.take_lodged();
    all.push_back(&b);
    leaves.push_back(calm && (!wall_ || time_to_plate(b, plate_, gravity_) > rest));
    for (auto &other : bodies_)
      leaves.back() = leaves.back() && time_to_meet(b, *other, other->is_waking ? speed_ : 0) > rest;
    if (!calm)
      for (AwakeBody *p : b.lodged) all.push_back(p), leaves.push_back(false);
  }
  // Of those left, who meets one that stays, or meets another too soon, stays as well.
  for (bool changed = true; changed;) {
    changed = false;
    for (size_t k = 0; k < all.size(); k++)
      for (size_t l = 0; l < all.size() && leaves[k]; l++)
        if (l != k && (leaves[l] ? time_to_meet(*all[k], *all[l]) : time_to_meet(*all[k], *all[l], speed_)) <= rest)
          leaves[k] = false, changed = true;
  }
  for (size_t k = 0; k < all.size(); k++)
    if (leaves[k]) retire(*all[k]);
  if (std::count(leaves.begin(), leaves.end(), 1)) note_elastic_energies();
}

void FixIdle::retire(AwakeBody &b) {
  bodies_.push_back(std::make_unique<IdleBody>());
  IdleBody &idle = *bodies_.back();
  const Vec down(0, 0, -gravity_);
  idle.start = update->ntimestep;
  idle.dt = update->dt;
  idle.agglomerate = agglomerates_->of_tag(b.label);
  idle.mass = b.mass;
  idle.radius = b.radius;
  idle.motion = RigidMotion(b.center, b.velocity, down, b.momentum, b.inertia, b.atoms.size() == 1);
  idle.spin = idle.motion.fastest_spin();
  idle.kinetic_start =
      0.5 * b.mass * dot(b.velocity, b.velocity) + idle.motion.rotational_energy() + b.inner_energy;
  for (int i : b.atoms) {
    const double m = atom->rmass[i], r = atom->radius[i];
    const Vec arm = Vec(atom->x[i]) - b.center;
    idle.parts.push_back({atom->tag[i], r, m, arm, Vec(atom->v[i]) - b.velocity - cross(b.omega, arm),
                          Vec(atom->omega[i]) - b.omega, (1 / m) * Vec(atom->f[i]) - down,
                          (1 / (0.4 * m * r * r)) * Vec(atom->torque[i]), 0});
    if (bonds_) bonds_->forget_forces(i);
  }
  idle.go_to(update->ntimestep);
  calm_[b.label] = 0;
  departures_++;
}

// What the bodies that leave hold in their bonds, and in contacts between their own sub-spheres.
void FixIdle::note_elastic_energies() {
  if (std::none_of(bodies_.begin(), bodies_.end(), [](auto &b) { return b->is_leaving && b->parts.size() > 1; })) return;
  std::vector<double> bond(calm_.size(), 0.0), pair(calm_.size(), 0.0);
  if (bonds_) bonds_->add_elastic_energy_by_body(bond.data());
  const NeighList *list = force->pair->list;
  for (int k = 0; k < list->inum; k++) {
    const int i = list->ilist[k];
    for (int m = 0; m < list->numneigh[i]; m++) {
      const int j = list->firstneigh[i][m] & NEIGHMASK;
      const double sum = atom->radius[i] + atom->radius[j], overlap = sum - norm(Vec(atom->x[i]) - Vec(atom->x[j]));
      if (overlap > 0)
        pair[body_of(atom->tag[i])] +=
            law_->elastic_energy(atom->type[i], atom->type[j], atom->radius[i] * atom->radius[j] / sum, overlap);
    }
  }
  for (auto &b : bodies_) {
    if (!b->is_leaving) continue;
    std::set<int> labels;
    for (const IdleBody::Part &p : b->parts) labels.insert(body_of(p.tag));
    for (int label : labels) b->bond_elastic += bond[label], b->pair_elastic += pair[label];
  }
}

/* --- out of the arrays and back ------------------------------------------------------------------------------ */

void FixIdle::change_arrays() {
  remove_leaving();
  auto wakes = [](const std::unique_ptr<IdleBody> &b) { return b->is_waking; };
  for (auto &b : bodies_)
    if (b->is_waking) {
      b->go_to(update->ntimestep);
      insert(*b, 0.5 * update->dt);
    }
  bodies_.erase(std::remove_if(bodies_.begin(), bodies_.end(), wakes), bodies_.end());
}

void FixIdle::remove_leaving() {
  std::vector<char> gone(atom->nlocal, 0);
  std::vector<double> record(4096 + comm->maxexchange_fix);
  for (auto &b : bodies_) {
    if (!b->is_leaving) continue;
    b->is_leaving = false;
    for (IdleBody::Part &p : b->parts) {
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
int FixIdle::insert(IdleBody &b, double half_step) {
  const Vec down(0, 0, -gravity_);
  for (const IdleBody::Part &p : b.parts) {
    atom->avec->unpack_exchange(&b.packed[p.packed]);
    const int i = atom->nlocal - 1;
    const IdleBody::State s = b.state(p);
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

void FixIdle::show() {
  const bigint now = update->ntimestep;
  if (output->next_dump_any != now && !output->restart_requested(now)) return;
  for (IdleBody *b : bodies()) shown_ += insert(*b, 0);
  atom->natoms += shown_;
}

void FixIdle::hide() {
  atom->nlocal -= shown_;
  atom->natoms -= shown_;
  shown_ = 0;
}

void FixIdle::bring_back() {
  for (IdleBody *b : bodies()) atom->natoms += insert(*b, 0);
  bodies_.clear();
}

/* --- time jumps ---------------------------------------------------------------------------------------------- */

void FixIdle::jump() {
  if (atom->nlocal > 0 || bodies_.empty() || (wall_ && !wall_->is_quiet())) return;
  const bigint now = update->ntimestep;
  auto next_multiple = [&](int every) { return (now / every + 1) * every; };
  bigint event = std::min(update->laststep, output->next);
  bigint safe = FAR_AHEAD;
  for (auto &b : bodies_) {
    if (b->is_waking) return;
    safe = std::min(safe, b->safe_until);
  }
  event = std::min(event, std::max(next_multiple(nevery), safe / nevery * nevery));
  if (ledger_) event = std::min(event, next_multiple(ledger_->every()));
  for (int k = 0; k < modify->nfix; k++)
    if ((modify->fmask[k] & END_OF_STEP) && modify->fix[k]->nevery > 1 && modify->fix[k] != this &&
        !dynamic_cast<FixMonitor *>(modify->fix[k]))  // which has nothing to see while nothing is there
      event = std::min(event, next_multiple(modify->fix[k]->nevery));
  const int unit = wall_ ? wall_->co_step() : 1;
  const bigint co_steps = (event - 1 - now) / unit;
  if (co_steps < 1) return;
  update->ntimestep += co_steps * unit;
  jumped_ += co_steps * unit;
  if (wall_) wall_->skip(co_steps);
}

double FixIdle::compute_scalar() {
  double count = 0;
  for (IdleBody *b : bodies()) count += b->parts.size();
  return count;
}

double FixIdle::compute_vector(int n) { return n == 0 ? jumped_ : departures_; }

/* --- checkpoint: bodies that are away stay away --------------------------------------------------------------- */

// Attitudes are integrated from one asking to the next.
void FixIdle::begin_anew() {
  for (IdleBody *b : bodies()) b->attitude();
}

void FixIdle::save(CheckpointWriter &out) {
  std::vector<double> row;
  for (const auto &b : bodies_) b->append_to(row);
  out.common("idle", {static_cast<double>(bodies_.size()), plate_.reach, static_cast<double>(jumped_),
                      static_cast<double>(departures_)});
  out.common("idle_calm", std::vector<double>(calm_.begin(), calm_.end()));
  out.rows("idle_bodies", row);
}

void FixIdle::restore(const CheckpointReader &in) {
  const std::vector<double> &numbers = in.common("idle", 4), &calm = in.common("idle_calm", calm_.size());
  plate_.reach = numbers[1];
  jumped_ = static_cast<bigint>(numbers[2]);
  departures_ = static_cast<bigint>(numbers[3]);
  std::copy(calm.begin(), calm.end(), calm_.begin());
  bodies_.clear();
  const double *row = in.rows("idle_bodies", 1).data();
  for (int k = 0; k < static_cast<int>(numbers[0]); k++) {
    bodies_.push_back(std::make_unique<IdleBody>(row));
    bodies_.back()->go_to(update->ntimestep);
  }
  for (IdleBody *b : bodies()) shown_ += insert(*b, 0);  // until the end of the set-up
  atom->natoms += shown_;
}
