#pragma once

namespace LAMMPS_NS {

class FixInput;
class Modify;
struct Vec;

// Refuses a weight (m/s^2) other than that which fix gravity gives the sub-spheres in the arrays.
void refuse_other_weight(const FixInput &, const Modify *, const Vec &weight);

}  // namespace LAMMPS_NS
