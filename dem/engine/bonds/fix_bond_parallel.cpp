#include "bonds/fix_bond_parallel.h"

#include <mpi.h>

#include <algorithm>
#include <cstring>

#include "atom.h"
#include "bonds/bonded_bodies.h"
#include "interfaces/checkpoint_file.h"
#include "comm.h"
#include "domain.h"
#include "error.h"
#include "base/fix_input.h"
#include "base/fixes.h"
#include "force.h"
#include "memory.h"
#include "base/quaternion.h"
#include "kernels/turn_all.h"
#include "update.h"
#include "base/vec.h"

using namespace LAMMPS_NS;
using namespace FixConst;

namespace {
// The rows of LIGGGHTS's arrays lie beside each other in memory; a rank may have none.
double *flat(double **rows) { return rows ? rows[0] : nullptr; }

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

FixBondParallel::FixBondParallel(LAMMPS *lmp, int narg, char **arg)
    : Fix(lmp, narg, arg), quaternion_(nullptr), damping_time_(0) {
  std::string bonds, agglomerates, events, kernel = "auto";
  FixInput input(lmp, this);
  input.text("bonds", bonds)
      .text("agglomerates", agglomerates)
      .text("events", events)
      .number("damping_time", damping_time_, Allowed::FROM_0)
      .text("kernel", kernel)
      .words("material", 5, [&](char **words, int) { materials_.push_back(material_of(input, words)); })
      .words("dilatation", 3, [&](char **words, int) {
        BondMaterial &m = last_of(materials_, input);
        m.volumetric_modulus = input.number("dilatation", words[0], Allowed::FROM_0);
        m.strengthening = input.number("dilatation", words[1], Allowed::FROM_0);
        m.threshold_share = input.number("dilatation", words[2], Allowed::FROM_0) / m.tensile_strength;
      })
      .words("fracture", 1, [&](char **words, int) {
        last_of(materials_, input).fracture_energy = input.number("fracture", words[0], Allowed::ABOVE_0);
      })
      .read(arg, 3, narg, {"bonds", "agglomerates", "events", "material"});
  for (const BondMaterial &m : materials_)
    if (m.softens() && m.threshold_share > 0)
      input.refuse("fracture: bonds that soften must have a dilatation whose pressure p0 is 0");
  kernel_ = make_bond_kernel(kernel);
  if (!kernel_) input.refuse("this processor has no kernel " + kernel);
  if (force->newton) input.refuse("needs `newton off`");

  agglomerates_ = std::make_unique<Agglomerates>(lmp, this, agglomerates);
  if (bonds != "none") bonds_ = read_bonds(input, bonds, materials_, *agglomerates_);
  for (const Bond &b : bonds_) longest_ = std::max(longest_, b.length);
  intact_.assign(bonds_.size(), 1);
  broken_.resize(bonds_.size());
  volumes_ = BondVolumes(agglomerates_->tags());
  volumes_.enter(bonds_);
  softening_.enter(bonds_);
  work_.assign(agglomerates_->count(), 0);
  released_ = damped_ = broken_count_ = work_;
  held_.assign(agglomerates_->tags() + 1, 0);

  restart_global = 1;  // so that it is asked, and refuses
  create_attribute = 1;
  comm_forward = comm_border = 4;
  scalar_flag = global_freq = 1;
  comm->maxexchange_fix += 4;
  grow_arrays(atom->nmax);
  atom->add_callback(0);
  for (int i = 0; i < atom->nlocal; i++) set_arrays(i);

  events_.open(lmp, events);
}

FixBondParallel::~FixBondParallel() {
  atom->delete_callback(id, 0);
  memory->destroy(quaternion_);
}

int FixBondParallel::setmask() { return POST_INTEGRATE | PRE_NEIGHBOR | POST_FORCE; }

void FixBondParallel::init() {
  const FixInput input(lmp, this);
  agglomerates_->init();
  if (comm->nprocs > 1 && !comm->ghost_velocity) input.refuse("needs `communicate single vel yes`");
  if (domain->xperiodic || domain->yperiodic || domain->zperiodic)
    input.refuse("needs a box without periodic boundaries, such as `boundary m m m`: no bond reaches across one");
}

void FixBondParallel::setup(int vflag) {
  listed_ = false;
  if (resuming) return;
  rebuild();
  // The step that ends here was counted by the run before, or never was; see add_work.
  const std::vector<double> counted = work_, damped = damped_;
  post_force(vflag);
  work_ = counted;
  damped_ = damped;
}

// A bond must be seen by each rank that owns one of its ends.
double FixBondParallel::extend_cut_ghost() {
  return 1.5 * longest_;
}

// Adds the second half of the work of the last forces, with the velocities of the coming step, then turns each
// sub-sphere by its spin over one step.
void FixBondParallel::post_integrate() {
  if (!knows_motion_) remember_motion();
  add_work(1);
  if (turned_.empty()) list_turned();
  for (const auto &[first, count] : turned_) turn_all(quaternion_[first], atom->omega[first], count, 0.5 * update->dt);
}

// Adds half a step's work of the forces to that of each agglomerate. Neighbours in memory mostly belong to the same one,
// so the sums are kept in registers until that changes.
//
// The damping makes a force F + tau dF/dt and takes -tau dF/dt . v. In a step from the forces F to F' that is
// tau/2 (F - F') . (u + v), with the velocities u of the step before and v of this one: exactly what bonds without memory
// take whose energy is quadratic. `side` is 1 with F and -1 with F'.
void FixBondParallel::add_work(int side) {
  const double half_dt = 0.5 * update->dt, half_tau = side * 0.5 * damping_time_;
  const double *v = flat(atom->v), *omega = flat(atom->omega);
  int home = 0;
  double power = 0, power_before = 0;
  auto count = [&] {
    work_[home] += half_dt * power, damped_[home] += half_tau * (power_before + power);
    power = power_before = 0;
  };
  for (int i : computed_) {
    if (i >= atom->nlocal) break;
    const int a = agglomerates_->of_tag(atom->tag[i]);
    if (a != home) count(), home = a;
    const ForceRecord &g = forces_[i];
    const Motion &u = before_[i];
    for (int k = 0; k < 3; k++) {
      power += g.f[k] * v[3 * i + k] + g.torque[k] * omega[3 * i + k];
      power_before += g.f[k] * u.v[k] + g.torque[k] * u.omega[k];
    }
  }
  count();
}

void FixBondParallel::pre_neighbor() {
  events_.write();
  rebuild();
}

void FixBondParallel::post_run() { events_.write(); }

void FixBondParallel::agree_on_broken() {
  if (comm->nprocs > 1) share_broken();
}

// Each rank finds the bonds broken that it computes; all ranks must know them before bonds change hands.
void FixBondParallel::share_broken() {
  int mine = newly_broken_.size(), total = 0;
  std::vector<int> count(comm->nprocs), offset(comm->nprocs);
  MPI_Allgather(&mine, 1, MPI_INT, count.data(), 1, MPI_INT, world);
  for (int p = 0; p < comm->nprocs; p++) offset[p] = total, total += count[p];
  std::vector<int> all(total);
  MPI_Allgatherv(newly_broken_.data(), mine, MPI_INT, all.data(), count.data(), offset.data(), MPI_INT, world);
  for (int id : all) changes_ += intact_[id], intact_[id] = 0;
  newly_broken_.clear();
  if (softening_.needed()) softening_.share(world, [&](int id) -> Bond & { return bond_of(id); });
}

namespace {
// Where a sub-sphere is after `time` with the velocities v and omega.
inline AtomRecord moved(const double *x, const double *q, const double *v, const double *omega, double time) {
  AtomRecord r;
  r.dilatation = 0;
  for (int k = 0; k < 3; k++) r.x[k] = x[k] + time * v[k];
  extrapolate(r.q, q, omega, 0.5 * time);
  return r;
}
}  // namespace

AtomRecord FixBondParallel::record(int i) const {
  return moved(atom->x[i], quaternion_[i], atom->v[i], atom->omega[i], 0);
}

// At x + s.now v + s.before u.
AtomRecord FixBondParallel::record(int i, const Shift &s) const {
  const Motion &u = before_[i];
  double v[3], omega[3];
  for (int k = 0; k < 3; k++) {
    v[k] = s.now * atom->v[i][k] + s.before * u.v[k];
    omega[k] = s.now * atom->omega[i][k] + s.before * u.omega[k];
  }
  return moved(atom->x[i], quaternion_[i], v, omega, 1);
}

void FixBondParallel::fill_records() {
  const int nall = atom->nlocal + atom->nghost;
  atoms_.resize(nall + 2);
  forces_.resize(nall + 2);
  const double *x = flat(atom->x), *q = flat(quaternion_), *v = flat(atom->v), *omega = flat(atom->omega);
  for (int i : computed_) atoms_[i] = moved(x + 3 * i, q + 4 * i, v + 3 * i, omega + 3 * i, damping_time_);
  atoms_[nall] = {{0, 0, 0}, {1, 0, 0, 0}, 0};  // the two ends of the empty lanes of the last pack
  atoms_[nall + 1] = {{1, 0, 0}, {1, 0, 0, 0}, 0};
  for (int i : computed_) forces_[i] = ForceRecord();
  forces_[nall] = forces_[nall + 1] = ForceRecord();
}

void FixBondParallel::post_force(int) {
  if (comm->nprocs > 1) comm->forward_comm_fix(this);
  fill_records();
  if (!knows_motion_) remember_motion();
  if (volumes_.needed()) find_dilatations();
  const int n_broken = kernel_->add_forces(atoms_.data(), forces_.data(), broken_.data());
  if (n_broken) note_broken(n_broken);

  add_work(-1);
  double *f = flat(atom->f), *torque = flat(atom->torque);
  for (int i : computed_) {
    if (i >= atom->nlocal) break;
    for (int k = 0; k < 3; k++) f[3 * i + k] += forces_[i].f[k], torque[3 * i + k] += forces_[i].torque[k];
  }
  remember_motion();
  knows_motion_ = true;
}

void FixBondParallel::remember_motion() {
  before_.resize(atom->nlocal + atom->nghost);
  const double *v = flat(atom->v), *omega = flat(atom->omega);
  for (int i : computed_)
    for (int k = 0; k < 3; k++) before_[i].v[k] = v[3 * i + k], before_[i].omega[k] = omega[3 * i + k];
}

// Of all sub-spheres, into their records. Bonds of a ghost may be unknown here: its own rank says.
void FixBondParallel::find_dilatations() {
  stretches_.resize(atoms_.size());
  for (int i : computed_) stretches_[i] = 0;
  std::fill(stretches_.end() - 2, stretches_.end(), 0.0);
  kernel_->add_stretches(atoms_.data(), stretches_.data());
  for (int i : computed_)
    if (i < atom->nlocal) atoms_[i].dilatation = volumes_.dilatation(atom->tag[i], stretches_[i]);
  if (comm->nprocs == 1) return;
  sends_dilatations_ = true;
  comm->forward_comm_fix(this);
  sends_dilatations_ = false;
}

// Without the share of the damping, of each sub-sphere of this rank, m^3.
std::vector<double> FixBondParallel::stretches_now() const {
  std::vector<double> sum(atom->nlocal + atom->nghost, 0.0);
  for (const LocalBond &b : local_) {
    if (!intact_[b.id] || !b.bond->material->feels_dilatation()) continue;
    const double stretch = b.bond->area * (norm(Vec(atom->x[b.j]) - Vec(atom->x[b.i])) - b.bond->length);
    sum[b.i] += stretch;
    sum[b.j] += stretch;
  }
  return sum;
}

double FixBondParallel::stretch(const Bond &b, const Shift &s) const {
  const AtomRecord from = record(atom->map(b.tag_i), s), to = record(atom->map(b.tag_j), s);
  return b.area * (norm(Vec(to.x) - Vec(from.x)) - b.length);
}

// What is lost, J, when a bond, which still counts, loses `share` of what it has: of its beam and of the dilatations of
// its ends, whose other bonds may be taken at another time. Those of a ghost are taken as when the bond was judged.
double FixBondParallel::lost_energy(const Bond &bond, double share, const Shift &s, const Shift &others) const {
  const int i = atom->map(bond.tag_i), j = atom->map(bond.tag_j);
  double energy = share * bond_state(bond, record(i, s), record(j, s)).energy;
  if (!bond.material->feels_dilatation()) return energy;
  const double own = stretch(bond, s);
  for (int end : {i, j}) {
    const int tag = atom->tag[end];
    double sum = own;
    if (end < atom->nlocal) {
      for (int other : volumes_.bonds_of(tag))
        if (intact_[other] && other != bond.id) sum += stretch(bond_of(other), others);
    } else sum += volumes_.stretch(tag, atoms_[end].dilatation) - stretch(bond, {damping_time_, 0});
    energy += volumes_.energy(tag, sum) - volumes_.energy(tag, sum - share * own);
  }
  return energy;
}

// Of a bond whose force fell by `share` at this step, J. Of the step before half was done with the force of then, and of
// the coming one half will be done with a dilatation which still has the bond. What add_work takes for damping has the
// fall of the force in it, which is none. All of it to second order in the step.
double FixBondParallel::release(const Bond &bond, double share) {
  const double dt = update->dt, tau = damping_time_;
  auto lost = [&](const Shift &s, const Shift &others) { return lost_energy(bond, share, s, others); };
  const Shift later = {0.5 * dt, 0}, earlier = {-0.5 * dt, 0};
  const Shift mean_later = {0.25 * dt, 0.25 * dt}, mean_earlier = {-0.25 * dt, -0.25 * dt};
  const double now = lost({0, 0}, {0, 0});
  const double energy = now - 0.5 * (lost(later, earlier) - lost(earlier, later));
  const double after = lost(mean_later, mean_later), before = lost(mean_earlier, mean_earlier);
  const double rate = (after - before) / dt, curvature = 4 * (before - 2 * now + after) / (dt * dt);
  const int a = agglomerates_->of_tag(bond.tag_i);
  released_[a] += energy;
  damped_[a] += tau * rate + 0.5 * tau * (tau - dt) * curvature;
  return energy;
}

void FixBondParallel::note_broken(int n) {
  for (int k = 0; k < n; k++)
    if (!soften(broken_[k])) break_bond(broken_[k]);
}

// Weakens a bond that failed, whose force of this step is not yet there, where it does not break.
bool FixBondParallel::soften(int id) {
  Bond &bond = bond_of(id);
  if (!bond.material->softens()) return false;
  const int i = atom->map(bond.tag_i), j = atom->map(bond.tag_j);
  const BondState judged = bond_state(bond, atoms_[i], atoms_[j]);
  const double left = softening_.yield(bond, judged.loading, judged.energy);
  if (left == 0) return false;
  if (i < atom->nlocal) softening_.spend(id, release(bond, 1 - left));  // else another rank counts it
  softening_.weaken(bond);
  add_to_ends(bond_state(bond, atoms_[i], atoms_[j]), forces_[i], forces_[j]);
  kernel_->revive({i, j, id, &bond});
  return true;
}

void FixBondParallel::break_bond(int b) {
  const Bond &bond = bond_of(b);
  const int i = atom->map(bond.tag_i), j = atom->map(bond.tag_j);
  const double energy = i < atom->nlocal ? release(bond, 1) : 0;
  intact_[b] = 0;
  changes_++;
  if (comm->nprocs > 1) newly_broken_.push_back(b);
  if (i >= atom->nlocal) return;  // the rank that owns i reports
  // The kernel judges at x + tau v, damping included; so does the event.
  const BondState judged = bond_state(bond, atoms_[i], atoms_[j]);
  const int a = agglomerates_->of_tag(bond.tag_i);
  const bool shear = judged.mode == SHEAR;
  broken_count_[a] += 1;
  char line[256];
  std::snprintf(line, sizeof line, BIGINT_FORMAT ",%d,%d,%.9g,%.9g,%.9g,%s,%.9g,%.9g,%.9g\n", update->ntimestep, b + 1,
                a + 1, 0.5 * (atom->x[i][0] + atom->x[j][0]), 0.5 * (atom->x[i][1] + atom->x[j][1]),
                0.5 * (atom->x[i][2] + atom->x[j][2]), shear ? "shear" : "tension",
                shear ? judged.shear : judged.tension, energy + softening_.spent(bond), softening_.area(bond));
  events_.add(line);
}

// add(tag, J) of each bond that this rank counts, and of each of its sub-spheres where the dilatation has energy.
template <class Add> void FixBondParallel::each_elastic_energy(Add add) const {
  for (const LocalBond &b : local_)
    if (intact_[b.id] && b.i < atom->nlocal) add(b.bond->tag_i, bond_state(*b.bond, record(b.i), record(b.j)).energy);
  if (!volumes_.needed()) return;
  const std::vector<double> stretch = stretches_now();
  for (int i = 0; i < atom->nlocal; i++) add(atom->tag[i], volumes_.energy(atom->tag[i], stretch[i]));
}

void FixBondParallel::add_to(LedgerRows &rows) {
  std::vector<double> elastic(agglomerates_->count(), 0.0);
  each_elastic_energy([&](int tag, double energy) { elastic[agglomerates_->of_tag(tag)] += energy; });
  rows.add(BOND_ELASTIC, elastic);
  rows.add(BOND_WORK, work_);
  rows.add(RELEASED, released_);
  rows.add(BOND_DAMPED, damped_);
  rows.add(BROKEN, broken_count_);
}

/* --- stones that come and go --------------------------------------------------------------------------------- */

// The bonds of each stone lie together, and the stones in ascending order, whenever each of them came.
void FixBondParallel::enter(const EnteringStone &stone) {
  const size_t count = stone.bonds.size() / EnteringStone::BOND_COLUMNS;
  std::vector<Bond> added;
  for (size_t k = 0; k < count; k++)
    added.push_back(bond_of_row(FixInput(lmp, this), &stone.bonds[k * EnteringStone::BOND_COLUMNS],
                                stone.first_bond + k, materials_, *agglomerates_, "the stones"));
  auto at = std::find_if(blocks_.begin(), blocks_.end(),
                         [&](const Block &b) { return b.agglomerate > stone.agglomerate; });
  const size_t start = at == blocks_.end() ? bonds_.size() : at->start;
  bonds_.insert(bonds_.begin() + start, added.begin(), added.end());
  at = blocks_.insert(at, {stone.agglomerate, stone.first_bond, start, count});
  for (++at; at != blocks_.end(); ++at) at->start += count;
  if (intact_.size() < stone.first_bond + count) intact_.resize(stone.first_bond + count, 0);
  std::fill_n(intact_.begin() + stone.first_bond, count, 1);
  volumes_.enter(added);
  softening_.enter(added);
  broken_.resize(bonds_.size());
  listed_ = false;  // the list points into the bonds
  stretches_of_bonds_.clear();
  changes_++;
}

void FixBondParallel::leave(int agglomerate) {
  auto at = std::find_if(blocks_.begin(), blocks_.end(), [&](const Block &b) { return b.agglomerate == agglomerate; });
  if (at == blocks_.end()) return;
  const size_t count = at->count;
  bonds_.erase(bonds_.begin() + at->start, bonds_.begin() + at->start + count);
  at = blocks_.erase(at);
  for (; at != blocks_.end(); ++at) at->start -= count;
  volumes_.leave(agglomerates_->first_tag(agglomerate), agglomerates_->size(agglomerate));
  listed_ = false;
  stretches_of_bonds_.clear();
  changes_++;
}

Bond &FixBondParallel::bond_of(int id) { return const_cast<Bond &>(std::as_const(*this).bond_of(id)); }

const Bond &FixBondParallel::bond_of(int id) const {
  if (blocks_.empty()) return bonds_[id];
  auto after = std::upper_bound(blocks_.begin(), blocks_.end(), id,
                                [](int number, const Block &b) { return number < b.first_id; });
  return bonds_[std::prev(after)->start + (id - std::prev(after)->first_id)];
}

/* --- bodies in free flight ----------------------------------------------------------------------------------- */

const std::vector<int> &FixBondParallel::body_of_tag() {
  if (changes_ != changes_at_bodies_) {
    changes_at_bodies_ = changes_;
    find_bodies_of_tags(body_of_tag_, bonds_, intact_, *agglomerates_);
  }
  return body_of_tag_;
}

void FixBondParallel::add_elastic_energy_by_body(double *energy) {
  const std::vector<int> &body = body_of_tag();
  each_elastic_energy([&](int tag, double own) { energy[body[tag]] += own; });
}

const std::vector<BodyMaker::Support> &FixBondParallel::supports_of_tags() {
  if (changes_ == changes_at_supports_) return supports_;
  changes_at_supports_ = changes_;
  supports_.assign(agglomerates_->tags() + 1, Support());
  for (const Bond &b : bonds_)
    for (int tag : {b.tag_i, b.tag_j})
      if (intact_[b.id])
        supports_[tag].tensile_N += b.tensile_force, supports_[tag].stiffness_N_m += b.k_normal, supports_[tag].bonds++;
  return supports_;
}

void FixBondParallel::hold(int tag, bool held) {
  held_[tag] = held;
  listed_ = false;
}

// As its damping would have, soon.
void FixBondParallel::take_energy(int tag, double energy) {
  work_[agglomerates_->of_tag(tag)] -= energy;
  damped_[agglomerates_->of_tag(tag)] += energy;
}

void FixBondParallel::let_leave(int i) {
  forces_[i] = ForceRecord();
  is_turned_[i] = 0;
  turned_.clear();
}

void FixBondParallel::rotate(int i, const Rotation &turned) {
  double *q = quaternion_[i];
  const Rotation now = turned * Rotation{q[0], Vec(q + 1)};
  q[0] = now.w;
  now.v.to(q + 1);
}

double FixBondParallel::compute_scalar() {
  if (comm->nprocs == 1)
    return std::count_if(bonds_.begin(), bonds_.end(), [&](const Bond &b) { return intact_[b.id]; });
  double mine = 0, all = 0;
  for (const LocalBond &b : local_) mine += intact_[b.id] && b.i < atom->nlocal;
  MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, MPI_SUM, world);
  return all;
}

double FixBondParallel::memory_usage() {
  return bonds_.size() * (sizeof(Bond) + sizeof(LocalBond) + 13 * sizeof(double) + 5 * sizeof(int)) +
         atoms_.size() * (sizeof(AtomRecord) + sizeof(ForceRecord) + 4 * sizeof(double));
}
