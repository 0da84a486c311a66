#include "record/fix_monitor.h"

#include <mpi.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "atom.h"
#include "interfaces/checkpoint_file.h"
#include "error.h"
#include "base/fix_input.h"
#include "record/fix_ledger.h"
#include "base/fixes.h"
#include "interfaces/stone_stream.h"
#include "update.h"

using namespace LAMMPS_NS;
using namespace FixConst;

namespace {
const double STEP_SHARE = 0.1;     // of the smallest radius: the way of a sub-sphere in one step
const double ENERGY_SHARE = 0.01;  // of the energy supplied: what may come from nothing
}  // namespace

FixMonitor::FixMonitor(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg) {
  FixInput(lmp, this)
      .number("impact_J", impact_J_, Allowed::FROM_0)
      .number("weight", weight_, Allowed::FROM_0)
      .number("height_kg_m", height_kg_m_, Allowed::ANY)
      .read(arg, 3, narg, {"impact_J", "weight", "height_kg_m"});
  nevery = 10;
}

int FixMonitor::setmask() { return END_OF_STEP | PRE_EXCHANGE; }

// Lists of neighbours cannot be built of places that are no numbers.
void FixMonitor::pre_exchange() { check_speed(); }

void FixMonitor::init() {
  ledger_ = fix_that_is<FixLedger>(modify);
  if (!ledger_) FixInput(lmp, this).refuse("needs a fix ledger before it");
  stream_ = fix_that_is<StoneStream>(modify);
  double mine = stream_ ? stream_->smallest_radius() : HUGE_VAL;
  for (int i = 0; i < atom->nlocal; i++) mine = std::min(mine, atom->radius[i]);
  MPI_Allreduce(&mine, &smallest_radius_, 1, MPI_DOUBLE, MPI_MIN, world);
}

void FixMonitor::end_of_step() {
  check_speed();
  if (ledger_->sum().step > checked_) check_energy();
}

void FixMonitor::check_speed() const {
  const double limit = STEP_SHARE * smallest_radius_ / update->dt, limit2 = limit * limit;
  int broken = 0;
  for (int i = 0; i < atom->nlocal; i++) {
    const double *v = atom->v[i];
    broken |= !(v[0] * v[0] + v[1] * v[1] + v[2] * v[2] <= limit2);  // true for a velocity that is no number
  }
  if (!broken) return;
  for (int i = 0; i < atom->nlocal; i++) {
    const double *v = atom->v[i], speed = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    if (speed <= limit) continue;
    char text[256];
    std::snprintf(text, sizeof text,
                  "at step %ld sub-sphere %d moves at %.3g m/s; the limit of displacement is a tenth of the smallest "
                  "radius in a step, %.3g m/s: the run is not stable",
                  static_cast<long>(update->ntimestep), atom->tag[i], speed, limit);
    error->one(FLERR, text);
  }
}

// What was taken less what is held is what was dissipated, and that cannot be negative; and the works must be what the
// kinetic energies changed by. The second fails when the integrator does.
void FixMonitor::check_energy() {
  const FixLedger::Sum sum = ledger_->sum();
  checked_ = sum.step;
  const double impact_J = impact_J_ + sum.entered_J, height_kg_m = height_kg_m_ + sum.entered_kg_m;
  const double gravity_J = weight_ * (height_kg_m - sum.mass_height_kg_m);
  fallen_J_ = std::max(fallen_J_, gravity_J);
  // Stones of a stream may enter at rest, high above the plate, to which they will fall.
  const double to_fall_J = weight_ * sum.entered_kg_m;
  const double limit = ENERGY_SHARE * (impact_J + std::max(fallen_J_, to_fall_J));
  const double surplus = sum.kinetic_J - impact_J - gravity_J - sum.work_on_stones_J;
  const struct {
    const char *of;
    double from_nothing_J;
  } parts[] = {{"bonds have given", -sum.bonds_took_J},
               {"contacts have given", -sum.contacts_took_J},
               {"stones have gained or lost", std::fabs(surplus)}};
  for (const auto &part : parts) {
    if (part.from_nothing_J <= limit) continue;  // false for an energy that is no number
    char text[256];
    std::snprintf(text, sizeof text,
                  "at step %lld the %s %.3g J that nothing accounts for; the limit of energy is 1 %% of what impact "
                  "and fall supply, %.3g J: if half the time step gives less, the step is too long; if not, a law is wrong there",
                  sum.step, part.of, part.from_nothing_J, limit);
    error->all(FLERR, text);
  }
}

void FixMonitor::save(CheckpointWriter &out) { out.common("monitor_fallen_J", {fallen_J_}); }

void FixMonitor::restore(const CheckpointReader &in) { fallen_J_ = in.common("monitor_fallen_J", 1)[0]; }
