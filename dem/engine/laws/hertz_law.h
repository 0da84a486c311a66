#pragma once
#include <algorithm>
#include <cmath>

#include "atom.h"
#include "force.h"
#include "lammps.h"
#include "properties.h"
#include "property_registry.h"

namespace LAMMPS_NS {

// What the stock contact model `hertz` of LIGGGHTS stores and takes in one contact: the law of Hertz (1882), and the
// dashpots and the tangential spring of its manual, `gran model hertz`. Moduli E* are in Pa, lengths in m, energies in
// J.
class HertzLaw {
 public:
  explicit HertzLaw(LAMMPS *lmp) {
    lmp->force->registry.connect("Yeff", modulus_, "ledger");
    lmp->force->registry.connect("Geff", shear_modulus_, "ledger");
    lmp->force->registry.connect("betaeff", beta_, "ledger");
  }
  double modulus(int type_i, int type_j) const { return modulus_[type_i][type_j]; }
  // Of all pairs of types.
  double largest_modulus(Atom *atom) const {
    const int types = atom->get_properties()->max_type();
    double largest = 0;
    for (int i = 1; i <= types; i++)
      for (int j = 1; j <= types; j++) largest = std::max(largest, modulus_[i][j]);
    return largest;
  }
  static double normal_force(double modulus, double radius, double overlap) {
    return 4. / 3. * modulus * std::sqrt(radius * overlap) * overlap;
  }
  // U = 8/15 E* sqrt(R) overlap^(5/2)
  double elastic_energy(int type_i, int type_j, double radius, double overlap) const {
    return 8. / 15. * modulus_[type_i][type_j] * std::sqrt(radius) * std::pow(overlap, 2.5);
  }
  // c v v' with c = -2 sqrt(5/6) beta sqrt(S_n m), S_n = 2 E* sqrt(R overlap). The integrator computes the force from
  // the velocity v half a step back and does its work with the present one v', so both are asked for.
  double damping_power(int type_i, int type_j, double radius, double overlap, double mass, double v_force,
                       double v_work) const {
    const double stiffness = 2 * modulus_[type_i][type_j] * std::sqrt(radius * overlap);
    return dashpot(type_i, type_j, stiffness, mass) * v_force * v_work;
  }
  // Of the tangential spring of `tangential history`, 8 G* sqrt(R overlap), N/m; and its dashpot, N s/m.
  double tangential_stiffness(int type_i, int type_j, double radius, double overlap) const {
    return overlap > 0 ? 8 * shear_modulus_[type_i][type_j] * std::sqrt(radius * overlap) : 0;
  }
  double dashpot(int type_i, int type_j, double stiffness, double mass) const {
    return -2 * std::sqrt(5. / 6.) * beta_[type_i][type_j] * std::sqrt(stiffness * mass);
  }

 private:
  double **modulus_, **shear_modulus_, **beta_;
};

}  // namespace LAMMPS_NS
