#include "fix_bond_parallel.h"

#include <mpi.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

#include "atom.h"
#include "checkpoint_file.h"
#include "comm.h"
#include "error.h"
#include "force.h"
#include "memory.h"
#include "modify.h"
#include "rigid_motion.h"
#include "update.h"

using namespace LAMMPS_NS;
using namespace FixConst;

FixBondParallel::FixBondParallel(LAMMPS *lmp, int narg, char **arg)
    : Fix(lmp, narg, arg), quaternion_(nullptr), damping_time_(0) {
  std::string bonds, agglomerates, kernel = "auto";
  for (int k = 3; k < narg;) {
    const std::string key = arg[k++];
    const int needed = key == "material" ? 5 : 1;
    if (k + needed > narg) error->fix_error(FLERR, this, "a keyword lacks its value");
    if (key == "bonds") bonds = arg[k];
    else if (key == "agglomerates") agglomerates = arg[k];
    else if (key == "events") events_file_ = arg[k];
    else if (key == "damping_time") damping_time_ = force->numeric(FLERR, arg[k]);
    else if (key == "kernel") kernel = arg[k];
    else if (key == "material") {
      BondMaterial m;
      m.modulus = force->numeric(FLERR, arg[k]);
      m.stiffness_ratio = force->numeric(FLERR, arg[k + 1]);
      m.tensile_strength = force->numeric(FLERR, arg[k + 2]);
      m.shear_strength = force->numeric(FLERR, arg[k + 3]);
      m.tan_friction = force->numeric(FLERR, arg[k + 4]);
      if (m.tensile_strength <= 0) error->fix_error(FLERR, this, "the tensile strength must be above 0");
      materials_.push_back(m);
    } else error->fix_error(FLERR, this, ("unknown keyword " + key).c_str());
    k += needed;
  }
  if (bonds.empty() || agglomerates.empty() || events_file_.empty())
    error->fix_error(FLERR, this, "needs the files bonds, agglomerates and events");
  kernel_ = make_bond_kernel(kernel);
  if (!kernel_) error->fix_error(FLERR, this, ("this processor has no kernel " + kernel).c_str());
  if (force->newton) error->fix_error(FLERR, this, "needs `newton off`");
  if (!atom->tag_enable || !atom->map_style) error->fix_error(FLERR, this, "needs `atom_modify map array`");

  bonds_ = read_bonds(lmp, bonds, materials_);
  for (const Bond &b : bonds_) longest_ = std::max(longest_, b.length);
  intact_.assign(bonds_.size(), 1);
  broken_.resize(bonds_.size());
  agglomerates_ = std::make_unique<Agglomerates>(lmp, agglomerates);
  work_.assign(agglomerates_->count(), 0);
  released_ = broken_count_ = work_;

  restart_global = restart_peratom = 1;
  create_attribute = 1;
  comm_forward = comm_border = 4;
  scalar_flag = global_freq = 1;
  comm->maxexchange_fix += 4;
  grow_arrays(atom->nmax);
  atom->add_callback(0);
  atom->add_callback(1);
  for (int i = 0; i < atom->nlocal; i++) set_arrays(i);

  if (comm->me == 0) {
    FILE *out = std::fopen(events_file_.c_str(), "a");
    if (!out) error->one(FLERR, ("cannot write " + events_file_).c_str());
    if (std::ftell(out) == 0)
      std::fputs("step,bond,agglomerate,x_m,y_m,z_m,mode,stress_Pa,energy_J,area_m2\n", out);
    std::fclose(out);
  }
}

FixBondParallel::~FixBondParallel() {
  atom->delete_callback(id, 0);
  atom->delete_callback(id, 1);
  memory->destroy(quaternion_);
}

int FixBondParallel::setmask() { return POST_INTEGRATE | PRE_NEIGHBOR | POST_FORCE; }

void FixBondParallel::init() {
  if (comm->nprocs > 1 && !comm->ghost_velocity) error->fix_error(FLERR, this, "needs `communicate single vel yes`");
}

void FixBondParallel::setup(int vflag) {
  listed_ = false;
  if (resuming) return;
  rebuild();
  // The step that ends here was counted by the run before, or never was; see add_work.
  const std::vector<double> counted = work_;
  post_force(vflag);
  work_ = counted;
}

// A bond must be seen by each rank that owns one of its ends.
double FixBondParallel::extend_cut_ghost() {
  return 1.5 * longest_;
}

// Second half of the work of the last forces, with the velocities of the coming step, then the turn of each
// sub-sphere by its spin over one step: q <- exp(omega dt/2) q, exact for constant omega.
void FixBondParallel::post_integrate() {
  double *const *v = atom->v, *const *omega = atom->omega;
  add_work(0.5 * update->dt, [&](int i) {
    const ForceRecord &g = forces_[i];
    return g.f[0] * v[i][0] + g.f[1] * v[i][1] + g.f[2] * v[i][2] + g.torque[0] * omega[i][0] +
           g.torque[1] * omega[i][1] + g.torque[2] * omega[i][2];
  });
  for (int i = 0; i < atom->nlocal; i++) turn(quaternion_[i], omega[i], 0.5 * update->dt);
}

// q <- exp(omega half_dt) q. With a = |omega| half_dt: cos a and sin(a)/a as series in a^2, whose next terms are below
// 1e-18 for a < 0.05; sub-spheres that turn faster in a step, which no stable run has, take the functions.
void FixBondParallel::turn(double *q, const double *omega, double half_dt) {
  const double a2 = half_dt * half_dt * (omega[0] * omega[0] + omega[1] * omega[1] + omega[2] * omega[2]);
  double c = 1 - a2 * (1. / 2) * (1 - a2 * (1. / 12) * (1 - a2 * (1. / 30) * (1 - a2 * (1. / 56))));
  double s = half_dt * (1 - a2 * (1. / 6) * (1 - a2 * (1. / 20) * (1 - a2 * (1. / 42) * (1 - a2 * (1. / 72)))));
  if (a2 > 2.5e-3) c = std::cos(std::sqrt(a2)), s = half_dt * std::sin(std::sqrt(a2)) / std::sqrt(a2);
  const double u0 = s * omega[0], u1 = s * omega[1], u2 = s * omega[2];
  const double q0 = q[0], q1 = q[1], q2 = q[2], q3 = q[3];
  q[0] = c * q0 - u0 * q1 - u1 * q2 - u2 * q3;
  q[1] = c * q1 + u0 * q0 + u1 * q3 - u2 * q2;
  q[2] = c * q2 + u1 * q0 + u2 * q1 - u0 * q3;
  q[3] = c * q3 + u2 * q0 + u0 * q2 - u1 * q1;
}

// Adds time x power(i) of every owned sub-sphere to the work of its agglomerate. Neighbours in memory mostly belong to
// the same one, so the sum is kept in a register until that changes.
template <class Power> void FixBondParallel::add_work(double time, Power power) {
  int home = 0;
  double sum = 0;
  for (int i = 0; i < atom->nlocal; i++) {
    const int a = agglomerates_->of_tag(atom->tag[i]);
    if (a != home) work_[home] += time * sum, sum = 0, home = a;
    sum += power(i);
  }
  work_[home] += time * sum;
}

void FixBondParallel::pre_neighbor() {
  write_events();
  rebuild();
}

void FixBondParallel::post_run() { write_events(); }

// The kernel's list of bonds by local index. Nothing to do while nothing moved in memory.
void FixBondParallel::rebuild() {
  if (comm->nprocs > 1) share_broken();
  const int nlocal = atom->nlocal;
  const bool same = listed_ && static_cast<int>(known_tags_.size()) == nlocal &&
                    std::equal(known_tags_.begin(), known_tags_.end(), atom->tag);
  if (same && comm->nprocs == 1) return;
  listed_ = true;
  known_tags_.assign(atom->tag, atom->tag + nlocal);

  local_.clear();
  for (int k = 0; k < bond_count(); k++) {
    if (!intact_[k]) continue;
    const int i = atom->map(bonds_[k].tag_i), j = atom->map(bonds_[k].tag_j);
    const bool mine = (i >= 0 && i < nlocal) || (j >= 0 && j < nlocal);
    if (bodies_may_leave_ && i < 0 && j < 0) continue;
    if (comm->nprocs == 1 && (i < 0 || j < 0)) error->one(FLERR, "A bonded sub-sphere was lost");
    if (!mine) continue;
    if (i < 0 || j < 0) error->one(FLERR, "A bonded sub-sphere is beyond the ghost atoms of this rank");
    local_.push_back({i, j, k, &bonds_[k]});
  }
  kernel_->build(local_, nlocal + atom->nghost);
}

// With ranks, each one finds the bonds it computes broken; all must know before bonds change hands.
void FixBondParallel::share_broken() {
  int mine = newly_broken_.size(), total = 0;
  std::vector<int> count(comm->nprocs), offset(comm->nprocs);
  MPI_Allgather(&mine, 1, MPI_INT, count.data(), 1, MPI_INT, world);
  for (int p = 0; p < comm->nprocs; p++) offset[p] = total, total += count[p];
  std::vector<int> all(total);
  MPI_Allgatherv(newly_broken_.data(), mine, MPI_INT, all.data(), count.data(), offset.data(), MPI_INT, world);
  for (int id : all) intact_[id] = 0;
  newly_broken_.clear();
}

AtomRecord FixBondParallel::record(int i) const {
  AtomRecord r;
  for (int k = 0; k < 3; k++) r.x[k] = atom->x[i][k];
  for (int k = 0; k < 4; k++) r.q[k] = quaternion_[i][k];
  return r;
}

AtomRecord FixBondParallel::half_a_step_ago(int i) const {
  AtomRecord r = record(i);
  for (int k = 0; k < 3; k++) r.x[k] -= 0.5 * update->dt * atom->v[i][k];
  turn(r.q, atom->omega[i], -0.25 * update->dt);
  return r;
}

void FixBondParallel::fill_records() {
  const int nall = atom->nlocal + atom->nghost;
  atoms_.resize(nall + 2);
  forces_.resize(nall + 2);
  if (damping_time_ > 0) fill_delayed_records(nall);
  else
    for (int i = 0; i < nall; i++) atoms_[i] = record(i);
  atoms_[nall] = {{0, 0, 0}, {1, 0, 0, 0}, 0};  // the two ends of the empty lanes of the last pack
  atoms_[nall + 1] = {{1, 0, 0}, {1, 0, 0, 0}, 0};
  std::memset(static_cast<void *>(forces_.data()), 0, forces_.size() * sizeof(ForceRecord));
}

// At x + tau v and q + tau dq/dt, dq/dt = omega q / 2.
void FixBondParallel::fill_delayed_records(int nall) {
  const double tau = damping_time_, half_tau = 0.5 * tau;
  double *const *x = atom->x, *const *v = atom->v, *const *omega = atom->omega;
  for (int i = 0; i < nall; i++) {
    AtomRecord &r = atoms_[i];
    const double *q = quaternion_[i];
    const double u0 = half_tau * omega[i][0], u1 = half_tau * omega[i][1], u2 = half_tau * omega[i][2];
    const double c = 1 - 0.5 * (u0 * u0 + u1 * u1 + u2 * u2);  // keeps |q| = 1 to fourth order
    for (int k = 0; k < 3; k++) r.x[k] = x[i][k] + tau * v[i][k];
    r.q[0] = c * (q[0] - u0 * q[1] - u1 * q[2] - u2 * q[3]);
    r.q[1] = c * (q[1] + u0 * q[0] + u1 * q[3] - u2 * q[2]);
    r.q[2] = c * (q[2] + u1 * q[0] + u2 * q[1] - u0 * q[3]);
    r.q[3] = c * (q[3] + u2 * q[0] + u0 * q[2] - u1 * q[1]);
  }
}

void FixBondParallel::post_force(int) {
  if (comm->nprocs > 1) comm->forward_comm_fix(this);
  fill_records();
  const int n_broken = kernel_->add_forces(atoms_.data(), forces_.data(), broken_.data());
  if (n_broken) note_broken(n_broken);

  double *const *v = atom->v, *const *omega = atom->omega, **f = atom->f, **torque = atom->torque;
  add_work(0.5 * update->dt, [&](int i) {
    const ForceRecord &g = forces_[i];
    double sum = 0;
    for (int k = 0; k < 3; k++) {
      f[i][k] += g.f[k];
      torque[i][k] += g.torque[k];
      sum += g.f[k] * v[i][k] + g.torque[k] * omega[i][k];
    }
    return sum;
  });
}

void FixBondParallel::note_broken(int n) {
  char line[256];
  for (int k = 0; k < n; k++) {
    const int b = broken_[k];
    const Bond &bond = bonds_[b];
    const int i = atom->map(bond.tag_i), j = atom->map(bond.tag_j);
    intact_[b] = 0;
    if (comm->nprocs > 1) newly_broken_.push_back(b);
    if (i >= atom->nlocal) continue;  // the rank that owns i reports
    // The kernel judges at x + tau v, damping included; so does the event. The energy is the one
    // stored half a step ago: the last work that the leapfrog scheme put in had the force of the step before.
    const BondState judged = bond_state(bond, atoms_[i], atoms_[j]);
    const double energy = bond_state(bond, half_a_step_ago(i), half_a_step_ago(j)).energy;
    const int a = agglomerates_->of_tag(bond.tag_i);
    const bool shear = judged.mode == SHEAR;
    released_[a] += energy;
    broken_count_[a] += 1;
    std::snprintf(line, sizeof line, BIGINT_FORMAT ",%d,%d,%.9g,%.9g,%.9g,%s,%.9g,%.9g,%.9g\n", update->ntimestep,
                  b + 1, a + 1, 0.5 * (atom->x[i][0] + atom->x[j][0]), 0.5 * (atom->x[i][1] + atom->x[j][1]),
                  0.5 * (atom->x[i][2] + atom->x[j][2]), shear ? "shear" : "tension",
                  shear ? judged.shear : judged.tension, energy, bond.area);
    events_ += line;
  }
}

void FixBondParallel::write_events() {
  int mine = events_.size();
  std::vector<int> count(comm->nprocs, mine), offset(comm->nprocs, 0);
  std::string all = events_;
  if (comm->nprocs > 1) {
    MPI_Gather(&mine, 1, MPI_INT, count.data(), 1, MPI_INT, 0, world);
    for (int p = 1; p < comm->nprocs; p++) offset[p] = offset[p - 1] + count[p - 1];
    if (comm->me == 0) all.resize(offset.back() + count.back());
    MPI_Gatherv(events_.data(), mine, MPI_CHAR, &all[0], count.data(), offset.data(), MPI_CHAR, 0, world);
  }
  events_.clear();
  if (comm->me != 0 || all.empty()) return;
  FILE *out = std::fopen(events_file_.c_str(), "a");
  const bool written = out && std::fwrite(all.data(), 1, all.size(), out) == all.size();
  if (!written || std::fclose(out) != 0) error->one(FLERR, ("cannot write " + events_file_).c_str());
}

void FixBondParallel::add_elastic_energy(double *energy) const {
  for (const LocalBond &b : local_) {
    if (!intact_[b.id] || b.i >= atom->nlocal) continue;
    energy[agglomerates_->of_tag(b.bond->tag_i)] += bond_state(*b.bond, record(b.i), record(b.j)).energy;
  }
}

const std::vector<int> &FixBondParallel::body_of_tag() {
  const double broken = std::accumulate(broken_count_.begin(), broken_count_.end(), 0.0);
  if (broken == broken_at_bodies_) return body_of_tag_;
  broken_at_bodies_ = broken;
  std::vector<int> &parent = body_of_tag_;
  parent.resize(agglomerates_->tags() + 1);
  std::iota(parent.begin(), parent.end(), 0);
  auto root = [&](int tag) {
    while (parent[tag] != tag) tag = parent[tag] = parent[parent[tag]];
    return tag;
  };
  for (int k = 0; k < bond_count(); k++) {
    if (!intact_[k]) continue;
    const int i = root(bonds_[k].tag_i), j = root(bonds_[k].tag_j);
    parent[std::max(i, j)] = std::min(i, j);
  }
  for (int tag = 1; tag <= agglomerates_->tags(); tag++) parent[tag] = root(tag);
  return parent;
}

void FixBondParallel::add_elastic_energy_by_body(double *energy) {
  const std::vector<int> &body = body_of_tag();
  for (const LocalBond &b : local_)
    if (intact_[b.id]) energy[body[b.bond->tag_i]] += bond_state(*b.bond, record(b.i), record(b.j)).energy;
}

void FixBondParallel::forget_forces(int i) { forces_[i] = ForceRecord(); }

void FixBondParallel::rotate(int i, const Rotation &turned) {
  double *q = quaternion_[i];
  const Rotation now = turned * Rotation{q[0], Vec(q + 1)};
  q[0] = now.w;
  now.v.to(q + 1);
}

double FixBondParallel::compute_scalar() {
  if (comm->nprocs == 1) return std::count(intact_.begin(), intact_.end(), 1);
  double mine = 0, all = 0;
  for (const LocalBond &b : local_) mine += intact_[b.id] && b.i < atom->nlocal;
  MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, MPI_SUM, world);
  return all;
}

/* --- the quaternion travels with its sub-sphere ------------------------------------------------------------- */

void FixBondParallel::grow_arrays(int nmax) { memory->grow(quaternion_, nmax, 4, "bond/parallel:quaternion"); }

void FixBondParallel::copy_arrays(int i, int j, int) { std::memcpy(quaternion_[j], quaternion_[i], 4 * sizeof(double)); }

void FixBondParallel::set_arrays(int i) {
  quaternion_[i][0] = 1;
  quaternion_[i][1] = quaternion_[i][2] = quaternion_[i][3] = 0;
}

int FixBondParallel::pack_exchange(int i, double *buf) {
  std::memcpy(buf, quaternion_[i], 4 * sizeof(double));
  return 4;
}

int FixBondParallel::unpack_exchange(int i, double *buf) {
  std::memcpy(quaternion_[i], buf, 4 * sizeof(double));
  return 4;
}

int FixBondParallel::pack_border(int n, int *list, double *buf) {
  for (int k = 0; k < n; k++) std::memcpy(buf + 4 * k, quaternion_[list[k]], 4 * sizeof(double));
  return 4 * n;
}

int FixBondParallel::unpack_border(int n, int first, double *buf) {
  for (int k = 0; k < n; k++) std::memcpy(quaternion_[first + k], buf + 4 * k, 4 * sizeof(double));
  return 4 * n;
}

int FixBondParallel::pack_comm(int n, int *list, double *buf, int, int *) {
  pack_border(n, list, buf);
  return 4;
}

void FixBondParallel::unpack_comm(int n, int first, double *buf) { unpack_border(n, first, buf); }

int FixBondParallel::pack_restart(int i, double *buf) {
  buf[0] = 5;
  std::memcpy(buf + 1, quaternion_[i], 4 * sizeof(double));
  return 5;
}

void FixBondParallel::unpack_restart(int nlocal, int nth) {
  double **extra = atom->extra;
  int m = 0;
  for (int k = 0; k < nth; k++) m += static_cast<int>(extra[nlocal][m]);
  std::memcpy(quaternion_[nlocal], &extra[nlocal][m + 1], 4 * sizeof(double));
}

int FixBondParallel::size_restart(int) { return 5; }
int FixBondParallel::maxsize_restart() { return 5; }

// Global part of a restart: sums by agglomerate and which bonds hold.
void FixBondParallel::write_restart(FILE *out) {
  if (comm->nprocs > 1) share_broken();
  const int n = agglomerates_->count();
  std::vector<double> mine, data(3 * n);
  for (const std::vector<double> *sum : {&work_, &released_, &broken_count_})
    mine.insert(mine.end(), sum->begin(), sum->end());
  MPI_Reduce(mine.data(), data.data(), 3 * n, MPI_DOUBLE, MPI_SUM, 0, world);
  data.insert(data.end(), intact_.begin(), intact_.end());
  if (comm->me != 0) return;
  const int size = data.size() * sizeof(double);
  std::fwrite(&size, sizeof(int), 1, out);
  std::fwrite(data.data(), sizeof(double), data.size(), out);
}

void FixBondParallel::restart(char *buf) {
  const double *data = reinterpret_cast<const double *>(buf);
  const int n = agglomerates_->count();
  if (comm->me == 0)
    for (std::vector<double> *sum : {&work_, &released_, &broken_count_}) {
      std::copy(data, data + n, sum->begin());
      data += n;
    }
  data = reinterpret_cast<const double *>(buf) + 3 * n;
  for (size_t b = 0; b < intact_.size(); b++) intact_[b] = data[b] != 0;
}

/* --- checkpoint --------------------------------------------------------------------------------------------------- */

void FixBondParallel::save(CheckpointWriter &out) {
  write_events();
  if (comm->nprocs > 1) share_broken();
  out.sum("bond_work", work_);
  out.sum("bond_released", released_);
  out.sum("bond_broken", broken_count_);
  out.common("bond_intact", std::vector<double>(intact_.begin(), intact_.end()));
  std::vector<double> rows;
  rows.reserve(11 * static_cast<size_t>(atom->nlocal));
  for (int i = 0; i < atom->nlocal; i++) {
    rows.push_back(atom->tag[i]);
    rows.insert(rows.end(), quaternion_[i], quaternion_[i] + 4);
    rows.insert(rows.end(), forces_[i].f, forces_[i].f + 3);
    rows.insert(rows.end(), forces_[i].torque, forces_[i].torque + 3);
  }
  out.rows("bond_atoms", rows);
}

void FixBondParallel::restore(const CheckpointReader &in) {
  const size_t n = agglomerates_->count();
  work_ = in.sum("bond_work", n);
  released_ = in.sum("bond_released", n);
  broken_count_ = in.sum("bond_broken", n);
  const std::vector<double> &intact = in.common("bond_intact", bonds_.size());
  for (size_t b = 0; b < intact_.size(); b++) intact_[b] = intact[b] != 0;
  forces_.assign(atom->nlocal + atom->nghost + 2, ForceRecord{});
  const std::vector<double> &rows = in.rows("bond_atoms", 11);
  for (size_t k = 0; k < rows.size(); k += 11) {
    const int i = atom->map(static_cast<int>(rows[k]));
    if (i < 0 || i >= atom->nlocal) continue;
    std::copy_n(&rows[k + 1], 4, quaternion_[i]);
    std::copy_n(&rows[k + 5], 3, forces_[i].f);
    std::copy_n(&rows[k + 8], 3, forces_[i].torque);
  }
}

double FixBondParallel::memory_usage() {
  return bonds_.size() * (sizeof(Bond) + sizeof(LocalBond) + 13 * sizeof(double) + 5 * sizeof(int)) +
         atoms_.size() * (sizeof(AtomRecord) + sizeof(ForceRecord) + 4 * sizeof(double));
}
