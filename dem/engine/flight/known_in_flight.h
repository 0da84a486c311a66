#pragma once

namespace LAMMPS_NS {

class Fix;
class LAMMPS;
struct Vec;

// A body in free flight is in none of LIGGGHTS's arrays, so no fix, wall or contact acts on it. Fix free_flight does for
// it what the integrator and the weight do, and brings it back before it touches the plate, a side wall or another body.
// At `init` this refuses by name all else that a deck has and that might act on a body. `unheld` is the bit of the group
// on which integrator and weight must act, `weight` what free flight takes for it, m/s^2.
void refuse_what_free_flight_does_not_know(LAMMPS *lmp, Fix *free_flight, int unheld, const Vec &weight);

}  // namespace LAMMPS_NS
