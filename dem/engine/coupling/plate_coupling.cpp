#include "coupling/plate_coupling.h"

#include <mpi.h>

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <utility>

#include "atom.h"
#include "interfaces/checkpoint_file.h"
#include "comm.h"
#include "lammps.h"
#include "update.h"

namespace LAMMPS_NS {

namespace {
const double SHAPE_TOLERANCE_M = 2e-6;  // a mode shape follows a sub-sphere that moved this far in the plane,
const double SLOPES_REACH = 0.015;      // by its slopes as far as this, in cells of the grid of shapes
const double PLATE_CLEARANCE_M = 1e-6;  // added to what the plate can reach
}  // namespace

PlateCoupling::PlateCoupling(LAMMPS *lmp, const std::string &shapes_file, const std::string &to_plate,
                             const std::string &from_plate, int co_step, const WeakContact &weak)
    : lmp_(lmp), shapes_(lmp, shapes_file), link_(lmp, to_plate, from_plate, shapes_.modes()), co_step_(co_step),
      weak_(weak), modal_force_(shapes_.modes(), 0.0) {}

double PlateCoupling::interval_s() const { return extrapolated_co_steps_ * co_step_ * lmp_->update->dt; }

/* --- where the plate is -------------------------------------------------------------------------------------- */

void PlateCoupling::list(const std::vector<NearSphere> &near) {
  std::unordered_map<int, Site> known;
  for (Site &site : sites_)
    if (site.has_shape()) known.emplace(site.tag, std::move(site));
  sites_.assign(near.size(), Site());
  for (size_t k = 0; k < near.size(); k++) {
    const int tag = lmp_->atom->tag[near[k].i];
    const auto found = known.find(tag);
    if (found != known.end()) sites_[k] = std::move(found->second);
    sites_[k].tag = tag;
  }
  // Within a co-step the place of the plate must be known at once for what was not listed before.
  if (engaged_) predict(near);
}

void PlateCoupling::predict(const std::vector<NearSphere> &near) {
  for (size_t k = 0; k < near.size(); k++) predict(near[k], sites_[k]);
}

// Takes the mode shapes at the place of a near sub-sphere, and the plate there at both ends of the time between
// messages.
void PlateCoupling::predict(const NearSphere &p, Site &site) {
  site.is_active = p.stands_for_patch || is_within_reach(p, 2 * std::fabs(lmp_->atom->v[p.i][2]) * interval_s());
  std::fill_n(site.way, 3, Site::Way());
  if (!site.is_active) return;
  follow(p, site);
  const double *shape = site.shapes.data();
  const double *amplitude0 = amplitude0_.data(), *rate0 = rate0_.data();
  const double *amplitude1 = link_.amplitude.data(), *rate1 = link_.rate.data();
  for (int d = 0; d < shapes_.directions(); d++, shape += shapes_.modes()) {
    double w0 = 0, r0 = 0, w1 = 0, r1 = 0;
#pragma omp simd reduction(+ : w0, r0, w1, r1)
    for (int m = 0; m < shapes_.modes(); m++) {
      w0 += shape[m] * amplitude0[m];
      r0 += shape[m] * rate0[m];
      w1 += shape[m] * amplitude1[m];
      r1 += shape[m] * rate1[m];
    }
    site.way[d] = {w0, w1, r0, r1};
  }
}

// Can the plate reach a sub-sphere that comes nearer by `way`?
bool PlateCoupling::is_within_reach(const NearSphere &p, double way) const {
  const Atom *atom = lmp_->atom;
  return atom->x[p.i][2] - atom->radius[p.i] < link_.reach + way + p.outside + PLATE_CLEARANCE_M;
}

// The mode shapes beneath a near sub-sphere.
void PlateCoupling::follow(const NearSphere &p, Site &site) const {
  const double *x = lmp_->atom->x[p.i];
  const double foot_x = std::clamp(x[0] + p.to_foot[0], extent_[0], extent_[1]);
  const double foot_y = std::clamp(x[1] + p.to_foot[1], extent_[2], extent_[3]);
  if (!site.has_shape() || std::hypot(foot_x - site.x, foot_y - site.y) > SHAPE_TOLERANCE_M)
    take_shape(foot_x, foot_y, site);
}

// The mode shapes at a place: from the grid where the site has none near by, else along the slopes of those it has.
__attribute__((target_clones("avx2", "default")))
void PlateCoupling::take_shape(double x, double y, Site &site) const {
  const int n = shapes_.numbers();
  double dx = x - site.taken_x, dy = y - site.taken_y;
  const bool anew = !site.has_shape() || std::hypot(dx, dy) > SLOPES_REACH * shapes_.cell_m();
  site.shapes.resize(4 * n);
  double *shape = site.shapes.data(), *taken = shape + n, *by_x = taken + n, *by_y = by_x + n;
  if (anew) {
    shapes_.at(x, y, taken, by_x, by_y);
    site.taken_x = x, site.taken_y = y;
    dx = dy = 0;
  }
#pragma omp simd
  for (int k = 0; k < n; k++) shape[k] = taken[k] + dx * by_x[k] + dy * by_y[k];
  site.x = x, site.y = y;
}

// The cubic of Hermite: w = w0 + s dw + s (1 - s) ((1 - s) a + s b), dw = w1 - w0, a = T w0' - dw, b = dw - T w1'.
double PlateCoupling::Site::Way::displacement(double s, double T) const {
  const double dw = w1 - w0, a = T * rate0 - dw, b = dw - T * rate1;
  return w0 + s * dw + s * (1 - s) * ((1 - s) * a + s * b);
}

double PlateCoupling::Site::Way::velocity(double s, double T) const {
  const double dw = w1 - w0, a = T * rate0 - dw, b = dw - T * rate1;
  return (dw + (1 - 2 * s) * ((1 - s) * a + s * b) + s * (1 - s) * (b - a)) / T;
}

// A sub-sphere that something struck since the last message may come sooner than was foreseen.
void PlateCoupling::place(std::vector<NearSphere> &near, int step_in_co_step) {
  for (size_t k = 0; k < near.size(); k++) {
    if (engaged_ && !sites_[k].is_active && is_within_reach(near[k], 0)) predict(near[k], sites_[k]);
    place(near[k], sites_[k], step_in_co_step);
  }
}

void PlateCoupling::find(NearSphere &p, size_t number, int step_in_co_step) {
  if (engaged_) predict(p, sites_[number]);
  place(p, sites_[number], step_in_co_step);
}

void PlateCoupling::place(NearSphere &p, const Site &site, int step_in_co_step) const {
  const double T = interval_s();
  const long long steps_passed = co_steps_passed_ * co_step_ + step_in_co_step;
  const double s = static_cast<double>(steps_passed) / (extrapolated_co_steps_ * co_step_);
  p.plate_z = p.plate_v = p.plate_drift[0] = p.plate_drift[1] = 0;
  if (!site.is_active || !engaged_) return;
  p.plate_z = site.way[0].displacement(s, T);
  p.plate_v = site.way[0].velocity(s, T);
  for (int d = 1; d < shapes_.directions(); d++) p.plate_drift[d - 1] = site.way[d].velocity(s, T);
}

void PlateCoupling::add_forces(const std::vector<NearSphere> &near, double share) {
  const int modes = shapes_.modes();
  for (size_t k = 0; k < near.size(); k++) {
    if (!near[k].touches || near[k].push == 0) continue;
    if (!sites_[k].has_shape()) follow(near[k], sites_[k]);  // struck since the plate was last asked for anything
    const double *shape = sites_[k].shapes.data();
    const double force[3] = {near[k].push, near[k].drag[0], near[k].drag[1]};
    for (int d = 0; d < shapes_.directions(); d++, shape += modes)
      for (int m = 0; m < modes; m++) modal_force_[m] -= share * force[d] * shape[m];
  }
}

/* --- messages ------------------------------------------------------------------------------------------------ */

bool PlateCoupling::end_co_step(const std::vector<NearSphere> &near, bool first) {
  if (!first) co_steps_passed_++;
  if (!first && engaged_ && co_steps_passed_ < extrapolated_co_steps_) return false;
  if (!first && !engaged_ && !anything_near(near)) return false;
  send_message(near);
  return true;
}

bool PlateCoupling::anything_near(const std::vector<NearSphere> &near) const {
  int mine = 0, any = 0;
  for (const NearSphere &p : near)
    mine |= p.touches || is_within_reach(p, 2 * std::fabs(lmp_->atom->v[p.i][2]) * interval_s());
  MPI_Allreduce(&mine, &any, 1, MPI_INT, MPI_MAX, lmp_->world);
  return any;
}

// One while a stone hits the plate, more in a weak contact: weak_.co_steps at a push of weak_.force_N. At a stronger
// push the number goes with push^(-1/2), so that the error of the push stays the same; at a weaker one with
// push^(-1/6), as the limit of stability of a Hertz contact does; one where a face presses. Between messages nothing comes further than at
// weak_.speed_m_s.
int PlateCoupling::co_steps_to_extrapolate(const std::vector<NearSphere> &near) const {
  const Update *update = lmp_->update;
  const long long left = (update->laststep - update->ntimestep) / co_step_;
  const int most = std::max(1LL, std::min<long long>(weak_.most_co_steps, left));
  if (most == 1 || !engaged_) return 1;
  double push = 0, all_push;
  int mine = most, all;
  for (const NearSphere &p : near) {
    if (p.touches) push += std::fabs(p.force[2]);
    if (p.face.acts) mine = 1;  // as stiff under a weak push
    const double speed = std::fabs(lmp_->atom->v[p.i][2]), way = 2 * co_step_ * update->dt * speed;
    while (mine > 1 && speed * mine > weak_.speed_m_s * weak_.co_steps && is_within_reach(p, mine * way)) mine--;
  }
  MPI_Allreduce(&push, &all_push, 1, MPI_DOUBLE, MPI_SUM, lmp_->world);
  MPI_Allreduce(&mine, &all, 1, MPI_INT, MPI_MIN, lmp_->world);
  const double share = all_push / weak_.force_N;
  const double allowed = weak_.co_steps * std::pow(share, share > 1 ? -1. / 2 : -1. / 6);
  return allowed < all ? std::max(1, static_cast<int>(allowed)) : all;
}

// The mean modal force since the last message goes out, the predicted place of the plate comes in.
void PlateCoupling::send_message(const std::vector<NearSphere> &near) {
  const MPI_Comm world = lmp_->world;
  const int modes = shapes_.modes();
  const bool begins = !engaged_;
  extrapolated_co_steps_ = co_steps_to_extrapolate(near);
  amplitude0_ = link_.amplitude;
  rate0_ = link_.rate;
  std::vector<double> mean(modes);
  MPI_Reduce(modal_force_.data(), mean.data(), modes, MPI_DOUBLE, MPI_SUM, 0, world);
  for (double &force : mean) force /= std::max(1LL, co_steps_passed_);
  if (lmp_->comm->me == 0)
    link_.message(lmp_->update->ntimestep, co_steps_passed_, extrapolated_co_steps_, mean.data());
  MPI_Bcast(&link_.reach, 1, MPI_DOUBLE, 0, world);
  MPI_Bcast(link_.amplitude.data(), modes, MPI_DOUBLE, 0, world);
  MPI_Bcast(link_.rate.data(), modes, MPI_DOUBLE, 0, world);
  std::fill(modal_force_.begin(), modal_force_.end(), 0.0);
  co_steps_passed_ = 0;
  if (begins) {  // nothing touches yet, so where the co-step starts is read back from its end
    rate0_ = link_.rate;
    for (int m = 0; m < modes; m++) amplitude0_[m] = link_.amplitude[m] - interval_s() * link_.rate[m];
  }
  engaged_ = anything_near(near);
}

// A message after free flight for the sake of the reach alone, which falls as the plate rings down.
void PlateCoupling::ask_reach() {
  if (co_steps_passed_ == 0) return;
  link_.message(lmp_->update->ntimestep, co_steps_passed_, 1, modal_force_.data());
  co_steps_passed_ = 0;
}

void PlateCoupling::finish() {
  if (lmp_->comm->me == 0) link_.finish();
}

/* --- checkpoint ---------------------------------------------------------------------------------------------- */

void PlateCoupling::save(CheckpointWriter &out) {
  out.sum("coupling_modal_force", modal_force_);
  out.common("coupling", {static_cast<double>(co_steps_passed_), static_cast<double>(engaged_), link_.reach,
                          static_cast<double>(extrapolated_co_steps_)});
  out.common("coupling_amplitude_start", amplitude0_);
  out.common("coupling_rate_start", rate0_);
  out.common("coupling_amplitude_end", link_.amplitude);
  out.common("coupling_rate_end", link_.rate);
}

void PlateCoupling::restore(const CheckpointReader &in) {
  const size_t modes = modal_force_.size();
  modal_force_ = in.sum("coupling_modal_force", modes);
  const std::vector<double> &numbers = in.common("coupling", 4);
  co_steps_passed_ = static_cast<long long>(numbers[0]);
  engaged_ = numbers[1] != 0;
  link_.reach = numbers[2];
  extrapolated_co_steps_ = static_cast<int>(numbers[3]);
  amplitude0_ = in.common("coupling_amplitude_start", modes);
  rate0_ = in.common("coupling_rate_start", modes);
  link_.amplitude = in.common("coupling_amplitude_end", modes);
  link_.rate = in.common("coupling_rate_end", modes);
  if (lmp_->comm->me == 0) link_.open();
}

void PlateCoupling::saved(long long step) {
  if (lmp_->comm->me == 0) link_.checkpoint(step);
}

}  // namespace LAMMPS_NS
