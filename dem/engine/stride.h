#pragma once
namespace LAMMPS_NS {

class LAMMPS;

// How many steps may be taken as one while no bonds are computed. The step of a deck is that of its bonds, and contacts
// between single sub-spheres need a longer one only:
//
//   An elastic impact at v of which N steps resolve the contact time T(v) = 2.87 (m^2/(R E*^2 v))^(1/5) misses at most
//   10/N^3 of its energy (the worst phase, for N = 6 to 40). So N is at least LEAST_STEPS, and 10/N^3 v^2 is at most
//   the tolerance times V^2, V being the speed of the impact.
//   A lasting contact that is pressed with F has pi sqrt(m/S), S its Hertz stiffness, in place of T.
class Stride {
 public:
  // Most steps (`unit` and its divisors), the step in s, V in m/s, the share of its energy that may be missed, and the
  // largest E* of all contacts, Pa.
  Stride(int unit, double step_s, double speed_m_s, double tolerance, double modulus_Pa)
      : unit_(unit), step_s_(step_s), speed_(speed_m_s), tolerance_(tolerance), modulus_(modulus_Pa) {}
  // With what is in the arrays and the neighbours that are listed, over a plate that moves with at most `plate_m_s`.
  int longest(const LAMMPS *, double plate_m_s) const;

 private:
  static double closing_speed(const LAMMPS *);
  const int unit_;
  const double step_s_, speed_, tolerance_, modulus_;
};

}  // namespace LAMMPS_NS
