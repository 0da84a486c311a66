#include "flight/known_in_flight.h"

#include <set>
#include <string>

#include "domain.h"
#include "record/fix_checkpoint.h"
#include "fix_gravity.h"
#include "base/fix_input.h"
#include "base/fixes.h"
#include "force.h"
#include "interfaces/free_flight_partners.h"
#include "lammps.h"
#include "pair_gran.h"
#include "interfaces/stone_stream.h"
#include "base/vec.h"
#include "base/weight.h"

namespace LAMMPS_NS {

namespace {

// Of LIGGGHTS: these keep or show something, and push nothing.
const std::set<std::string> HARMLESS = {"property/global", "property/atom", "contacthistory", "print", "ave/time"};

std::string name(const Fix *fix) { return std::string("fix ") + fix->id + " of style " + fix->style; }

bool is_integrator(const Fix *fix) { return std::string(fix->style) == "nve/sphere"; }

void refuse_unknown_fixes(const FixInput &input, const Modify *modify, const Fix *free_flight) {
  bool is_later = false;
  for (int k = 0; k < modify->nfix; k++) {
    Fix *fix = modify->fix[k];
    const bool is_own = dynamic_cast<ActsInFreeFlight *>(fix);
    const bool is_moving = is_integrator(fix) || dynamic_cast<FixGravity *>(fix);
    if (fix == free_flight) is_later = true;
    else if (!is_own && !is_moving && !HARMLESS.count(fix->style))
      input.refuse("the deck has " + name(fix) + ", which free flight does not know: bodies in flight would not feel " +
                   "it; leave out that fix or this one");
    else if (is_later && (is_moving || (is_own && !dynamic_cast<FixCheckpoint *>(fix))))
      input.refuse("must come after " + name(fix));
  }
}

template <class T> void refuse_several(const FixInput &input, const Modify *modify, const char *what) {
  const int count = fixes_that_are<T>(modify).size();
  if (count > 1) input.refuse("the deck has " + std::to_string(count) + " " + what + "; free flight knows one");
}

void refuse_other_motion(const FixInput &input, const Modify *modify, int unheld) {
  int integrators = 0;
  for (int k = 0; k < modify->nfix; k++) {
    Fix *fix = modify->fix[k];
    if (!is_integrator(fix) && !dynamic_cast<FixGravity *>(fix)) continue;
    if (fix->groupbit != unheld) input.refuse(name(fix) + " must act on the group that follows `unheld`");
    integrators += is_integrator(fix);
  }
  if (integrators != 1) input.refuse("needs one fix nve/sphere, which integrates all sub-spheres");
}

void refuse_other_contacts(const FixInput &input, LAMMPS *lmp) {
  auto *pair = dynamic_cast<PairGran *>(lmp->force->pair);
  const bool is_known = pair && pair->contact_match("normal", "hertz") && pair->contact_match("cohesion", "off") &&
                        pair->contact_match("rolling_friction", "off") && pair->contact_match("surface", "default") &&
                        (pair->contact_match("tangential", "off") || pair->contact_match("tangential", "history"));
  if (!is_known) input.refuse("knows `pair_style gran model hertz [tangential history]` only");
}

}  // namespace

void refuse_what_free_flight_does_not_know(LAMMPS *lmp, Fix *free_flight, int unheld, const Vec &weight) {
  const FixInput input(lmp, free_flight);
  const Modify *modify = lmp->modify;
  refuse_unknown_fixes(input, modify, free_flight);
  refuse_several<Obstacle>(input, modify, "plates");
  refuse_several<BodyMaker>(input, modify, "fixes bond/parallel");
  refuse_several<StoneStream>(input, modify, "fixes stones");
  refuse_several<FlightControl>(input, modify, "fixes free_flight");
  refuse_several<FixGravity>(input, modify, "fixes gravity");
  refuse_other_motion(input, modify, unheld);
  refuse_other_weight(input, modify, weight);
  refuse_other_contacts(input, lmp);
  if (lmp->domain->xperiodic || lmp->domain->yperiodic || lmp->domain->zperiodic)
    input.refuse("needs a box without periodic boundaries, such as `boundary m m m`");
}

}  // namespace LAMMPS_NS
