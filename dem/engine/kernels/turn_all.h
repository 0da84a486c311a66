#pragma once

namespace LAMMPS_NS {

// Turns the quaternions (count, 4) of sub-spheres that lie beside each other in memory by their angular velocities
// (count, 3) in rad/s, as turn() in quaternion.h does of one, to the last bit. half_dt in s.
void turn_all(double *quaternions, const double *omegas, int count, double half_dt);

}  // namespace LAMMPS_NS
