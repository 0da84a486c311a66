#include "bonds/fix_bond_parallel.h"

#include <mpi.h>

#include <algorithm>
#include <cstring>

#include "atom.h"
#include "base/fix_input.h"
#include "comm.h"
#include "domain.h"
#include "force.h"
#include "interfaces/checkpoint_file.h"
#include "memory.h"

using namespace LAMMPS_NS;
using namespace FixConst;

namespace {
const int STATE_COLUMNS = 13;  // of each sub-sphere in a checkpoint

BondMaterial material_of(const FixInput &input, char **words) {
  BondMaterial m;
  double *const above_0[] = {&m.modulus, &m.stiffness_ratio, &m.tensile_strength, &m.shear_strength};
  for (int k = 0; k < 4; k++) *above_0[k] = input.number("material", words[k], Allowed::ABOVE_0);
  m.tan_friction = input.number("material", words[4], Allowed::FROM_0);
  return m;
}

BondMaterial &last_of(std::vector<BondMaterial> &materials, const FixInput &input) {
  if (materials.empty()) input.refuse("dilatation and fracture must follow their material");
  return materials.back();
}

}  // namespace

FixBondParallel::FixBondParallel(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg) {
  std::string bonds, agglomerates, events, kernel_name = "auto";
  double damping_time = 0;
  std::vector<BondMaterial> materials;
  FixInput input(lmp, this);
  input.text("bonds", bonds)
      .text("agglomerates", agglomerates)
      .text("events", events)
      .number("damping_time", damping_time, Allowed::FROM_0)
      .text("kernel", kernel_name)
      .words("material", 5, [&](char **words, int) { materials.push_back(material_of(input, words)); })
      .words("dilatation", 3, [&](char **words, int) {
        BondMaterial &m = last_of(materials, input);
        m.volumetric_modulus = input.number("dilatation", words[0], Allowed::FROM_0);
        m.strengthening = input.number("dilatation", words[1], Allowed::FROM_0);
        m.threshold_share = input.number("dilatation", words[2], Allowed::FROM_0) / m.tensile_strength;
      })
      .words("fracture", 1, [&](char **words, int) {
        last_of(materials, input).fracture_energy = input.number("fracture", words[0], Allowed::ABOVE_0);
      })
      .read(arg, 3, narg, {"bonds", "agglomerates", "events", "material"});
  for (const BondMaterial &m : materials)
    if (m.softens() && m.threshold_share > 0)
      input.refuse("fracture: bonds that soften must have a dilatation whose pressure p0 is 0");
  std::unique_ptr<BondKernel> kernel = make_bond_kernel(kernel_name);
  if (!kernel) input.refuse("this processor has no kernel " + kernel_name);
  if (force->newton) input.refuse("needs `newton off`");

  rank_ = std::make_unique<RankBonds>(lmp, this, agglomerates, bonds, materials);
  longest_ = rank_->bonds.longest();
  forces_ = std::make_unique<BondForces>(lmp, *rank_, std::move(kernel), damping_time);
  energies_ = std::make_unique<BondEnergies>(lmp, *rank_, *forces_);
  failures_ = std::make_unique<BondFailures>(lmp, events, *rank_, *forces_, *energies_);
  bodies_ = std::make_unique<BondedBodies>(*rank_, *forces_, *energies_);

  restart_global = 1;  // so that it is asked, and refuses
  create_attribute = 1;
  comm_forward = comm_border = 4;
  scalar_flag = global_freq = 1;
  comm->maxexchange_fix += 4;
  grow_arrays(atom->nmax);
  atom->add_callback(0);
  for (int i = 0; i < atom->nlocal; i++) set_arrays(i);
}

FixBondParallel::~FixBondParallel() { atom->delete_callback(id, 0); }

int FixBondParallel::setmask() { return POST_INTEGRATE | PRE_NEIGHBOR | POST_FORCE; }

void FixBondParallel::init() {
  const FixInput input(lmp, this);
  rank_->agglomerates.init();
  if (comm->nprocs > 1 && !comm->ghost_velocity) input.refuse("needs `communicate single vel yes`");
  if (domain->xperiodic || domain->yperiodic || domain->zperiodic)
    input.refuse("needs a box without periodic boundaries, such as `boundary m m m`: no bond reaches across one");
}

// The step that ends here was counted by the run before, or never was.
void FixBondParallel::setup(int vflag) {
  rank_->local.list_anew();
  if (resuming) return;
  rebuild();
  energies_->without_work([&] { post_force(vflag); });
}

// Adds the second half of the work of the last forces, with the velocities of the coming step, then turns each
// sub-sphere by its spin over one step.
void FixBondParallel::post_integrate() {
  rank_->motion.know_before();
  energies_->add_work(1);
  rank_->motion.turn_on();
}

void FixBondParallel::pre_neighbor() {
  failures_->write_events();
  rebuild();
}

void FixBondParallel::rebuild() {
  rank_->bonds.agree();
  if (rank_->local.stands()) return;
  const SphereMotion::ByTag before = rank_->motion.before_by_tag();
  forces_->list(rank_->local.list());
  rank_->motion.take_before(before);
}

void FixBondParallel::post_force(int) {
  if (comm->nprocs > 1) comm->forward_comm_fix(this);
  rank_->motion.know_before();
  forces_->begin_step();
  if (rank_->bonds.volumes().needed()) {
    forces_->find_dilatations();
    sends_dilatations_ = true;
    if (comm->nprocs > 1) comm->forward_comm_fix(this);
    sends_dilatations_ = false;
  }
  for (int id : forces_->find()) failures_->add(id);
  energies_->add_work(-1);
  forces_->give();
  rank_->motion.step_is_done();
}

double FixBondParallel::compute_scalar() {
  if (comm->nprocs == 1)
    return std::count_if(bonds().begin(), bonds().end(), [&](const Bond &b) { return holds(b.id); });
  double mine = 0, all = 0;
  for (const LocalBond &b : rank_->local.all()) mine += holds(b.id) && b.i < atom->nlocal;
  MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, MPI_SUM, world);
  return all;
}

/* --- the quaternion travels with its sub-sphere -------------------------------------------------------------- */

void FixBondParallel::grow_arrays(int nmax) { memory->grow(rank_->motion.quaternion, nmax, 4, "bond/parallel"); }

void FixBondParallel::copy_arrays(int i, int j, int) {
  std::memcpy(rank_->motion.quaternion[j], rank_->motion.quaternion[i], 4 * sizeof(double));
}

void FixBondParallel::set_arrays(int i) {
  rank_->motion.quaternion[i][0] = 1;
  rank_->motion.quaternion[i][1] = rank_->motion.quaternion[i][2] = rank_->motion.quaternion[i][3] = 0;
}

int FixBondParallel::pack_border(int n, int *list, double *buf) {
  for (int k = 0; k < n; k++) std::memcpy(buf + 4 * k, rank_->motion.quaternion[list[k]], 4 * sizeof(double));
  return 4 * n;
}

int FixBondParallel::unpack_border(int n, int first, double *buf) {
  for (int k = 0; k < n; k++) std::memcpy(rank_->motion.quaternion[first + k], buf + 4 * k, 4 * sizeof(double));
  return 4 * n;
}

int FixBondParallel::pack_comm(int n, int *list, double *buf, int, int *) {
  if (sends_dilatations_) {
    for (int k = 0; k < n; k++) buf[k] = forces_->dilatation(list[k]);
    return 1;
  }
  pack_border(n, list, buf);
  return 4;
}

void FixBondParallel::unpack_comm(int n, int first, double *buf) {
  if (!sends_dilatations_) unpack_border(n, first, buf);
  else for (int k = 0; k < n; k++) forces_->dilatation(first + k) = buf[k];
}

void FixBondParallel::write_restart(FILE *) {
  FixInput(lmp, this).refuse("bonds are kept by fix checkpoint, not by LIGGGHTS' restart and write_restart");
}

/* --- checkpoint ---------------------------------------------------------------------------------------------- */

// The kernel sums in the order of its list.
void FixBondParallel::begin_anew() {
  rank_->local.list_anew();
  rank_->motion.forget();
}

void FixBondParallel::save(CheckpointWriter &out) {
  failures_->write_events();
  rank_->bonds.agree();
  energies_->save(out);
  rank_->bonds.save(out);
  std::vector<double> rows;
  rows.reserve(STATE_COLUMNS * static_cast<size_t>(atom->nlocal));
  std::vector<char> is_computed(atom->nlocal + atom->nghost, 0);
  for (int i : rank_->local.computed()) is_computed[i] = 1;
  for (int i = 0; i < atom->nlocal; i++) {
    const double *q = quaternion(i);
    const ForceRecord force = is_computed[i] ? forces_->on(i) : ForceRecord();
    rows.insert(rows.end(), {static_cast<double>(atom->tag[i]), static_cast<double>(is_computed[i]),
                             static_cast<double>(rank_->local.is_turned(i))});
    rows.insert(rows.end(), q, q + 4);
    rows.insert(rows.end(), force.f, force.f + 3);
    rows.insert(rows.end(), force.torque, force.torque + 3);
  }
  out.rows("bond_atoms", rows);
}

void FixBondParallel::restore(const CheckpointReader &in) {
  energies_->restore(in);
  rank_->bonds.restore(in);
  forces_->clear();
  const std::vector<double> &rows = in.rows("bond_atoms", STATE_COLUMNS);
  std::vector<int> computed;
  std::vector<char> is_turned(atom->nlocal, 0);
  for (size_t k = 0; k < rows.size(); k += STATE_COLUMNS) {
    const int i = atom->map(static_cast<int>(rows[k]));
    if (i < 0 || i >= atom->nlocal) continue;
    if (rows[k + 1] != 0) computed.push_back(i);
    is_turned[i] = rows[k + 2] != 0;
    std::copy_n(&rows[k + 3], 4, rank_->motion.quaternion[i]);
    std::copy_n(&rows[k + 7], 3, forces_->on(i).f);
    std::copy_n(&rows[k + 10], 3, forces_->on(i).torque);
  }
  rank_->local.restore(computed, is_turned);
}
