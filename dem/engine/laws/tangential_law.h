#pragma once
#include "base/vec.h"

namespace LAMMPS_NS {

// Friction of a contact: Mindlin's tangential spring up to Coulomb's limit.
//
// The spring of Mindlin (1949, J. Appl. Mech. 16:259) is 8 G* a. With the stiffness 2 E* a of Hertz' normal law it is
// 4 G*/E* of that.
inline double mindlin_stiffness(double shear_modulus, double modulus, double normal_stiffness) {
  return 4 * shear_modulus / modulus * normal_stiffness;
}

// Of the `share` of a contact whose bonds, of the compliance C, are simulated themselves: 1/k = 1/k_M - C. Where they
// alone give as much, the patch is as stiff as the integration bears.
inline double spring_before_bonds(double share, double mindlin, double compliance, double stiffest) {
  const double left = 1 - compliance * mindlin;
  return share * mindlin < stiffest * left ? share * mindlin / left : stiffest;
}

// What stays of the stretch of a spring that pulls: all where it sticks, and as much as friction bears where it slides.
inline double share_that_sticks(double pull, double friction, double normal_force) {
  const double limit = friction * normal_force;
  return pull > limit ? limit / pull : 1;
}

// The stretch with which a spring goes on whose stiffness changes: it keeps its force as that rises, and its stretch as
// that falls. With its stretch kept always it would gain energy under a rising normal force, from nowhere.
inline Vec kept_stretch(double k0, const Vec &s0, double k1) { return k1 > k0 ? (k0 / k1) * s0 : s0; }

// Where the work against a tangential spring went in one step of the leapfrog scheme.
//
// The spring of a contact, stretched by s with the stiffness k, pulls with k s. Over a step the surfaces move by u, the
// spring goes from (k0, s0) to (k1, s1), and u + s0 - s1 is the way that they slip. The integrator does the work
// (k0 s0 + k1 s1)/2 . u, which is identically
//
//   (k1 s1^2 - k0 s0^2)/2  +  (k0 s0 + k1 s1)/2 . (u + s0 - s1)  -  (k1 - k0) s0 . s1 / 2
//     stored                    friction                              gained by the spring as its stiffness changed
//
// With `kept_stretch` friction less gained is never below zero: what slip and the spring take.
struct TangentialStep {
  double friction, gained;  // J
};

inline TangentialStep tangential_step(double k0, const Vec &s0, double k1, const Vec &s1, const Vec &moved) {
  return {0.5 * dot(k0 * s0 + k1 * s1, moved + s0 - s1), 0.5 * (k1 - k0) * dot(s0, s1)};
}

}  // namespace LAMMPS_NS
