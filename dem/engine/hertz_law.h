#pragma once
#include <cmath>

#include "force.h"
#include "lammps.h"
#include "property_registry.h"

namespace LAMMPS_NS {

// What the stock contact model `hertz` of LIGGGHTS stores and takes in the normal direction of one contact: the law of
// Hertz (1882) and the dashpot of its manual, `gran model hertz`. Moduli E* are in Pa, lengths in m, energies in J.
class HertzLaw {
 public:
  explicit HertzLaw(LAMMPS *lmp) {
    lmp->force->registry.connect("Yeff", modulus_, "ledger");
    lmp->force->registry.connect("betaeff", beta_, "ledger");
  }
  double modulus(int type_i, int type_j) const { return modulus_[type_i][type_j]; }
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
    return -2 * std::sqrt(5. / 6.) * beta_[type_i][type_j] * std::sqrt(stiffness * mass) * v_force * v_work;
  }

 private:
  double **modulus_, **beta_;
};

}  // namespace LAMMPS_NS
