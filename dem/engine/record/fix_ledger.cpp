#include "record/fix_ledger.h"

#include <mpi.h>

#include <cmath>

#include "atom.h"
#include "interfaces/checkpoint_file.h"
#include "comm.h"
#include "error.h"
#include "base/fix_input.h"
#include "base/fixes.h"
#include "force.h"
#include "neigh_list.h"
#include "pair_gran.h"
#include "interfaces/stone_stream.h"
#include "laws/tangential_law.h"
#include "update.h"

using namespace LAMMPS_NS;
using namespace FixConst;

namespace {
const double STICKS = 1e-9;  // of its stretch: a tangential spring that was shortened by less has not slipped
}

FixLedger::FixLedger(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg) {
  std::string agglomerates, file;
  FixInput(lmp, this)
      .text("agglomerates", agglomerates)
      .whole("every", every_, 1)
      .text("file", file)
      .direction("up", up_)
      .read(arg, 3, narg, {"agglomerates", "every", "file"});
  nevery = 1;
  agglomerates_ = std::make_unique<Agglomerates>(lmp, this, agglomerates);
  pair_work_.assign(agglomerates_->count(), 0);
  pair_damped_ = friction_ = gained_ = pair_work_;
  row_of_.assign(agglomerates_->count(), 0);
  if (comm->me == 0) {
    file_ = std::fopen(file.c_str(), "ab");
    if (!file_) error->one(FLERR, ("cannot write " + file).c_str());
  }
}

FixLedger::~FixLedger() {
  if (file_) std::fclose(file_);
}

int FixLedger::setmask() { return POST_INTEGRATE | PRE_FORCE | POST_FORCE | END_OF_STEP; }

void FixLedger::init() {
  const FixInput input(lmp, this);
  auto *pair = dynamic_cast<PairGran *>(force->pair);
  if (!pair || !pair->contact_match("normal", "hertz")) input.refuse("needs `pair_style gran model hertz`");
  for (int k = 0; modify->fix[k] != this; k++)
    if ((modify->fmask[k] & POST_FORCE) && !dynamic_cast<FixLedger *>(modify->fix[k]))
      input.refuse(std::string("must come before fix ") + modify->fix[k]->id + ", which adds forces");
  holders_ = fixes_that_are<EnergyHolder>(modify);
  takers_ = fixes_that_are<TakesPairs>(modify);
  stream_ = fix_that_is<StoneStream>(modify);
  agglomerates_->init();
}

void FixLedger::setup(int vflag) {
  law_ = std::make_unique<HertzLaw>(lmp);
  const NeighList *springs = force->pair->list->listgranhistory;
  if (springs && springs->dnum != 3) FixInput(lmp, this).refuse("needs contacts with `tangential history`");
  if (resuming) return;
  // The step that ends here was counted by the run before, or never was.
  const std::vector<double> counted = pair_work_, friction = friction_, gained = gained_;
  post_force(vflag);
  pair_work_ = counted;
  friction_ = friction;
  gained_ = gained;
}

// What the tangential springs were at the last step must be read before the pair style goes on with them. Where nothing
// touched at that step, they begin now.
void FixLedger::pre_force(int) {
  for (TakesPairs *taker : takers_) taker->take_pairs();
  found_ = !felt_.empty();
  if (found_) find_contacts(true);
}

void FixLedger::find_contacts(bool touched_before) {
  contacts_.clear();
  const NeighList *list = force->pair->list, *springs = list->listgranhistory;
  for (int k = 0; k < list->inum; k++) {
    const int i = list->ilist[k];
    for (int m = 0; m < list->numneigh[i]; m++) {
      const int j = list->firstneigh[i][m] & NEIGHMASK;
      const Vec d = Vec(atom->x[i]) - Vec(atom->x[j]);
      const double sum = atom->radius[i] + atom->radius[j], r2 = dot(d, d);
      if (r2 >= sum * sum) continue;
      const double r = std::sqrt(r2), *history = springs ? springs->firstdouble[i] + springs->dnum * m : nullptr;
      contacts_.push_back({i, j, atom->radius[i] * atom->radius[j] / sum, sum - r, (1 / r) * d,
                           j < atom->nlocal ? 1.0 : 0.5, history,
                           history && touched_before ? Vec(history) : Vec(), Vec()});
    }
  }
}

// Of i over j across their normal, where they touch; or what i has of it.
Vec FixLedger::surface_velocity(const Contact &c, bool of_both) const {
  const double *a = atom->v[c.i], *b = atom->v[c.j];
  const double arm_i = atom->radius[c.i] - 0.5 * c.overlap, arm_j = atom->radius[c.j] - 0.5 * c.overlap;
  Vec v(a), spin = arm_i * Vec(atom->omega[c.i]);
  if (of_both) v = v - Vec(b), spin += arm_j * Vec(atom->omega[c.j]);
  return v - dot(v, c.normal) * c.normal - cross(spin, c.normal);
}

double FixLedger::spring_stiffness(const Contact &c, double overlap) const {
  return law_->tangential_stiffness(atom->type[c.i], atom->type[c.j], c.radius, overlap);
}

void FixLedger::count(std::vector<double> &sums, const Contact &c, double energy) const {
  sums[agglomerates_->of_tag(atom->tag[c.i])] += 0.5 * c.share * energy;
  sums[agglomerates_->of_tag(atom->tag[c.j])] += 0.5 * c.share * energy;
}

// When the pair style has gone on with the springs, and velocities are those with which it did.
void FixLedger::measure_friction() {
  const double dt = update->dt;
  for (Contact &c : contacts_) {
    if (!c.history) continue;
    const Vec spring(c.history), moved = dt * surface_velocity(c);
    const double parting = dot(Vec(atom->v[c.i]) - Vec(atom->v[c.j]), c.normal);
    const double before = spring_stiffness(c, c.overlap + dt * parting), now = spring_stiffness(c, c.overlap);
    const Vec tried = c.spring + moved, across = tried - dot(tried, c.normal) * c.normal;
    const TangentialStep step = tangential_step(before, c.spring, now, spring, across - c.spring);
    count(friction_, c, step.friction);
    count(gained_, c, step.gained);
    const double mi = atom->rmass[c.i], mj = atom->rmass[c.j];
    const bool sticks = norm(across - spring) <= STICKS * norm(across);
    if (sticks) c.rubbed = law_->dashpot(atom->type[c.i], atom->type[c.j], now, mi * mj / (mi + mj)) / dt * moved;
  }
}

// The velocity of a ghost is that of the middle of the step, when the force was found. Its own rank knows the one at
// the end, and each of the two ranks adds what the dashpots took from its own sub-sphere.
void FixLedger::add_damping() {
  const double dt = update->dt;
  for (const Contact &c : contacts_) {
    const bool both = c.j < atom->nlocal;
    const double mi = atom->rmass[c.i], mj = atom->rmass[c.j];
    const Vec vi(atom->v[c.i]), vj(atom->v[c.j]), gained = 0.5 * dt / mi * Vec(atom->f[c.i]);
    const Vec at_force = both ? vi - vj - (gained - 0.5 * dt / mj * Vec(atom->f[c.j])) : vi - gained - vj;
    const double normal = law_->damping_power(atom->type[c.i], atom->type[c.j], c.radius, c.overlap,
                                              mi * mj / (mi + mj), dot(at_force, c.normal),
                                              dot(both ? vi - vj : vi, c.normal));
    count(pair_damped_, c, dt / c.share * (normal + dot(c.rubbed, surface_velocity(c, both))));
  }
}

// The work over a step is force x (v before + v after)/2 dt, which is what the leapfrog integrator adds to the kinetic
// energy. The first half is counted when the force is known, the second when the next velocity is.
void FixLedger::post_force(int) {
  felt_.clear();
  const double half_dt = 0.5 * update->dt;
  const NeighList *list = force->pair->list;
  for (int k = 0; k < list->inum; k++) {
    const int i = list->ilist[k];
    const double *f = atom->f[i], *t = atom->torque[i];
    if (f[0] == 0 && f[1] == 0 && f[2] == 0) continue;
    const double *v = atom->v[i], *w = atom->omega[i];
    felt_.push_back({i, {f[0], f[1], f[2]}, {t[0], t[1], t[2]}});
    pair_work_[agglomerates_->of_tag(atom->tag[i])] +=
        half_dt * (f[0] * v[0] + f[1] * v[1] + f[2] * v[2] + t[0] * w[0] + t[1] * w[1] + t[2] * w[2]);
  }
  if (felt_.empty()) contacts_.clear();
  else if (!found_) find_contacts(false);
  measure_friction();
}

void FixLedger::post_integrate() {
  const double half_dt = 0.5 * update->dt;
  for (const Felt &c : felt_) {
    const double *v = atom->v[c.i], *w = atom->omega[c.i];
    pair_work_[agglomerates_->of_tag(atom->tag[c.i])] +=
        half_dt * (c.force[0] * v[0] + c.force[1] * v[1] + c.force[2] * v[2] + c.torque[0] * w[0] +
                   c.torque[1] * w[1] + c.torque[2] * w[2]);
  }
}

void FixLedger::end_of_step() {
  add_damping();
  if (update->ntimestep % every_ == 0 || update->ntimestep == update->laststep) write();
}

void FixLedger::write() {
  LedgerRows rows(agglomerates_->near(), row_of_);
  add_motion(rows);
  // From the last fix of the deck to the first: the order of a sum decides its last bit.
  for (auto holder = holders_.rbegin(); holder != holders_.rend(); ++holder) (*holder)->add_to(rows);
  add_contacts(rows);
  const std::vector<double> total = over_ranks(rows.values());
  sum_ = closed_;
  sum_.step = update->ntimestep;
  if (stream_) sum_.entered_J = stream_->entered_kinetic_J(), sum_.entered_kg_m = stream_->entered_mass_height();
  for (const double *row = total.data(); row < total.data() + total.size(); row += LEDGER_COLUMNS) add_up(sum_, row);
  if (comm->me == 0) write_rows(rows, total);
  if (stream_) close_finished(total);
}

void FixLedger::write_rows(const LedgerRows &rows, const std::vector<double> &total) {
  auto write_row = [&](long long agglomerate, const double *row) {
    const long long head[2] = {update->ntimestep, agglomerate};
    if (std::fwrite(head, 8, 2, file_) != 2 || std::fwrite(row, 8, LEDGER_COLUMNS, file_) != LEDGER_COLUMNS)
      error->one(FLERR, "cannot write the ledger");
  };
  const double none[LEDGER_COLUMNS] = {};
  if (rows.near().empty()) write_row(0, none);
  for (size_t k = 0; k < rows.near().size(); k++) write_row(rows.near()[k] + 1, &total[k * LEDGER_COLUMNS]);
}

// Of a stone that has left this was the last row.
void FixLedger::close_finished(const std::vector<double> &total) {
  for (const int a : stream_->close_finished())
    add_up(closed_, &total[row_of_[a] * LEDGER_COLUMNS]);
}

// Kinetic energy, momentum and height of the sub-spheres in the arrays.
void FixLedger::add_motion(LedgerRows &rows) const {
  for (int i = 0; i < atom->nlocal; i++) {
    const int a = agglomerates_->of_tag(atom->tag[i]);
    const double *v = atom->v[i], *w = atom->omega[i], m = atom->rmass[i], r = atom->radius[i];
    rows.at(a, KINETIC) += 0.5 * m * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) +
                           0.2 * m * r * r * (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
    rows.at(a, MOMENTUM_Z) += m * v[2];
    rows.at(a, MASS_HEIGHT) += m * dot(up_, Vec(atom->x[i]));
  }
}

// Energies of the contacts between sub-spheres.
void FixLedger::add_contacts(LedgerRows &rows) const {
  rows.add(PAIR_WORK, pair_work_);
  rows.add(PAIR_DAMPED, pair_damped_);
  rows.add(FRICTION, friction_);
  rows.add(SPRINGS, gained_);
  std::vector<double> elastic(agglomerates_->count(), 0);
  for (const Contact &c : contacts_) {
    const double spring = c.history ? spring_stiffness(c, c.overlap) * dot(Vec(c.history), Vec(c.history)) : 0;
    count(elastic, c, law_->elastic_energy(atom->type[c.i], atom->type[c.j], c.radius, c.overlap) + 0.5 * spring);
  }
  rows.add(PAIR_ELASTIC, elastic);
}

// The sum over the ranks, or the largest in the column where that counts, which is right on rank 0 alone.
std::vector<double> FixLedger::over_ranks(const std::vector<double> &mine) const {
  std::vector<double> total(mine.size());
  MPI_Allreduce(mine.data(), total.data(), total.size(), MPI_DOUBLE, MPI_SUM, world);
  if (comm->nprocs == 1) return total;
  const int n = static_cast<int>(mine.size()) / LEDGER_COLUMNS;
  std::vector<double> deepest(n), column(n);
  for (int a = 0; a < n; a++) deepest[a] = mine[a * LEDGER_COLUMNS + WALL_DEEPEST];
  MPI_Reduce(deepest.data(), column.data(), n, MPI_DOUBLE, MPI_MAX, 0, world);
  for (int a = 0; a < n; a++) total[a * LEDGER_COLUMNS + WALL_DEEPEST] = column[a];
  return total;
}

void FixLedger::add_up(Sum &sum, const double *row) {
  sum.kinetic_J += row[KINETIC];
  sum.mass_height_kg_m += row[MASS_HEIGHT];
  sum.work_on_stones_J += row[BOND_WORK] + row[PAIR_WORK] + row[WALL_WORK];
  sum.bonds_took_J -= row[BOND_WORK] + row[BOND_ELASTIC] + row[RELEASED];
  const double held = row[PAIR_ELASTIC] + row[WALL_ELASTIC] - row[SPRINGS];
  sum.contacts_took_J -= row[PAIR_WORK] + row[WALL_WORK] + row[PLATE_WORK] + held;
}

void FixLedger::post_run() {
  if (file_ && std::fflush(file_) != 0) error->one(FLERR, "cannot write the ledger");
}

void FixLedger::save(CheckpointWriter &out) {
  post_run();
  out.sum("pair_work", pair_work_);
  out.sum("pair_damped", pair_damped_);
  out.sum("pair_friction", friction_);
  out.sum("pair_springs", gained_);
  std::vector<double> rows;
  for (const Felt &c : felt_) {
    rows.push_back(atom->tag[c.i]);
    rows.insert(rows.end(), c.force, c.force + 3);
    rows.insert(rows.end(), c.torque, c.torque + 3);
  }
  out.rows("pair_contacts", rows);
  out.common("ledger_closed", {closed_.kinetic_J, closed_.mass_height_kg_m, closed_.work_on_stones_J,
                               closed_.bonds_took_J, closed_.contacts_took_J});
}

void FixLedger::restore(const CheckpointReader &in) {
  pair_work_ = in.sum("pair_work", agglomerates_->count());
  pair_damped_ = in.sum("pair_damped", agglomerates_->count());
  friction_ = in.sum("pair_friction", agglomerates_->count());
  gained_ = in.sum("pair_springs", agglomerates_->count());
  const std::vector<double> &closed = in.common("ledger_closed", 5);
  closed_ = {0, closed[0], closed[1], closed[2], closed[3], closed[4]};
  felt_.clear();
  const std::vector<double> &rows = in.rows("pair_contacts", 7);
  for (size_t k = 0; k < rows.size(); k += 7) {
    const int i = atom->map(static_cast<int>(rows[k]));
    if (i < 0 || i >= atom->nlocal) continue;
    felt_.push_back({i, {rows[k + 1], rows[k + 2], rows[k + 3]}, {rows[k + 4], rows[k + 5], rows[k + 6]}});
  }
}
