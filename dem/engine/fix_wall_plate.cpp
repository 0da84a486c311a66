#include "fix_wall_plate.h"

#include <mpi.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "atom.h"
#include "checkpoint_file.h"
#include "comm.h"
#include "error.h"
#include "fix_property_atom.h"
#include "force.h"
#include "memory.h"
#include "neighbor.h"
#include "primitive_wall.h"
#include "update.h"

using namespace LAMMPS_NS;
using namespace FixConst;

namespace {

const double SHAPE_TOLERANCE_M = 2e-6;  // a mode shape is taken anew when its sub-sphere moved this far in the plane
const double AWAY_M = 1.0;              // lifts a sub-sphere that is not above the plate out of reach of the wall

int position_of_contact(int narg, char **arg) {
  for (int k = 3; k < narg; k++)
    if (std::strcmp(arg[k], "contact") == 0) return k;
  return narg;
}

// The base class sees `fix ID group wall/gran` and what follows `contact`.
std::vector<char *> &base_arguments(int narg, char **arg) {
  static char style[] = "wall/gran";
  static std::vector<char *> base;
  base.assign({arg[0], arg[1], style});
  base.insert(base.end(), arg + std::min(narg, position_of_contact(narg, arg) + 1), arg + narg);
  return base;
}

}  // namespace

FixWallPlate::FixWallPlate(LAMMPS *lmp, int narg, char **arg)
    : FixWallGran(lmp, base_arguments(narg, arg).size(), base_arguments(narg, arg).data()) {
  std::string agglomerates, forces, shapes, to_plate, from_plate, contacts;
  bool has_extent = false;
  const int end = position_of_contact(narg, arg);
  for (int k = 3; k < end;) {
    const std::string key = arg[k++];
    const int needed = key == "extent" || key == "light" ? 4 : 1;
    if (k + needed > end) error->fix_error(FLERR, this, "a keyword lacks its value");
    if (key == "agglomerates") agglomerates = arg[k];
    else if (key == "forces") forces = arg[k];
    else if (key == "shapes") shapes = arg[k];
    else if (key == "to_plate") to_plate = arg[k];
    else if (key == "from_plate") from_plate = arg[k];
    else if (key == "contacts") contacts = arg[k];
    else if (key == "every") contacts_every_ = force->inumeric(FLERR, arg[k]);
    else if (key == "yield_pressure")
      plastic_law_ = std::make_unique<PlasticLaw>(force->numeric(FLERR, arg[k]));
    else if (key == "co_step") co_step_ = force->inumeric(FLERR, arg[k]);
    else if (key == "light") {
      light_force_ = force->numeric(FLERR, arg[k]);
      light_speed_ = force->numeric(FLERR, arg[k + 1]);
      light_co_steps_ = force->inumeric(FLERR, arg[k + 2]);
      most_co_steps_ = force->inumeric(FLERR, arg[k + 3]);
    }
    else if (key == "extent") {
      for (int e = 0; e < 4; e++) extent_[e] = force->numeric(FLERR, arg[k + e]);
      has_extent = true;
    } else error->fix_error(FLERR, this, ("unknown keyword " + key).c_str());
    k += needed;
  }
  if (agglomerates.empty() || forces.empty() || !has_extent || co_step_ < 1 || light_co_steps_ < 1 || most_co_steps_ < 1)
    error->fix_error(FLERR, this, "needs agglomerates, forces, extent and numbers of co-steps of at least 1");
  if (shapes.empty() != to_plate.empty() || shapes.empty() != from_plate.empty())
    error->fix_error(FLERR, this, "shapes, to_plate and from_plate go together");

  agglomerates_ = std::make_unique<Agglomerates>(lmp, agglomerates);
  impulse_.assign(agglomerates_->count(), 0);
  work_on_stone_ = work_on_plate_ = damped_ = plastic_ = deepest_ = impulse_;
  if (!shapes.empty()) {
    shapes_ = std::make_unique<PlateShapes>(lmp, shapes);
    modal_impulse_.assign(shapes_->modes(), 0);
    link_ = std::make_unique<PlateLink>(lmp, to_plate, from_plate, shapes_->modes());
  }
  nevery = 1;
  if (comm->me == 0) {
    forces_ = std::fopen(forces.c_str(), "ab");
    if (!forces_) error->one(FLERR, ("cannot write " + forces).c_str());
    if (!contacts.empty() && !(contacts_ = std::fopen(contacts.c_str(), "ab")))
      error->one(FLERR, ("cannot write " + contacts).c_str());
  }
  has_contacts_ = !contacts.empty();
  if (plastic_law_) {
    create_attribute = 1;
    comm->maxexchange_fix += DENT;
    grow_arrays(atom->nmax);
    atom->add_callback(0);
    for (int i = 0; i < atom->nlocal; i++) set_arrays(i);
  }
}

FixWallPlate::~FixWallPlate() {
  if (forces_) std::fclose(forces_);
  if (contacts_) std::fclose(contacts_);
  if (!plastic_law_) return;
  atom->delete_callback(id, 0);
  memory->destroy(dent_);
}

int FixWallPlate::setmask() { return FixWallGran::setmask() | POST_INTEGRATE | END_OF_STEP; }

void FixWallPlate::setup(int vflag) {
  law_ = std::make_unique<HertzLaw>(lmp);
  step_in_co_step_ = 0;
  ahead_ = 1;
  rebuildPrimitiveNeighlist_ = true;
  if (resuming) return;
  pre_force(vflag);
  end_co_step(true);
  // The step that ends here was counted by the run before, or never was.
  const std::vector<double> on_stone = work_on_stone_, on_plate = work_on_plate_;
  post_force(vflag);
  work_on_stone_ = on_stone;
  work_on_plate_ = on_plate;
}

// The list that the stock wall goes through: everything that the plate could reach before the next build.
void FixWallPlate::pre_force(int) {
  if (!rebuildPrimitiveNeighlist_) return;
  rebuildPrimitiveNeighlist_ = false;
  list_near();
}

void FixWallPlate::list_near() {
  listed_reach_ = link_ ? std::max(1e-3, 2 * link_->reach) : 0;
  primitiveWall_->buildNeighList(neighbor->skin + listed_reach_, atom->x, atom->radius, atom->nlocal);
  int *list;
  const int n = primitiveWall_->getNeighbors(list);
  std::vector<Near> before;
  before.swap(near_);
  near_.resize(n);
  near_shape_.resize(shapes_ ? static_cast<size_t>(n) * shapes_->modes() : 0);
  for (int k = 0; k < n; k++) near_[k].i = list[k];
  // Inside a co-step the plate's place must be known at once for what was not listed before.
  if (link_ && following_)
    for (size_t k = 0; k < near_.size(); k++) update_shape(k);
}

// Mode shape at the place of a near sub-sphere, and the plate there at both ends of the co-step.
void FixWallPlate::update_shape(size_t k) {
  Near &p = near_[k];
  const double *x = atom->x[p.i];
  const double reach = link_->reach + 2 * std::fabs(atom->v[p.i][2]) * interval();
  p.active = x[2] - atom->radius[p.i] < reach + 1e-6;
  if (!p.active) {
    p.w0 = p.w1 = p.rate0 = p.rate1 = 0;
    return;
  }
  const int modes = shapes_->modes();
  double *shape = &near_shape_[k * modes];
  if (!p.has_shape || std::hypot(x[0] - p.x, x[1] - p.y) > SHAPE_TOLERANCE_M) {
    shapes_->at(x[0], x[1], shape);
    p.x = x[0], p.y = x[1], p.has_shape = true;
  }
  p.w0 = p.w1 = p.rate0 = p.rate1 = 0;
  for (int m = 0; m < modes; m++) {
    p.w0 += shape[m] * amplitude0_[m];
    p.rate0 += shape[m] * rate0_[m];
    p.w1 += shape[m] * link_->amplitude[m];
    p.rate1 += shape[m] * link_->rate[m];
  }
}

double FixWallPlate::interval() const { return ahead_ * co_step_ * update->dt; }

// The plate at each near sub-sphere: the cubic that has the places and rates of both ends of the time between exchanges.
void FixWallPlate::place_plate() {
  const double T = interval();
  const double s = static_cast<double>(co_steps_passed_ * co_step_ + step_in_co_step_) / (ahead_ * co_step_);
  for (Near &p : near_) {
    if (!p.active || !following_) {
      p.w = p.rate = 0;
      continue;
    }
    const double rise = p.w1 - p.w0, a = T * p.rate0 - rise, b = rise - T * p.rate1;
    p.w = p.w0 + s * rise + s * (1 - s) * ((1 - s) * a + s * b);
    p.rate = (rise + (1 - 2 * s) * ((1 - s) * a + s * b) + s * (1 - s) * (b - a)) / T;
  }
}

void FixWallPlate::post_force(int vflag) {
  double **x = atom->x, **v = atom->v, **f = atom->f, **torque = atom->torque;
  const double dt = update->dt;
  if (link_) place_plate();

  std::vector<double> &keep = kept_z_;
  keep.resize(near_.size());
  for (size_t k = 0; k < near_.size(); k++) {
    Near &p = near_[k];
    const int i = p.i;
    keep[k] = x[i][2];
    const bool above = x[i][0] >= extent_[0] && x[i][0] <= extent_[1] && x[i][1] >= extent_[2] && x[i][1] <= extent_[3];
    x[i][2] += above ? -p.w : AWAY_M;
    p.overlap = p.depth = atom->radius[i] - x[i][2];
    if (plastic_law_) {
      p.overlap = press(i, p.depth);
      if (p.overlap != p.depth) x[i][2] = atom->radius[i] - p.overlap;
    }
    p.touched = p.overlap > 0;
    v[i][2] -= p.rate;
    for (int d = 0; d < 3; d++) p.force[d] = f[i][d], p.torque[d] = torque[i][d];
  }
  FixWallGran::post_force(vflag);
  for (size_t k = 0; k < near_.size(); k++) {
    Near &p = near_[k];
    const int i = p.i;
    x[i][2] = keep[k];
    v[i][2] += p.rate;
    if (!p.touched) continue;
    double power = 0;
    for (int d = 0; d < 3; d++) {
      p.force[d] = f[i][d] - p.force[d], p.torque[d] = torque[i][d] - p.torque[d];
      power += p.force[d] * v[i][d] + p.torque[d] * atom->omega[i][d];
    }
    const int a = agglomerates_->of_tag(atom->tag[i]);
    work_on_stone_[a] += 0.5 * dt * power;
    work_on_plate_[a] -= dt * p.force[2] * p.rate;
    deepest_[a] = std::max(deepest_[a], p.depth / atom->radius[i]);
  }

  // The mean over a co-step is the trapezoidal one, which is the impulse that the integrator gives to the stones.
  const bool at_end = step_in_co_step_ == co_step_;
  add_forces(at_end || step_in_co_step_ == 0 ? 0.5 : 1.0);
  if (at_end) {
    end_co_step(false);
    add_forces(0.5);
  }
}

void FixWallPlate::post_integrate() {
  const double half_dt = 0.5 * update->dt;
  for (const Near &p : near_) {
    if (!p.touched) continue;
    double power = 0;
    for (int d = 0; d < 3; d++) power += p.force[d] * atom->v[p.i][d] + p.torque[d] * atom->omega[p.i][d];
    work_on_stone_[agglomerates_->of_tag(atom->tag[p.i])] += half_dt * power;
  }
  step_in_co_step_++;
}

void FixWallPlate::end_of_step() {
  const double dt = update->dt;
  for (const Near &p : near_) {
    if (!p.touched) continue;
    const int i = p.i;
    const double mass = atom->rmass[i], v = atom->v[i][2] - p.rate, v_before = v - 0.5 * dt * atom->f[i][2] / mass;
    damped_[agglomerates_->of_tag(atom->tag[i])] +=
        dt * law_->damping_power(atom->type[i], atom_type_wall_, atom->radius[i], p.overlap, mass, v_before, v);
  }
  if (has_contacts_ && update->ntimestep % contacts_every_ == 0) record_contacts();
}

// Presses sub-sphere i so deep into a plate that may yield; returns the overlap at which Hertz' force is the same.
double FixWallPlate::press(int i, double depth) {
  const double E = modulus(i), R = atom->radius[i], *x = atom->x[i];
  double &largest = dent_[i][0], &x0 = dent_[i][1], &y0 = dent_[i][2];
  if (largest <= plastic_law_->yield_overlap(E, R)) {
    if (depth <= plastic_law_->yield_overlap(E, R)) return depth;
  } else if (depth <= 0) {
    const PlasticLaw::Dent d = plastic_law_->dent(E, R, largest);
    if (std::hypot(x[0] - x0, x[1] - y0) > std::sqrt(d.radius * (largest - d.depth))) largest = 0;
    return depth;
  }
  if (depth > largest) {
    plastic_[agglomerates_->of_tag(atom->tag[i])] +=
        plastic_law_->taken(E, R, depth) - plastic_law_->taken(E, R, largest);
    largest = depth;
  }
  const double force = plastic_law_->force(E, R, depth, largest);
  if (force > 0) x0 = x[0], y0 = x[1];
  // In its dent but not pressed: just clear of the stock wall.
  return force > 0 ? PlasticLaw::hertz_overlap(E, R, force) : std::min(depth, -1e-6 * R);
}

void FixWallPlate::add_forces(double weight) {
  const double share = weight / co_step_;
  const int modes = shapes_ ? shapes_->modes() : 0;
  for (size_t k = 0; k < near_.size(); k++) {
    const Near &p = near_[k];
    if (!p.touched) continue;
    impulse_[agglomerates_->of_tag(atom->tag[p.i])] += share * p.force[2];
    const double *shape = near_shape_.data() + k * modes;
    for (int m = 0; m < modes; m++) modal_impulse_[m] -= share * p.force[2] * shape[m];
  }
}

void FixWallPlate::end_co_step(bool first) {
  if (!first) {
    record_forces();
    co_steps_passed_++;
  }
  step_in_co_step_ = 0;
  if (!link_ || (!first && following_ && co_steps_passed_ < ahead_)) return;
  if (first || following_ || anything_near()) follow_plate();
}

bool FixWallPlate::anything_near() const {
  int mine = 0, any = 0;
  const double T = interval();
  for (const Near &p : near_) {
    const double clearance = atom->x[p.i][2] - atom->radius[p.i];
    mine |= clearance < link_->reach + 2 * T * std::fabs(atom->v[p.i][2]) + 1e-6;
  }
  MPI_Allreduce(&mine, &any, 1, MPI_INT, MPI_MAX, world);
  return any;
}

// One while a stone hits the plate, more while there are chips at rest or hopping. light_co_steps_ at a push of light_force_;
// at another n goes with push^(-1/2) so that the error of the push stays the same, and with no more than push^(-1/6), in which
// the limits of stability of a Hertz contact go. Nothing comes further between exchanges than at light_speed_.
int FixWallPlate::co_steps_ahead() const {
  const long long left = (update->laststep - update->ntimestep) / co_step_;
  const int most = std::max(1LL, std::min<long long>(most_co_steps_, left));
  if (most == 1 || !following_) return 1;
  double push = 0, all_push;
  int mine = most, all;
  for (const Near &p : near_) {
    if (p.touched) push += std::fabs(p.force[2]);
    const double clearance = atom->x[p.i][2] - atom->radius[p.i], speed = std::fabs(atom->v[p.i][2]);
    const double way = 2 * co_step_ * update->dt * speed;
    while (mine > 1 && speed * mine > light_speed_ * light_co_steps_ && clearance < link_->reach + mine * way + 1e-6) mine--;
  }
  MPI_Allreduce(&push, &all_push, 1, MPI_DOUBLE, MPI_SUM, world);
  MPI_Allreduce(&mine, &all, 1, MPI_INT, MPI_MIN, world);
  const double share = all_push / light_force_, allowed = light_co_steps_ * std::pow(share, share > 1 ? -1. / 2 : -1. / 6);
  return allowed < all ? std::max(1, static_cast<int>(allowed)) : all;
}

// An exchange after free flight for the sake of the reach alone, which falls as the plate rings down.
void FixWallPlate::ask_reach() {
  if (!link_ || co_steps_passed_ == 0) return;
  link_->exchange(update->ntimestep, co_steps_passed_, 1, modal_impulse_.data());
  co_steps_passed_ = 0;
}

// One exchange: the mean modal force since the last one goes out, the predicted place of the plate comes in.
void FixWallPlate::follow_plate() {
  const int modes = shapes_->modes();
  const bool resumed = !following_;
  ahead_ = co_steps_ahead();
  amplitude0_ = link_->amplitude;
  rate0_ = link_->rate;
  std::vector<double> total(modes);
  MPI_Reduce(modal_impulse_.data(), total.data(), modes, MPI_DOUBLE, MPI_SUM, 0, world);
  for (double &force : total) force /= std::max(1LL, co_steps_passed_);
  if (comm->me == 0) link_->exchange(update->ntimestep, co_steps_passed_, ahead_, total.data());
  MPI_Bcast(&link_->reach, 1, MPI_DOUBLE, 0, world);
  MPI_Bcast(link_->amplitude.data(), modes, MPI_DOUBLE, 0, world);
  MPI_Bcast(link_->rate.data(), modes, MPI_DOUBLE, 0, world);
  std::fill(modal_impulse_.begin(), modal_impulse_.end(), 0.0);
  co_steps_passed_ = 0;
  if (resumed) {  // nothing touches yet, so where the co-step starts is read back from its end
    rate0_ = link_->rate;
    for (int m = 0; m < modes; m++) amplitude0_[m] = link_->amplitude[m] - interval() * link_->rate[m];
  }
  following_ = anything_near();
  if (link_->reach > listed_reach_) list_near();
  for (size_t k = 0; k < near_.size(); k++) update_shape(k);
}

// int64 step, double force_N[agglomerates]: mean push on the plate over the co-step that ends here; nothing is written
// for a co-step without contact.
void FixWallPlate::record_forces() {
  std::vector<double> total(impulse_.size());
  MPI_Reduce(impulse_.data(), total.data(), total.size(), MPI_DOUBLE, MPI_SUM, 0, world);
  std::fill(impulse_.begin(), impulse_.end(), 0.0);
  if (comm->me != 0) return;
  if (std::all_of(total.begin(), total.end(), [](double f) { return f == 0; })) return;
  const long long step = update->ntimestep;
  const bool written = std::fwrite(&step, 8, 1, forces_) == 1 &&
                       std::fwrite(total.data(), 8, total.size(), forces_) == total.size();
  if (!written) error->one(FLERR, "cannot write the forces on the plate");
}

// int64 step, int64 n, then n times agglomerate (from 1), x, y, elastic normal force N, radius m of the sphere that
// presses (of the flattened contact where the plate has yielded), as doubles: every contact at this step.
void FixWallPlate::record_contacts() {
  std::vector<double> mine, all;
  for (const Near &p : near_) {
    if (!p.touched) continue;
    const int i = p.i;
    const double E = modulus(i), R = atom->radius[i], F = law_->normal_force(E, R, p.overlap);
    const double pressing = plastic_law_ ? plastic_law_->dent(E, R, dent_[i][0]).radius : R;
    mine.insert(mine.end(), {agglomerates_->of_tag(atom->tag[i]) + 1.0, atom->x[i][0], atom->x[i][1], F, pressing});
  }
  int size = mine.size(), total = 0;
  std::vector<int> sizes(comm->nprocs), starts(comm->nprocs);
  MPI_Gather(&size, 1, MPI_INT, sizes.data(), 1, MPI_INT, 0, world);
  for (int rank = 0; rank < comm->nprocs; rank++) starts[rank] = total, total += sizes[rank];
  all.resize(total);
  MPI_Gatherv(mine.data(), size, MPI_DOUBLE, all.data(), sizes.data(), starts.data(), MPI_DOUBLE, 0, world);
  if (comm->me != 0 || total == 0) return;
  const long long head[2] = {update->ntimestep, total / 5};
  if (std::fwrite(head, 8, 2, contacts_) != 2 || std::fwrite(all.data(), 8, total, contacts_) != all.size())
    error->one(FLERR, "cannot write the contacts with the plate");
}

void FixWallPlate::flush() {
  if ((forces_ && std::fflush(forces_) != 0) || (contacts_ && std::fflush(contacts_) != 0))
    error->one(FLERR, "cannot write the forces on the plate");
}

void FixWallPlate::post_run() {
  flush();
  if (link_ && comm->me == 0) link_->finish();
}

void FixWallPlate::add_elastic_energy(double *energy) const {
  for (const Near &p : near_) {
    if (!p.touched) continue;
    const int i = p.i;
    double &sum = energy[agglomerates_->of_tag(atom->tag[i])];
    const double E = modulus(i), R = atom->radius[i];
    const double left = plastic_law_ ? plastic_law_->dent(E, R, dent_[i][0]).depth : 0;
    // Hertz' 2/5 F d, which is 8/15 E* sqrt(R) d^(5/2) where nothing has yielded
    sum += 0.4 * law_->normal_force(E, R, p.overlap) * (p.depth - left);
  }
}

/* --- the dent travels with its sub-sphere ------------------------------------------------------------------- */

void FixWallPlate::grow_arrays(int nmax) { memory->grow(dent_, nmax, DENT, "wall/plate:dent"); }

void FixWallPlate::copy_arrays(int i, int j, int) { std::copy_n(dent_[i], DENT, dent_[j]); }

void FixWallPlate::set_arrays(int i) { std::fill_n(dent_[i], DENT, 0.0); }

int FixWallPlate::pack_exchange(int i, double *buf) {
  std::copy_n(dent_[i], DENT, buf);
  return DENT;
}

int FixWallPlate::unpack_exchange(int i, double *buf) {
  std::copy_n(buf, DENT, dent_[i]);
  return DENT;
}

/* --- checkpoint --------------------------------------------------------------------------------------------------- */

void FixWallPlate::save(CheckpointWriter &out) {
  flush();
  out.sum("wall_work_on_stone", work_on_stone_);
  out.sum("wall_work_on_plate", work_on_plate_);
  out.sum("wall_damped", damped_);
  out.sum("wall_plastic", plastic_);
  std::vector<double> deepest(deepest_.size());
  MPI_Allreduce(deepest_.data(), deepest.data(), deepest.size(), MPI_DOUBLE, MPI_MAX, world);
  out.common("wall_deepest", deepest);
  out.sum("wall_impulse", impulse_);
  out.sum("wall_modal_impulse", modal_impulse_);
  out.common("wall_co_step", {static_cast<double>(step_in_co_step_), static_cast<double>(co_steps_passed_),
                              static_cast<double>(following_), link_ ? link_->reach : 0,
                              static_cast<double>(ahead_)});
  if (link_) {
    out.common("wall_amplitude_start", amplitude0_);
    out.common("wall_rate_start", rate0_);
    out.common("wall_amplitude_end", link_->amplitude);
    out.common("wall_rate_end", link_->rate);
  }
  std::vector<double> rows;  // tag, force, torque, history of what touches
  for (const Near &p : near_) {
    if (!p.touched) continue;
    rows.push_back(atom->tag[p.i]);
    rows.insert(rows.end(), p.force, p.force + 3);
    rows.insert(rows.end(), p.torque, p.torque + 3);
    if (dnum_ > 0) rows.insert(rows.end(), fix_history_primitive_->array_atom[p.i],
                               fix_history_primitive_->array_atom[p.i] + dnum_);
  }
  out.rows("wall_contacts", rows);
  if (!plastic_law_) return;
  rows.clear();
  for (int i = 0; i < atom->nlocal; i++) {
    if (std::all_of(dent_[i], dent_[i] + DENT, [](double d) { return d == 0; })) continue;
    rows.push_back(atom->tag[i]);
    rows.insert(rows.end(), dent_[i], dent_[i] + DENT);
  }
  out.rows("wall_dents", rows);
}

// Everything else is found anew when the next step lists what is near.
void FixWallPlate::restore(const CheckpointReader &in) {
  const size_t n = agglomerates_->count();
  work_on_stone_ = in.sum("wall_work_on_stone", n);
  work_on_plate_ = in.sum("wall_work_on_plate", n);
  damped_ = in.sum("wall_damped", n);
  plastic_ = in.sum("wall_plastic", n);
  deepest_ = in.common("wall_deepest", n);
  impulse_ = in.sum("wall_impulse", n);
  modal_impulse_ = in.sum("wall_modal_impulse", modal_impulse_.size());
  const std::vector<double> &co_step = in.common("wall_co_step", 5);
  step_in_co_step_ = static_cast<int>(co_step[0]);
  co_steps_passed_ = static_cast<long long>(co_step[1]);
  following_ = co_step[2] != 0;
  ahead_ = static_cast<int>(co_step[4]);
  if (link_) {
    link_->reach = co_step[3];
    const size_t modes = link_->amplitude.size();
    amplitude0_ = in.common("wall_amplitude_start", modes);
    rate0_ = in.common("wall_rate_start", modes);
    link_->amplitude = in.common("wall_amplitude_end", modes);
    link_->rate = in.common("wall_rate_end", modes);
    if (comm->me == 0) link_->open();
  }
  near_.clear();
  const int columns = 7 + std::max(0, dnum_);
  const std::vector<double> &rows = in.rows("wall_contacts", columns);
  for (size_t k = 0; k < rows.size(); k += columns) {
    const int i = atom->map(static_cast<int>(rows[k]));
    if (i < 0 || i >= atom->nlocal) continue;
    Near p;
    p.i = i;
    p.touched = true;
    std::copy_n(&rows[k + 1], 3, p.force);
    std::copy_n(&rows[k + 4], 3, p.torque);
    near_.push_back(p);
    if (dnum_ > 0) std::copy_n(&rows[k + 7], dnum_, fix_history_primitive_->array_atom[i]);
  }
  if (!plastic_law_) return;
  const std::vector<double> &dents = in.rows("wall_dents", 1 + DENT);
  for (size_t k = 0; k < dents.size(); k += 1 + DENT) {
    const int i = atom->map(static_cast<int>(dents[k]));
    if (i >= 0 && i < atom->nlocal) std::copy_n(&dents[k + 1], DENT, dent_[i]);
  }
}

void FixWallPlate::saved(long long step) {
  if (link_ && comm->me == 0) link_->checkpoint(step);
}
