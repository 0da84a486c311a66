#include "stones/fix_stones.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "atom.h"
#include "atom_vec.h"
#include "interfaces/checkpoint_file.h"
#include "comm.h"
#include "error.h"
#include "base/fix_input.h"
#include "base/fixes.h"
#include "base/weight.h"
#include "update.h"

using namespace LAMMPS_NS;

namespace {
const bigint NEVER = 1000000000000000;  // steps
const size_t GONE_COLUMNS = 8;
const int TRY_STEPS = 64;  // between two tries of a stone where something is in the way
}  // namespace

FixStones::FixStones(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg) {
  std::string file, agglomerates, left;
  double gravity = 0;
  Vec down(0, 0, -1);
  FixInput(lmp, this)
      .text("file", file)
      .text("agglomerates", agglomerates)
      .text("left", left)
      .number("gravity", gravity, Allowed::FROM_0)
      .direction("down", down)
      .read(arg, 3, narg, {"file", "agglomerates", "left"});
  const FixInput input(lmp, this);
  if (comm->nprocs > 1) input.refuse("works on one rank only, as bodies in free flight do");
  if (atom->nlocal > 0) input.refuse("needs a `read_data` without sub-spheres");
  up_ = -1 * down;
  weight_ = -gravity * up_;
  agglomerates_ = std::make_unique<Agglomerates>(lmp, this, agglomerates);
  file_ = std::make_unique<StoneFile>(lmp, file);
  bool are_the_same = file_->count() == agglomerates_->count();
  for (int a = 0; are_the_same && a < file_->count(); a++) are_the_same = file_->size(a) == agglomerates_->size(a);
  if (!are_the_same) input.refuse(file + " and " + agglomerates + " are of different stones");
  for (int type = 1; type <= file_->types(); type++) range_ = std::max(range_, 2 * file_->greatest_radius(type));
  gone_.resize(file_->count());
  order_.resize(file_->count());
  std::iota(order_.begin(), order_.end(), 0);
  std::stable_sort(order_.begin(), order_.end(), [&](int a, int b) { return file_->entry(a) < file_->entry(b); });
  force_reneighbor = 1;
  scalar_flag = global_freq = 1;
  left_ = std::fopen(left.c_str(), "a");
  if (!left_) error->one(FLERR, ("cannot write " + left).c_str());
  if (std::ftell(left_) == 0)
    std::fputs("step,agglomerate,subspheres,mass_kg,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,kinetic_J,elastic_J\n", left_);
  make_room_for_tags();
  tries_ = find_due();
  enter_waiting(0, {});
}

FixStones::~FixStones() {
  if (left_) std::fclose(left_);
}

int FixStones::setmask() { return 0; }

// LIGGGHTS makes its map for the largest tag that there is, and its list of equal tags, which it clears before it makes
// it larger, for as many sub-spheres as there are with ghosts.
void FixStones::make_room_for_tags() {
  double origin[3] = {0, 0, 0};
  atom->avec->create_atom(1, origin);
  atom->tag[atom->nlocal - 1] = agglomerates_->tags();
  atom->nghost = agglomerates_->tags();
  atom->map_init();
  atom->nghost = 0;
  atom->nlocal--;
}

void FixStones::init() {
  agglomerates_->init();
  const FixInput input(lmp, this);
  if (!fix_that_is<FlightControl>(modify)) input.refuse("needs fix free_flight");
  refuse_other_weight(input, modify, weight_);
}

/* --- stones enter -------------------------------------------------------------------------------------------- */

// The step of the next stone, or one at which those that wait are tried again.
bigint FixStones::next_entry() const {
  const bigint entry = due_ < order_.size() ? file_->entry(order_[due_]) : NEVER;
  return waiting_.empty() ? entry : std::min(entry, (update->ntimestep / TRY_STEPS + 1) * TRY_STEPS);
}

std::vector<StoneStream::Ball> FixStones::wanted() {
  forget();
  tries_ = find_due();
  std::vector<Ball> balls;
  for (const EnteringStone &stone : waiting_)
    if (tries_) balls.push_back(ball_of(stone));
  return balls;
}

void FixStones::let_enter(const std::vector<Vec> &flying) { enter_waiting(0.5 * update->dt, flying); }

// Those that are due wait from now on. Is this a step at which those that wait try?
bool FixStones::find_due() {
  bool tries = update->ntimestep % TRY_STEPS == 0;
  for (; due_ < order_.size() && file_->entry(order_[due_]) <= update->ntimestep; due_++, tries = true)
    waiting_.push_back(file_->read(order_[due_]));
  return tries;
}

// Each by itself, in the order of their steps.
void FixStones::enter_waiting(double half_step, const std::vector<Vec> &flying) {
  std::vector<EnteringStone> left;
  for (EnteringStone &stone : waiting_)
    if (tries_ && is_free(stone, flying)) enter(stone, half_step);
    else left.push_back(std::move(stone));
  waiting_ = std::move(left);
  next_reneighbor = next_entry() < NEVER ? next_entry() : -1;
}

StoneStream::Ball FixStones::ball_of(const EnteringStone &stone) const {
  const int count = stone.count();
  Ball ball{Vec(), 0};
  for (int k = 0; k < count; k++) ball.center += 1.0 / count * stone.place(k);
  for (int k = 0; k < count; k++) ball.radius = std::max(ball.radius, norm(stone.place(k) - ball.center) + range_);
  return ball;
}

bool FixStones::is_free(const EnteringStone &stone, const std::vector<Vec> &flying) const {
  const Ball ball = ball_of(stone);
  auto is_in_the_way = [&](const Vec &x) {
    if (norm(x - ball.center) > ball.radius) return false;
    for (int k = 0; k < stone.count(); k++)
      if (norm(x - stone.place(k)) <= range_) return true;
    return false;
  };
  for (int i = 0; i < atom->nlocal; i++)
    if (is_in_the_way(Vec(atom->x[i]))) return false;
  return std::none_of(flying.begin(), flying.end(), is_in_the_way);
}

// Velocities are taken `half_step` seconds earlier, as they are within a step.
void FixStones::enter(const EnteringStone &stone, double half_step) {
  for (StoneKeeper *keeper : fixes_that_are<StoneKeeper>(modify)) keeper->enter(stone);
  for (int k = 0; k < stone.count(); k++) add_atom(stone, k, half_step);
  near_.insert(std::lower_bound(near_.begin(), near_.end(), stone.agglomerate), stone.agglomerate);
  tags_near_ += stone.count();
  gone_[stone.agglomerate].waited_steps = static_cast<double>(update->ntimestep - file_->entry(stone.agglomerate));
}

void FixStones::add_atom(const EnteringStone &stone, int k, double half_step) {
  const double *row = &stone.atoms[k * EnteringStone::ATOM_COLUMNS];
  double place[3] = {row[3], row[4], row[5]};
  atom->avec->create_atom(static_cast<int>(row[0]), place);
  atom->natoms++;
  const int i = atom->nlocal - 1;
  atom->tag[i] = stone.first_tag + k;
  atom->radius[i] = 0.5 * row[1];
  atom->density[i] = row[2];
  atom->rmass[i] = 4.0 * M_PI / 3.0 * atom->radius[i] * atom->radius[i] * atom->radius[i] * row[2];
  const Vec v(row + 6);
  (v - half_step * weight_).to(atom->v[i]);
  stone.spin.to(atom->omega[i]);
  std::fill_n(atom->f[i], 3, 0.0);
  std::fill_n(atom->torque[i], 3, 0.0);
  for (int n = 0; n < modify->nfix; n++) {
    if (!modify->fix[n]->create_attribute) continue;
    modify->fix[n]->pre_set_arrays();
    modify->fix[n]->set_arrays(i);
  }
  atom->map_one(atom->tag[i], i);
  const double m = atom->rmass[i];
  entered_kinetic_ += 0.5 * m * dot(v, v) + 0.2 * m * atom->radius[i] * atom->radius[i] * dot(stone.spin, stone.spin);
  entered_mass_height_ += m * dot(up_, Vec(place));
}

/* --- and go -------------------------------------------------------------------------------------------------- */

void FixStones::take_out(const LeftBody &b) {
  Gone &gone = gone_[b.agglomerate];
  gone.tags += b.count;
  gone.kinetic += b.kinetic;
  gone.momentum_z += b.mass * b.velocity.z;
  gone.mass_height += b.mass * dot(up_, b.center);
  gone.bond_elastic += b.bond_elastic, gone.pair_elastic += b.pair_elastic;
  tags_near_ -= b.count;
  const int written = std::fprintf(left_, BIGINT_FORMAT ",%d,%d,%.17g,%.9g,%.9g,%.9g,%.17g,%.17g,%.17g,%.17g,%.17g\n",
                                   update->ntimestep, b.agglomerate + 1, b.count, b.mass, b.center.x, b.center.y,
                                   b.center.z, b.velocity.x, b.velocity.y, b.velocity.z, b.kinetic,
                                   b.bond_elastic + b.pair_elastic);
  if (written < 0) error->one(FLERR, "cannot write what has left");
}

void FixStones::add_to(LedgerRows &rows) {
  for (const int a : near_) {
    const Gone &gone = gone_[a];
    rows.at(a, KINETIC) += gone.kinetic;
    rows.at(a, MOMENTUM_Z) += gone.momentum_z;
    rows.at(a, MASS_HEIGHT) += gone.mass_height;
    rows.at(a, BOND_ELASTIC) += gone.bond_elastic;
    rows.at(a, PAIR_ELASTIC) += gone.pair_elastic;
    rows.at(a, WAITED_STEPS) += gone.waited_steps;
  }
}

std::vector<int> FixStones::close_finished() {
  auto is_there = [&](int a) { return gone_[a].tags < agglomerates_->size(a); };
  const auto first_gone = std::stable_partition(near_.begin(), near_.end(), is_there);
  const std::vector<int> closed(first_gone, near_.end());
  near_.erase(first_gone, near_.end());
  to_forget_.insert(to_forget_.end(), closed.begin(), closed.end());
  return closed;
}

// Lists that point to what is forgotten here are made anew next.
void FixStones::forget() {
  for (const int a : to_forget_)
    for (StoneKeeper *keeper : fixes_that_are<StoneKeeper>(modify)) keeper->leave(a);
  to_forget_.clear();
}

void FixStones::post_run() {
  if (std::fflush(left_) != 0) error->one(FLERR, "cannot write what has left");
}

/* --- checkpoint ---------------------------------------------------------------------------------------------- */

void FixStones::save(CheckpointWriter &out) {
  post_run();
  std::vector<double> rows;
  for (const int a : near_) {
    const Gone &g = gone_[a];
    rows.insert(rows.end(), {a + 0.0, g.tags + 0.0, g.kinetic, g.momentum_z, g.mass_height, g.bond_elastic,
                             g.pair_elastic, g.waited_steps});
  }
  out.common("stones", {due_ + 0.0, entered_kinetic_, entered_mass_height_});
  out.rows("stones_near", rows);
  std::vector<double> waiting;
  for (const EnteringStone &stone : waiting_) waiting.push_back(stone.agglomerate);
  out.rows("stones_waiting", waiting);
}

// Before the set-up, so that the sub-spheres are there. Where they are, fixes checkpoint and free_flight know.
void FixStones::take_up(const CheckpointReader &in) {
  const std::vector<double> &numbers = in.common("stones", 3), &rows = in.rows("stones_near", GONE_COLUMNS);
  const std::vector<int> before = near_;
  to_forget_ = before;
  forget();
  near_.clear();
  atom->natoms -= atom->nlocal;
  atom->map_clear();
  atom->nlocal = tags_near_ = 0;
  for (size_t k = 0; k < rows.size(); k += GONE_COLUMNS) {
    const double *row = &rows[k];
    const int a = static_cast<int>(row[0]);
    enter(file_->read(a), 0);
    gone_[a] = {static_cast<int>(row[1]), row[2], row[3], row[4], row[5], row[6], row[7]};
    tags_near_ -= gone_[a].tags;
  }
  due_ = static_cast<size_t>(numbers[0]);
  entered_kinetic_ = numbers[1], entered_mass_height_ = numbers[2];
  waiting_.clear();
  for (const double a : in.rows("stones_waiting", 1)) waiting_.push_back(file_->read(static_cast<int>(a)));
  next_reneighbor = next_entry() < NEVER ? next_entry() : -1;
}
