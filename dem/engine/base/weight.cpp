#include "base/weight.h"

#include <string>

#include "base/fix_input.h"
#include "base/fixes.h"
#include "base/vec.h"
#include "fix_gravity.h"

namespace LAMMPS_NS {

namespace {

const double SAME_WEIGHT = 1e-6;  // of it

// Looks at what fix gravity keeps to itself.
struct Gravity : FixGravity {
  static bool is_constant(FixGravity *gravity) { return gravity->*(&Gravity::varflag) == 0; }
};

}  // namespace

void refuse_other_weight(const FixInput &input, const Modify *modify, const Vec &weight) {
  Vec found;
  if (auto *gravity = fix_that_is<FixGravity>(modify)) {
    if (!Gravity::is_constant(gravity))
      input.refuse(std::string("fix ") + gravity->id + " varies; free flight knows constant gravity");
    gravity->get_gravity(&found.x);
  }
  if (!(norm(found - weight) <= SAME_WEIGHT * norm(weight)))
    input.refuse("gravity and down must be those of the deck's fix gravity, which is none where there is no such fix");
}

}  // namespace LAMMPS_NS
