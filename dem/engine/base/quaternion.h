#pragma once
#include <cmath>

namespace LAMMPS_NS {

// Turns of the quaternions (w, x, y, z) of the sub-spheres, by plain numbers, as they are done of every sub-sphere at
// every step. omega is in rad/s, times in s.

// exp(omega half_dt) for constant omega: cos a and sin(a)/|omega| omega, with a = |omega| half_dt. They are taken as
// series in a^2 whose next terms are below 1e-18 for a < 0.05; a sub-sphere that turns faster in a step, which happens
// in no stable run, takes the functions.
struct HalfTurn {
  double c, u0, u1, u2;
  HalfTurn(const double *omega, double half_dt) {
    const double a2 = half_dt * half_dt * (omega[0] * omega[0] + omega[1] * omega[1] + omega[2] * omega[2]);
    double s = half_dt * (1 - a2 * (1. / 6) * (1 - a2 * (1. / 20) * (1 - a2 * (1. / 42) * (1 - a2 * (1. / 72)))));
    c = 1 - a2 * (1. / 2) * (1 - a2 * (1. / 12) * (1 - a2 * (1. / 30) * (1 - a2 * (1. / 56))));
    if (a2 > 2.5e-3) c = std::cos(std::sqrt(a2)), s = half_dt * std::sin(std::sqrt(a2)) / std::sqrt(a2);
    u0 = s * omega[0], u1 = s * omega[1], u2 = s * omega[2];
  }
};

// q <- exp(omega half_dt) q
inline void turn(double *q, const double *omega, double half_dt) {
  const HalfTurn t(omega, half_dt);
  const double q0 = q[0], q1 = q[1], q2 = q[2], q3 = q[3];
  q[0] = t.c * q0 - t.u0 * q1 - t.u1 * q2 - t.u2 * q3;
  q[1] = t.c * q1 + t.u0 * q0 + t.u1 * q3 - t.u2 * q2;
  q[2] = t.c * q2 + t.u1 * q0 + t.u2 * q1 - t.u0 * q3;
  q[3] = t.c * q3 + t.u2 * q0 + t.u0 * q2 - t.u1 * q1;
}

// later = q + 2 half_tau dq/dt with dq/dt = omega q / 2, of length 1 to fourth order in half_tau.
inline void extrapolate(double *later, const double *q, const double *omega, double half_tau) {
  const double u0 = half_tau * omega[0], u1 = half_tau * omega[1], u2 = half_tau * omega[2];
  const double c = 1 - 0.5 * (u0 * u0 + u1 * u1 + u2 * u2);
  later[0] = c * (q[0] - u0 * q[1] - u1 * q[2] - u2 * q[3]);
  later[1] = c * (q[1] + u0 * q[0] + u1 * q[3] - u2 * q[2]);
  later[2] = c * (q[2] + u1 * q[0] + u2 * q[1] - u0 * q[3]);
  later[3] = c * (q[3] + u2 * q[0] + u0 * q[2] - u1 * q[1]);
}

}  // namespace LAMMPS_NS
