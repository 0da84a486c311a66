#include "wall/fix_wall_side.h"

#include <mpi.h>

#include <algorithm>

#include "atom.h"
#include "interfaces/checkpoint_file.h"
#include "comm.h"
#include "error.h"
#include "base/fix_input.h"
#include "neighbor.h"
#include "primitive_wall.h"
#include "update.h"

using namespace LAMMPS_NS;

/* --- the line of the deck ------------------------------------------------------------------------------------ */

// Returns the name of the file of sizes of agglomerates.
std::string FixWallSide::read_options(int narg, char **arg) {
  std::string agglomerates, forces;
  double at[6];
  input()
      .text("agglomerates", agglomerates)
      .text("forces", forces)
      .whole("every", every_, 1)
      .numbers("box", at, 6, Allowed::ANY)
      .read(arg, 3, position_of_contact(narg, arg), {"agglomerates", "forces", "every", "box"});
  box_ = {Vec(at[0], at[2], at[4]), Vec(at[1], at[3], at[5])};
  const Vec size = box_.high - box_.low;
  if (std::min({size.x, size.y, size.z}) != 0 || (size.x == 0) + (size.y == 0) + (size.z == 0) != 1)
    input().refuse("needs a box that is flat along one axis");
  if (comm->me == 0 && !(forces_ = std::fopen(forces.c_str(), "ab"))) error->one(FLERR, ("cannot write " + forces).c_str());
  return agglomerates;
}

FixWallSide::FixWallSide(LAMMPS *lmp, int narg, char **arg) : FixWall(lmp, narg, arg) {
  read_agglomerates(read_options(narg, arg));
  contact_ = std::make_unique<GranularContact>(lmp, *agglomerates_, *this, 0.0, id);
}

FixWallSide::~FixWallSide() {
  if (forces_) std::fclose(forces_);
}

/* --- the step ------------------------------------------------------------------------------------------------ */

void FixWallSide::setup(int vflag) {
  contact_->setup();
  rebuildPrimitiveNeighlist_ = true;
  if (resuming) return;
  pre_force(vflag);
  contact_->add_forces(near_, 0, vflag);  // the step that ends here was counted by the run before, or never was
}

Vec FixWallSide::from_box(int i) const { return LAMMPS_NS::from_wall(Vec(atom->x[i]), box_); }

// The stock wall looks for what is near z = 0.
void FixWallSide::list_near() {
  std::vector<double> z(atom->nlocal);
  for (int i = 0; i < atom->nlocal; i++) {
    z[i] = atom->x[i][2];
    atom->x[i][2] = norm(from_box(i));
  }
  primitiveWall_->buildNeighList(neighbor->skin, atom->x, atom->radius, atom->nlocal);
  for (int i = 0; i < atom->nlocal; i++) atom->x[i][2] = z[i];
  take_list_of_stock_wall();
}

void FixWallSide::post_force(int vflag) {
  contact_->add_forces(near_, 0, vflag);
  add_half_work();
  add_pushes();
}

void FixWallSide::end_of_step() {
  std::vector<double> beside;  // a contact alone gives nothing but its force
  contact_->end_of_step(near_, beside);
  if (update->ntimestep == row_end_) write_row();
}

// While all bodies fly, time jumps and nothing pushes.
void FixWallSide::add_pushes() {
  const bigint now = update->ntimestep, end = (now + every_ - 1) / every_ * every_;
  if (end != row_end_) write_row();
  row_end_ = end;
  for (const NearSphere &p : near_)
    if (p.touches) pushed_ += -1 * Vec(p.force);
}

void FixWallSide::write_row() {
  Vec sum = pushed_;
  pushed_ = Vec();
  if (comm->nprocs > 1) {
    const Vec mine = sum;
    MPI_Reduce(&mine.x, &sum.x, 3, MPI_DOUBLE, MPI_SUM, 0, world);
  }
  if (!forces_ || norm(sum) == 0) return;
  const long long step = row_end_;
  const Vec mean = 1.0 / every_ * sum;
  if (std::fwrite(&step, 8, 1, forces_) != 1 || std::fwrite(&mean.x, 8, 3, forces_) != 3)
    error->one(FLERR, "cannot write the forces on a wall");
}

void FixWallSide::flush() {
  if (forces_ && std::fflush(forces_) != 0) error->one(FLERR, "cannot write the forces on a wall");
}

void FixWallSide::add_to(LedgerRows &rows) {
  rows.add(WALL_WORK, work_on_stone_);
  contact_->add_energies(rows, near_);
}

/* --- checkpoint ---------------------------------------------------------------------------------------------- */

void FixWallSide::save(CheckpointWriter &out) {
  flush();
  const std::string name = id;
  contact_->save(out, near_);
  out.sum(name + "_pushed", {pushed_.x, pushed_.y, pushed_.z});
  out.common(name + "_row_end", {static_cast<double>(row_end_)});
  save_wall(out, name + "_work", name + "_contacts");
}

void FixWallSide::restore(const CheckpointReader &in) {
  const std::string name = id;
  contact_->restore(in);
  pushed_ = Vec(in.sum(name + "_pushed", 3).data());
  row_end_ = static_cast<bigint>(in.common(name + "_row_end", 1)[0]);
  restore_wall(in, name + "_work", name + "_contacts");
}
