#pragma once
#include "base/vec.h"

namespace LAMMPS_NS {

// Where the work against a tangential spring went in one step of the leapfrog scheme.
//
// The spring of a contact, stretched by s with the stiffness k, pulls with k s. Over a step the surfaces move by u, the
// spring goes from (k0, s0) to (k1, s1), and u + s0 - s1 is the way that they slip. The integrator does the work
// (k0 s0 + k1 s1)/2 . u, which is identically
//
//   (k1 s1^2 - k0 s0^2)/2  +  (k0 s0 + k1 s1)/2 . (u + s0 - s1)  -  (k1 - k0) s0 . s1 / 2
//     stored                    friction                              gained by the spring as its stiffness changed
struct TangentialStep {
  double friction, gained;  // J
};

inline TangentialStep tangential_step(double k0, const Vec &s0, double k1, const Vec &s1, const Vec &moved) {
  return {0.5 * dot(k0 * s0 + k1 * s1, moved + s0 - s1), 0.5 * (k1 - k0) * dot(s0, s1)};
}

}  // namespace LAMMPS_NS
