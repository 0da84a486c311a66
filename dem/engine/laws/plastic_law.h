#pragma once
#include <cmath>

namespace LAMMPS_NS {

// Normal contact of a sphere with an elastic, perfectly plastic plate (Thornton 1997, J. Appl. Mech. 64:383), the twin
// of tests/plate_fem/plasticity.py. The force follows Hertz until the pressure in the middle reaches p_y, and then
// rises with the slope pi p_y R. It comes back along Hertz' law for the radius R_p of the flattened contact, and rises
// again the same way to where it turned. The largest overlap so far is all that the contact remembers. Arguments:
// modulus E*, Pa; radius R of the sphere, m; overlaps, m. Forces are in N.
class PlasticLaw {
 public:
  explicit PlasticLaw(double yield_pressure) : p_(yield_pressure) {}

  struct Indentation {
    double radius, depth;  // R_p, and the overlap at which the force comes back to zero, m
  };

  double yield_overlap(double modulus, double R) const { return std::pow(M_PI * p_ / (2 * modulus), 2) * R; }

  double loading(double modulus, double R, double overlap) const {
    const double at_yield = yield_overlap(modulus, R);
    if (overlap <= at_yield) return hertz(modulus, R, overlap);
    return hertz(modulus, R, at_yield) + M_PI * p_ * R * (overlap - at_yield);
  }

  Indentation indentation(double modulus, double R, double largest) const {
    const double at_yield = yield_overlap(modulus, R);
    if (largest <= at_yield) return {R, 0};
    const double F = loading(modulus, R, largest);
    const double a2 = (2 * F + hertz(modulus, R, at_yield)) / (2 * M_PI * p_);  // contact radius squared
    const double R_p = 4 * modulus / (3 * F) * std::pow(a2, 1.5);
    return {R_p, largest - std::pow(0.75 * F / (modulus * std::sqrt(R_p)), 2. / 3.)};
  }

  double force(double modulus, double R, double overlap, double largest) const {
    const Indentation d = indentation(modulus, R, largest);
    return hertz(modulus, d.radius, overlap - d.depth);
  }

  // Overlap at which an elastic sphere of radius R has this force.
  static double hertz_overlap(double modulus, double R, double force) {
    return std::pow(0.75 * force / (modulus * std::sqrt(R)), 2. / 3.);
  }

  // Energy that loading to `largest` and unloading takes, J.
  double taken(double modulus, double R, double largest) const {
    const double at_yield = yield_overlap(modulus, R);
    if (largest <= at_yield) return 0;
    const double F_y = hertz(modulus, R, at_yield), F = loading(modulus, R, largest);
    return 0.4 * F_y * at_yield + 0.5 * (F_y + F) * (largest - at_yield) -
           0.4 * F * (largest - indentation(modulus, R, largest).depth);
  }

 private:
  double p_;
  static double hertz(double modulus, double R, double overlap) {
    return overlap > 0 ? 4. / 3. * modulus * std::sqrt(R * overlap) * overlap : 0;
  }
};

}  // namespace LAMMPS_NS
