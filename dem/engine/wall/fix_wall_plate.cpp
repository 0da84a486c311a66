#include "wall/fix_wall_plate.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "atom.h"
#include "interfaces/checkpoint_file.h"
#include "comm.h"
#include "base/fix_input.h"
#include "neighbor.h"
#include "primitive_wall.h"
#include "smooth/smooth_contact.h"
#include "update.h"

using namespace LAMMPS_NS;

namespace {

const double LEAST_LISTED_REACH_M = 1e-3;

}  // namespace

/* --- the line of the deck ------------------------------------------------------------------------------------ */

struct FixWallPlate::Options {
  std::string agglomerates, forces, contacts, shapes, to_plate, from_plate, surface, faces;
  double yield_pressure_Pa = 0;  // 0: the plate stays elastic
  int row_steps = 0;             // of a row of forces; 0: a co-step
  WeakContact weak;
};

FixWallPlate::Options FixWallPlate::read_options(int narg, char **arg) {
  Options o;
  FixInput input = FixWall::input();
  input.text("agglomerates", o.agglomerates)
      .text("forces", o.forces)
      .numbers("extent", extent_, 4, Allowed::ANY)
      .whole("co_step", co_step_, 1)
      .whole("rows", o.row_steps, 1)
      .text("contacts", o.contacts)
      .whole("every", contacts_every_, 1)
      .text("surface", o.surface)
      .text("faces", o.faces)
      .number("yield_pressure", o.yield_pressure_Pa, Allowed::ABOVE_0)
      .text("shapes", o.shapes)
      .text("to_plate", o.to_plate)
      .text("from_plate", o.from_plate)
      .words("weak_contact", 4, [&](char **words, int) {
        o.weak = {input.number("weak_contact", words[0], Allowed::ABOVE_0),
                  input.number("weak_contact", words[1], Allowed::ABOVE_0), input.whole("weak_contact", words[2], 1),
                  input.whole("weak_contact", words[3], 1)};
      })
      .read(arg, 3, position_of_contact(narg, arg), {"agglomerates", "forces", "extent", "co_step"});
  if (!(extent_[0] < extent_[1] && extent_[2] < extent_[3]))
    input.refuse("extent: must be XMIN < XMAX and YMIN < YMAX");
  if (o.row_steps == 0) o.row_steps = co_step_;
  if (o.row_steps % co_step_ != 0) input.refuse("needs rows in whole co-steps");
  if (o.shapes.empty() != o.to_plate.empty() || o.shapes.empty() != o.from_plate.empty())
    input.refuse("shapes, to_plate and from_plate go together");
  if (!o.faces.empty() && !o.surface.empty()) input.refuse("has either a surface of smooth stones or faces");
  return o;
}

FixWallPlate::FixWallPlate(LAMMPS *lmp, int narg, char **arg) : FixWall(lmp, narg, arg) {
  const Options o = read_options(narg, arg);
  read_agglomerates(o.agglomerates);
  work_on_plate_ = work_on_stone_;
  if (!o.shapes.empty())
    coupling_ = std::make_unique<PlateCoupling>(lmp, o.shapes, o.to_plate, o.from_plate, co_step_, o.weak);
  recorder_ = std::make_unique<ContactRecorder>(lmp, *agglomerates_, o.forces, o.contacts, co_step_, o.row_steps);
  if (o.surface.empty())
    contact_ = std::make_unique<GranularContact>(lmp, *agglomerates_, *this, o.yield_pressure_Pa, "wall", o.faces);
  else
    contact_ = std::make_unique<SmoothContact>(lmp, *agglomerates_, *this, *this, o.yield_pressure_Pa, o.surface);
  if (coupling_) coupling_->set_extent(extent_);
  if (const SphereMemory *memory = contact_->memory()) {
    create_attribute = 1;
    comm->maxexchange_fix += memory->columns();
    atom->add_callback(0);
  }
}

FixWallPlate::~FixWallPlate() {
  if (contact_->memory()) atom->delete_callback(id, 0);
}

/* --- the step ------------------------------------------------------------------------------------------------ */

void FixWallPlate::setup(int vflag) {
  contact_->setup();
  if (coupling_) coupling_->setup();
  step_in_co_step_ = 0;
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

void FixWallPlate::list_near() {
  listed_reach_ = coupling_ ? std::max(LEAST_LISTED_REACH_M, 2 * coupling_->reach()) : 0;
  const double listed = neighbor->skin + listed_reach_ + contact_->listed_height();
  primitiveWall_->buildNeighList(listed, atom->x, atom->radius, atom->nlocal);
  take_list_of_stock_wall();
  const size_t n = near_.size();
  for (const int tag : contact_->always_listed()) {
    const int i = atom->map(tag);
    const bool is_listed = std::any_of(near_.begin(), near_.begin() + n, [i](const NearSphere &p) { return p.i == i; });
    if (i < 0 || i >= atom->nlocal || is_listed) continue;
    near_.emplace_back();
    near_.back().i = i;
  }
  contact_->list(near_);
  if (coupling_) coupling_->list(near_);
}

// The plate reaches farther than the list. What touches goes on as it is, since its step has not ended: half of its
// work and the coming half of its force are still to be counted.
void FixWallPlate::list_farther() {
  std::unordered_map<int, NearSphere> known;
  for (const NearSphere &p : near_)
    if (p.touches) known[p.i] = p;
  list_near();
  for (NearSphere &p : near_) {
    const auto found = known.find(p.i);
    if (found != known.end()) p = found->second;
  }
}

void FixWallPlate::post_force(int vflag) {
  if (coupling_) coupling_->place(near_, step_in_co_step_);
  contact_->add_forces(near_, plate_reach(), vflag);
  add_work();

  // The mean over a co-step is the trapezoidal one, which is the impulse that the integrator gives to the stones.
  const bool at_end = step_in_co_step_ == co_step_;
  add_forces(at_end || step_in_co_step_ == 0 ? 0.5 : 1.0);
  if (at_end) {
    end_co_step(false);
    add_forces(0.5);
  }
}

void FixWallPlate::add_work() {
  const double dt = update->dt;
  add_half_work();
  for (const NearSphere &p : near_) {
    if (!p.touches) continue;
    work_on_plate_[agglomerates_->of_tag(atom->tag[p.i])] -=
        dt * (p.push * p.plate_v + p.drag[0] * p.plate_drift[0] + p.drag[1] * p.plate_drift[1]);
  }
}

void FixWallPlate::post_integrate() {
  FixWall::post_integrate();
  step_in_co_step_++;
}

void FixWallPlate::add_forces(double weight) {
  const double share = weight / co_step_;
  recorder_->add_forces(near_, share);
  if (coupling_) coupling_->add_forces(near_, share);
}

void FixWallPlate::end_co_step(bool first) {
  if (!first) recorder_->end_co_step();
  step_in_co_step_ = 0;
  if (!coupling_ || !coupling_->end_co_step(near_, first)) return;
  if (coupling_->reach() > listed_reach_) list_farther();
  coupling_->predict(near_);
}

void FixWallPlate::end_of_step() {
  contact_->end_of_step(near_, work_on_stone_);
  if (update->ntimestep % contacts_every_ == 0) recorder_->record_contacts(near_, *contact_);
}

void FixWallPlate::post_run() {
  recorder_->flush();
  if (coupling_) coupling_->finish();
}

// To the centre of a sub-sphere, from the nearest point of the plate's top face with its edge. What is below the face
// came past the edge.
Vec FixWallPlate::from_wall(const NearSphere &p) const {
  const double *at = atom->x[p.i], *e = extent_, z = at[2] - (p.plate_z + p.plate_moved.z);
  const double x[2] = {at[0] - p.plate_moved.x, at[1] - p.plate_moved.y};
  double across[2];
  for (int d = 0; d < 2; d++) across[d] = x[d] - std::clamp(x[d], e[2 * d], e[2 * d + 1]);
  if (z < 0 && across[0] == 0 && across[1] == 0) {
    const double to_edge[4] = {x[0] - e[0], x[0] - e[1], x[1] - e[2], x[1] - e[3]};
    const int nearest = std::min_element(to_edge, to_edge + 4, [](double a, double b) {
                          return std::fabs(a) < std::fabs(b);
                        }) - to_edge;
    across[nearest / 2] = to_edge[nearest];
  }
  return Vec(across[0], across[1], z);
}

/* --- for the ledger and for bodies in free flight ------------------------------------------------------------ */

void FixWallPlate::add_to(LedgerRows &rows) {
  rows.add(WALL_WORK, work_on_stone_);
  rows.add(PLATE_WORK, work_on_plate_);
  contact_->add_to(rows, near_);
}

bool FixWallPlate::is_pushed() const {
  return std::any_of(near_.begin(), near_.end(), [](const NearSphere &p) { return p.touches && p.push != 0; });
}

std::vector<double> FixWallPlate::contacts_now() const { return recorder_->contacts(near_, *contact_); }

void FixWallPlate::skip(long long co_steps) {
  if (coupling_) coupling_->skip(co_steps);
}

void FixWallPlate::ask_reach() {
  if (coupling_) coupling_->ask_reach();
}

/* --- what the contact law remembers of a sub-sphere travels with it ------------------------------------------ */

void FixWallPlate::grow_arrays(int nmax) { contact_->memory()->grow_arrays(nmax); }

void FixWallPlate::copy_arrays(int i, int j, int) { contact_->memory()->copy_arrays(i, j); }

void FixWallPlate::set_arrays(int i) { contact_->memory()->set_arrays(i); }

int FixWallPlate::pack_exchange(int i, double *buf) { return contact_->memory()->pack_exchange(i, buf); }

int FixWallPlate::unpack_exchange(int i, double *buf) { return contact_->memory()->unpack_exchange(i, buf); }

/* --- checkpoint ---------------------------------------------------------------------------------------------- */

void FixWallPlate::save(CheckpointWriter &out) {
  recorder_->save(out);
  if (coupling_) coupling_->save(out);
  contact_->save(out, near_);
  out.sum("wall_work_on_plate", work_on_plate_);
  out.common("wall_step_in_co_step", {static_cast<double>(step_in_co_step_)});
  save_wall(out, "wall_work_on_stone", "wall_contacts");
}

void FixWallPlate::restore(const CheckpointReader &in) {
  recorder_->restore(in);
  if (coupling_) coupling_->restore(in);
  contact_->restore(in);
  work_on_plate_ = in.sum("wall_work_on_plate", work_on_plate_.size());
  step_in_co_step_ = static_cast<int>(in.common("wall_step_in_co_step", 1)[0]);
  restore_wall(in, "wall_work_on_stone", "wall_contacts");
}

void FixWallPlate::saved(long long step) {
  if (coupling_) coupling_->saved(step);
}
