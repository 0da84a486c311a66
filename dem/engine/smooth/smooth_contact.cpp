#include "smooth/smooth_contact.h"

#include <mpi.h>

#include <algorithm>
#include <cmath>

#include "atom.h"
#include "interfaces/checkpoint_file.h"
#include "comm.h"
#include "interfaces/energy_holder.h"
#include "error.h"
#include "base/fixes.h"
#include "lammps.h"
#include "laws/tangential_law.h"
#include "update.h"

namespace LAMMPS_NS {

namespace {
const double MOST_STOPPED = 1;  // of the speed in one step, by a dashpot
}  // namespace

SmoothContact::SmoothContact(LAMMPS *lmp, const Agglomerates &agglomerates, StockWall &wall, PlateBeneath &beneath,
                             double yield_pressure_Pa, const std::string &surface_file)
    : lmp_(lmp), agglomerates_(agglomerates), beneath_(beneath), alone_(lmp, agglomerates, wall, yield_pressure_Pa),
      surfaces_(lmp, surface_file, agglomerates), patch_of_tag_(agglomerates.tags() + 1, -1),
      near_of_tag_(agglomerates.tags() + 1, -1), moved_(agglomerates.tags() + 1),
      damped_(agglomerates.count(), 0), plastic_(damped_), released_(damped_), friction_(damped_),
      half_work_(damped_), half_damped_(damped_), deepest_(damped_) {
  touching_.resize(near_of_tag_.size(), 0);
}

void SmoothContact::setup() {
  alone_.setup();
  bonds_ = fix_that_is<BondNetwork>(lmp_->modify);
  if (!bonds_) lmp_->error->all(FLERR, "The contact of smooth stones needs fix bond/parallel");
  pieces_ = std::make_unique<StonePieces>(lmp_, agglomerates_, surfaces_, *bonds_);
}

void SmoothContact::enter(const EnteringStone &stone) {
  surfaces_.enter(stone);
  if (pieces_) pieces_->enter(stone);
}

void SmoothContact::leave(int agglomerate) {
  std::fill_n(moved_.begin() + agglomerates_.first_tag(agglomerate), agglomerates_.size(agglomerate), Vec());
  if (pieces_) pieces_->leave(agglomerate);
}

int SmoothContact::Patch::central() const {
  return std::max_element(members.begin(), members.end(), [](const Weight &a, const Weight &b) {
           return a.weight < b.weight;
         })->tag;
}

bool SmoothContact::is_first_rank() const { return lmp_->comm->me == 0; }

void SmoothContact::sum(std::vector<double> &values) const {
  if (lmp_->comm->nprocs == 1 || values.empty()) return;
  const std::vector<double> mine = values;
  MPI_Allreduce(mine.data(), values.data(), values.size(), MPI_DOUBLE, MPI_SUM, lmp_->world);
}

int SmoothContact::here(int tag) const {
  const int i = lmp_->atom->map(tag);
  return i >= 0 && i < lmp_->atom->nlocal ? i : -1;
}

/* --- the step ---------------------------------------------------------------------------------------------- */

void SmoothContact::add_forces(std::vector<NearSphere> &near, double reach, int vflag) {
  near_ = &near;
  // A body that has left the plate for good is taken out with a patch that it may have, below the plate's edge.
  const auto gone = std::remove_if(patches_.begin(), patches_.end(), [&](const Patch &p) {
    const bool left = lmp_->comm->nprocs == 1 && std::any_of(p.members.begin(), p.members.end(), [&](const Weight &m) {
                        return here(m.tag) < 0;
                      });
    if (left) released_[p.agglomerate] += p.share * p.state.stored + 0.5 * p.spring * dot(p.slip, p.slip);
    return left;
  });
  if (gone != patches_.end()) {
    patches_.erase(gone, patches_.end());
    index_patches();
  }
  index(near);
  place_on_plate(near);
  const bool looks = must_look();
  if (looks) {
    looked_ = true;
    remember_sliding();
    look(near, reach);
    std::vector<double> w_before;
    for (const Patch &p : patches_) w_before.push_back(p.w);
    place_on_plate(near);
    // Where the foot moved, the plate beneath it is elsewhere; q stays.
    for (size_t k = 0; k < patches_.size(); k++)
      if (patches_[k].presses) patches_[k].base -= patches_[k].w - w_before[k];
  }
  meet_alone(near, vflag);
  measure();
  if (looks && is_first_rank())
    for (const Patch &p : patches_)
      released_[p.agglomerate] += 0.5 * lmp_->update->dt * p.spring * dot(p.slip, p.sliding_before - p.sliding);
  for (Patch &p : patches_) press(p);
  dampen();
  for (Patch &p : patches_)
    if (p.elastic > 0 && stone(p).friction > 0) rub(p);
  if (looks) release_half_a_step(near);
  hand_out(near);
}

// The plate under each patch is that at its foot, which its central member knows.
void SmoothContact::place_on_plate(const std::vector<NearSphere> &near) {
  std::vector<double> found(4 * patches_.size(), 0);
  for (size_t k = 0; k < patches_.size(); k++) {
    const int tag = patches_[k].central();
    if (here(tag) < 0) continue;
    if (near_of_tag_[tag] < 0) lmp_->error->one(FLERR, "A patch of a stone's surface is not near the plate");
    const NearSphere &n = near[near_of_tag_[tag]];
    found[4 * k] = n.plate_z, found[4 * k + 1] = n.plate_v;
    std::copy_n(n.plate_drift, 2, &found[4 * k + 2]);
  }
  sum(found);
  for (size_t k = 0; k < patches_.size(); k++) {
    patches_[k].w = found[4 * k], patches_[k].plate_v = found[4 * k + 1];
    patches_[k].drift = Vec(found[4 * k + 2], found[4 * k + 3], 0);
  }
}

// Members of patches do not touch alone. Those that left one find the plate where it was moved to for them, until they
// are free. It comes back up as they rise.
void SmoothContact::meet_alone(std::vector<NearSphere> &near, int vflag) {
  const Atom *atom = lmp_->atom;
  for (NearSphere &p : near) {
    const int tag = atom->tag[p.i];
    p.in_patch = patch_of_tag_[tag] >= 0;
    Vec &moved = moved_[tag];
    const double depth = atom->radius[p.i] - (atom->x[p.i][2] - p.plate_z);
    if (!p.in_patch && depth < -moved.z) moved.z = std::min(0.0, -depth);
    p.plate_moved = moved;
  }
  alone_.add_forces(near, 0, vflag);
  alone_now_.clear();
  for (const NearSphere &p : near) {
    const int tag = atom->tag[p.i];
    if (p.touches) alone_now_.push_back(tag);
    else moved_[tag].x = moved_[tag].y = 0;
  }
}

void SmoothContact::measure() {
  const Atom *atom = lmp_->atom;
  std::vector<double> sums(5 * patches_.size(), 0);
  for (size_t k = 0; k < patches_.size(); k++)
    for (const Weight &m : patches_[k].members) {
      const int i = here(m.tag);
      if (i < 0) continue;
      sums[5 * k] += m.weight * atom->x[i][2];
      sums[5 * k + 1] += m.weight * atom->v[i][2];
      add_sliding(m, i, patches_[k].w, &sums[5 * k + 2]);
      sums[5 * k + 4] += m.weight * m.weight * surface_mobility(i, patches_[k].w);
    }
  sum(sums);
  for (size_t k = 0; k < patches_.size(); k++) {
    Patch &p = patches_[k];
    p.q = p.base - sums[5 * k] + p.w;
    p.q_rate = p.plate_v - sums[5 * k + 1];
    p.sliding = Vec(sums[5 * k + 2], sums[5 * k + 3], 0) - p.drift;
    p.mobility = sums[5 * k + 4];
  }
}

// Across the plate, of the surface of the plate's height below sub-sphere i.
Vec SmoothContact::surface_velocity(int i, double plate_z) const {
  const double *v = lmp_->atom->v[i], *spin = lmp_->atom->omega[i], height = lmp_->atom->x[i][2] - plate_z;
  return Vec(v[0] - spin[1] * height, v[1] + spin[0] * height, 0);
}

// Along x and y, of a member whose local index is i, by its weight.
void SmoothContact::add_sliding(const Weight &m, int i, double plate_z, double *sum) const {
  const Vec surface = surface_velocity(i, plate_z);
  sum[0] += m.weight * surface.x;
  sum[1] += m.weight * surface.y;
}

// Of that surface under a force across the plate at it, 1/kg: as a free sphere.
double SmoothContact::surface_mobility(int i, double plate_z) const {
  const Atom *atom = lmp_->atom;
  const double height = atom->x[i][2] - plate_z, radius = atom->radius[i];
  return (1 + 2.5 * height * height / (radius * radius)) / atom->rmass[i];
}

void SmoothContact::press(Patch &p) {
  if (p.is_new && p.q > 2 * std::fabs(p.q_rate) * lmp_->update->dt) p.base -= p.q, p.q = 0;  // no force from nothing
  p.is_new = false;
  p.elastic = p.dashpot = p.across[0] = p.across[1] = p.rubbing = 0;
  p.state = SmoothLaw::State();
  p.presses = p.q > 0;
  if (!p.presses) {
    p.largest = 0;
    stretch(p, 0, Vec());
    return;
  }
  press_to_q(p);
  if (p.state.force <= 0) return stretch(p, 0, Vec());
  const SmoothStone &s = stone(p);
  deepest_[p.agglomerate] = std::max(deepest_[p.agglomerate], p.state.approach / s.radius);
  p.elastic = p.share * p.state.force;
}

// Hertz' dashpot 2 sqrt(5/6) zeta sqrt(S m) on the speed at which the piece as a whole comes down. It never pulls more
// than the patch pushes.
void SmoothContact::dampen() {
  std::vector<double> speeds;
  for (const Patch &p : patches_) speeds.push_back(p.elastic > 0 ? body_speed(p) : 0);
  sum(speeds);
  for (size_t k = 0; k < patches_.size(); k++) {
    Patch &p = patches_[k];
    if (p.elastic <= 0) continue;
    const double c = 2 * std::sqrt(5. / 6.) * stone(p).damping_ratio * std::sqrt(p.share * p.state.stiffness * p.mass);
    const double most = MOST_STOPPED / (p.body_mobility * lmp_->update->dt);  // a chip pushed beside its middle spins off
    p.dashpot = std::max(-p.elastic, std::min(c, most) * (p.plate_v - speeds[k]));
  }
}

// Upwards, of what is on this rank.
double SmoothContact::body_speed(const Patch &p) const {
  double speed = 0;
  for (const Weight &m : p.body)
    if (const int i = here(m.tag); i >= 0) speed += m.weight * lmp_->atom->v[i][2];
  return speed;
}

// The law at the present q.
void SmoothContact::press_to_q(Patch &p) {
  const SmoothLaw law = this->law(stone(p));
  const double before = p.largest;
  p.state = law.at(p.q, p.compliance, p.largest);
  if (is_first_rank()) plastic_[p.agglomerate] += p.share * (law.taken(p.largest) - law.taken(before));
}

// The dashpot acts while the patch sticks, no more than stops the members as free spheres in one step: twice that would
// gain energy. Of the shipped stones none come there.
void SmoothContact::rub(Patch &p) {
  const SmoothStone &s = stone(p);
  const double mindlin = mindlin_stiffness(s.shear_modulus, s.modulus, p.state.stiffness);
  const double stops = MOST_STOPPED / (p.mobility * lmp_->update->dt);  // the members as free spheres, in one step
  const double spring = spring_before_bonds(p.share, mindlin, p.compliance_across, stops / lmp_->update->dt);
  const Vec slip = kept_stretch(p.spring, p.slip, spring) + lmp_->update->dt * p.sliding;
  const double sticks = share_that_sticks(spring * norm(slip), s.friction, p.force());
  stretch(p, spring, sticks * slip);
  if (sticks == 1) {
    const double dashpot = p.share * 2 * std::sqrt(5. / 6.) * s.damping_ratio_across * std::sqrt(mindlin * p.mass);
    p.rubbing = std::min(dashpot, stops);
  }
  const Vec across = -spring * p.slip - p.rubbing * p.sliding;
  p.across[0] = across.x, p.across[1] = across.y;
}

void SmoothContact::stretch(Patch &p, double spring, const Vec &slip) {
  if (is_first_rank()) {
    const TangentialStep step = tangential_step(p.spring, p.slip, spring, slip, lmp_->update->dt * p.sliding);
    friction_[p.agglomerate] += step.friction - step.gained;
  }
  p.spring = spring, p.slip = slip;
}

// The force of each patch to its members; the plate feels all of it at the foot.
void SmoothContact::hand_out(std::vector<NearSphere> &near) {
  Atom *atom = lmp_->atom;
  for (const Patch &p : patches_) {
    if (!p.presses) continue;
    for (const Weight &m : p.body)
      if (const int i = here(m.tag); i >= 0) atom->f[i][2] += m.weight * p.dashpot;
    const int central = p.central();
    for (const Weight &m : p.members) {
      const int i = here(m.tag);
      if (i < 0) continue;
      if (near_of_tag_[m.tag] < 0) lmp_->error->one(FLERR, "A patch of a stone's surface is not near the plate");
      NearSphere &n = near[near_of_tag_[m.tag]];
      const double height = atom->x[i][2] - p.w;
      const double f[3] = {m.weight * p.across[0], m.weight * p.across[1], m.weight * p.elastic};
      const double torque[3] = {height * f[1], -height * f[0], 0};
      n.touches = n.in_patch = true;
      n.push = m.tag == central ? p.force() : 0;
      for (int d = 0; d < 2; d++) n.drag[d] = m.tag == central ? p.across[d] : 0;
      n.depth = n.overlap = 0;
      for (int d = 0; d < 3; d++) {
        n.force[d] = f[d], n.torque[d] = torque[d];
        atom->f[i][d] += f[d], atom->torque[i][d] += torque[d];
      }
    }
  }
}

// The force had the rate of half a step ago. The integrator does its work with the present one, half of it in this step
// and half in the next.
void SmoothContact::end_of_step(const std::vector<NearSphere> &near, std::vector<double> &work_on_stone) {
  alone_.end_of_step(near, work_on_stone);
  const double half_dt = 0.5 * lmp_->update->dt;
  for (const int a : agglomerates_.near()) {
    work_on_stone[a] += half_work_[a], damped_[a] += half_damped_[a];
    half_work_[a] = half_damped_[a] = 0;
  }
  for (const Patch &p : patches_) {
    if (p.dashpot != 0) {
      const double speed = body_speed(p), plate_v = is_first_rank() ? p.plate_v : 0;
      half_work_[p.agglomerate] += half_dt * p.dashpot * speed;
      half_damped_[p.agglomerate] += half_dt * p.dashpot * (plate_v - speed);
    }
    if (p.rubbing == 0) continue;
    Vec sliding = is_first_rank() ? -1 * p.drift : Vec();
    for (const Weight &m : p.members) {
      const int i = here(m.tag);
      if (i >= 0) sliding += m.weight * surface_velocity(i, p.w);
    }
    half_damped_[p.agglomerate] += half_dt * p.rubbing * dot(p.sliding, sliding);
  }
  for (const int a : agglomerates_.near()) work_on_stone[a] += half_work_[a], damped_[a] += half_damped_[a];
}

PlateContact::Pressing SmoothContact::pressing(const NearSphere &n) const {
  if (!n.in_patch) return alone_.pressing(n);
  const Patch &p = patches_[patch_of_tag_[lmp_->atom->tag[n.i]]];
  return {p.share * p.state.force, p.state.pressing_radius};
}

void SmoothContact::add_to(LedgerRows &rows, const std::vector<NearSphere> &near) const {
  alone_.add_to(rows, near);
  rows.add(WALL_DAMPED, damped_);
  rows.add(WALL_RELEASED, released_);
  for (const int a : rows.near()) {
    double &deepest = rows.at(a, WALL_DEEPEST);
    deepest = std::max(deepest, deepest_[a]);
  }
  if (!is_first_rank()) return;
  rows.add(WALL_PLASTIC, plastic_);
  rows.add(FRICTION, friction_);
  for (const Patch &p : patches_)
    rows.at(p.agglomerate, WALL_ELASTIC) += p.share * p.state.stored + 0.5 * p.spring * dot(p.slip, p.slip);
}

/* --- checkpoint -------------------------------------------------------------------------------------------- */

// The patches are the same on all ranks.
void SmoothContact::save(CheckpointWriter &out, const std::vector<NearSphere> &near) const {
  alone_.save(out, near);
  std::vector<double> numbers, left;
  for (const Patch &p : patches_) {
    numbers.insert(numbers.end(), {p.agglomerate + 0.0, p.piece + 0.0, p.share, p.base, p.body_mobility, p.to_foot.x,
                                   p.to_foot.y, p.axis.x, p.axis.y, p.axis.z,
                                   p.compliance, p.compliance_across, p.mass, p.presses + 0.0, p.is_new + 0.0,
                                   p.largest, p.slip.x, p.slip.y, p.spring, p.members.size() + 0.0,
                                   p.body.size() + 0.0});
    for (const Weight &m : p.members) numbers.insert(numbers.end(), {m.tag + 0.0, m.weight});
    for (const Weight &m : p.body) numbers.insert(numbers.end(), {m.tag + 0.0, m.weight});
  }
  for (size_t tag = 1; tag < moved_.size(); tag++)
    if (const Vec &m = moved_[tag]; norm(m) > 0) left.insert(left.end(), {tag + 0.0, m.x, m.y, m.z});
  out.common("patch_counts", {patches_.size() + 0.0, numbers.size() + 0.0, left.size() + 0.0, watched_.size() + 0.0});
  out.common("patches", numbers);
  out.common("patch_offsets", left);
  out.rows("patch_alone", std::vector<double>(alone_now_.begin(), alone_now_.end()));
  out.common("patch_watched", std::vector<double>(watched_.begin(), watched_.end()));
  out.sum("patch_damped", damped_);
  out.sum("patch_half_work", half_work_);
  out.sum("patch_half_damped", half_damped_);
  out.sum("patch_released", released_);
  out.sum("patch_plastic", plastic_);
  out.sum("patch_friction", friction_);
  out.common("patch_deepest", deepest_);
}

void SmoothContact::restore(const CheckpointReader &in) {
  alone_.restore(in);
  const std::vector<double> counts = in.common("patch_counts", 4);
  const std::vector<double> &numbers = in.common("patches", counts[1]), &left = in.common("patch_offsets", counts[2]);
  damped_ = in.sum("patch_damped", damped_.size());
  half_work_ = in.sum("patch_half_work", half_work_.size());
  half_damped_ = in.sum("patch_half_damped", half_damped_.size());
  released_ = in.sum("patch_released", released_.size());
  plastic_ = in.sum("patch_plastic", plastic_.size());
  friction_ = in.sum("patch_friction", friction_.size());
  deepest_ = in.common("patch_deepest", deepest_.size());
  const double *n = numbers.data();
  patches_.clear();
  for (int k = 0; k < counts[0]; k++) {
    Patch p;
    p.agglomerate = *n++, p.piece = *n++, p.share = *n++, p.base = *n++, p.body_mobility = *n++;
    p.to_foot.x = *n++, p.to_foot.y = *n++;
    p.axis.x = *n++, p.axis.y = *n++, p.axis.z = *n++;
    p.compliance = *n++, p.compliance_across = *n++, p.mass = *n++;
    p.presses = *n++ != 0, p.is_new = *n++ != 0, p.largest = *n++;
    p.slip.x = *n++, p.slip.y = *n++, p.spring = *n++;
    const int members = *n++, body = *n++;
    for (int m = 0; m < members; m++, n += 2) p.members.push_back({static_cast<int>(n[0]), n[1]});
    for (int m = 0; m < body; m++, n += 2) p.body.push_back({static_cast<int>(n[0]), n[1]});
    patches_.push_back(p);
  }
  index_patches();
  alone_now_.clear();
  for (const double tag : in.rows("patch_alone", 1))
    if (here(static_cast<int>(tag)) >= 0) alone_now_.push_back(static_cast<int>(tag));
  const std::vector<double> &watched = in.common("patch_watched", counts[3]);
  watched_.assign(watched.begin(), watched.end());
  for (size_t k = 0; k < left.size(); k += 4) moved_[static_cast<int>(left[k])] = Vec(&left[k + 1]);
  looked_ = true;
}

}  // namespace LAMMPS_NS
