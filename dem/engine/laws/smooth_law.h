#pragma once
#include <cmath>

#include "laws/plastic_law.h"

namespace LAMMPS_NS {

// Normal force of a smooth stone on the plate as a function of how far the patch of its surface has come, q.
//
// Hertz' approach d of the plate and the stone's centre is q plus the compression C F of the bonds under the patch
// (dem/stones/contact_patch.py), so that F follows from d - C F(d) = q. The energy stored beside the bonds' own is the
// integral of F dq, U = 2/5 F d - C F^2/2. Where the contact has a strength p_y (the pressure in its middle at which
// stone or plate gives way), F(d) is the elastic, perfectly plastic law of PlasticLaw; the largest approach is all that
// it remembers.
class SmoothLaw {
 public:
  SmoothLaw(double modulus, double radius, double yield_pressure)
      : modulus_(modulus), radius_(radius), yields_(yield_pressure > 0), plastic_(yield_pressure) {}

  struct State {
    double approach = 0;   // d, m
    double force = 0;      // F, N
    double stiffness = 0;  // dF/dd of the elastic branch, N/m
    double stored = 0;     // U, J
    double pressing_radius = 0;  // R, or that of the flattened contact after yield, m
  };

  // At patch approach `q`; `largest` is the largest Hertz approach so far and grows with loading beyond yield.
  State at(double q, double compliance, double &largest) const {
    if (yields_ && q > largest_before_yield(compliance)) {
      const double loading = yielding_approach(q, compliance);
      if (loading > largest) largest = loading;
    }
    PlasticLaw::Indentation left{radius_, 0};
    if (yields_) left = plastic_.indentation(modulus_, radius_, largest);
    State s;
    s.pressing_radius = left.radius;
    if (q <= left.depth) return s;
    const double elastic = elastic_approach(q - left.depth, compliance, 4. / 3. * modulus_ * std::sqrt(left.radius));
    s.approach = left.depth + elastic;
    s.force = 4. / 3. * modulus_ * std::sqrt(left.radius * elastic) * elastic;
    s.stiffness = 2 * modulus_ * std::sqrt(left.radius * elastic);
    s.stored = 0.4 * s.force * elastic - 0.5 * compliance * s.force * s.force;
    return s;
  }
  // Energy that yielding has taken, J.
  double taken(double largest) const { return yields_ ? plastic_.taken(modulus_, radius_, largest) : 0; }

 private:
  double modulus_, radius_;
  bool yields_;
  PlasticLaw plastic_;

  double largest_before_yield(double C) const {
    const double d = plastic_.yield_overlap(modulus_, radius_);
    return d - C * plastic_.loading(modulus_, radius_, d);
  }
  // Of a virgin contact beyond yield, where F grows with the slope pi p_y R.
  double yielding_approach(double q, double C) const {
    const double d = plastic_.yield_overlap(modulus_, radius_), F = plastic_.loading(modulus_, radius_, d);
    const double slope = plastic_.loading(modulus_, radius_, 2 * d) - F;  // over d
    return d + (q - d + C * F) / (1 - C * slope / d);
  }
  // Solves e - C K e^(3/2) = q by Newton's method, which from e = q on rises to the solution.
  static double elastic_approach(double q, double C, double K) {
    double e = q;
    for (int k = 0; k < 20; k++) {
      const double root = std::sqrt(e), step = (q - e + C * K * root * e) / (1 - 1.5 * C * K * root);
      e += step;
      if (std::fabs(step) < 1e-14 * e) break;
    }
    return e;
  }
};

}  // namespace LAMMPS_NS
