#pragma once
#include <memory>
#include <vector>

#include "interfaces/agglomerates.h"
#include "bodies/array_body.h"
#include "interfaces/checkpointed.h"
#include "interfaces/energy_holder.h"
#include "fix.h"
#include "bodies/free_body.h"
#include "interfaces/free_flight_partners.h"
#include "bodies/held_bodies.h"
#include "laws/hertz_law.h"

namespace LAMMPS_NS {

const bigint FAR_AHEAD = 1000000000000000;  // steps

// fix ID group free_flight agglomerates FILE [gravity G] [down X Y Z] speed V tolerance TOL every N unheld GROUP
//     [least_fragment M] [body_skin S]
//
// Bodies (sub-spheres that intact bonds hold together) that touch nothing and do not vibrate leave LIGGGHTS's arrays
// and fly as rigid bodies on their exact path until they could touch something. When all bodies are in free flight,
// time jumps (docs/free_flight.md). A body is calm when the kinetic energy of its inner motion is below TOL x m V^2/2,
// V (m/s) being the speed of the impact. The fix looks every N steps. Gravity (G, m/s^2) acts along `down`, a unit
// vector with a Z below 0, or along -z. What has left the plate for good goes to fix stones, if there is one, and so
// does a fragment of fewer than M sub-spheres as soon as it flies. Within a body, neighbours are listed with the skin S
// (m). The fixes that integrate, and that add weight, act on GROUP, which the sub-spheres of a body that is held leave.
// The fix works on one rank, and comes after all other fixes.
class FixFreeFlight : public Fix, public Checkpointed, public EnergyHolder, public FlightControl,
                      public FlyingSpheres {
 public:
  FixFreeFlight(class LAMMPS *, int, char **);
  int setmask() override;
  void init() override;
  void setup(int) override;
  void initial_integrate(int) override { held_->move(); }
  void pre_exchange() override;
  void pre_neighbor() override { held_->find(); }
  void final_integrate() override;
  void end_of_step() override;
  double compute_scalar() override;        // sub-spheres in free flight
  double compute_vector(int) override;     // 1: steps jumped over; 2: departures
  // What LIGGGHTS asks at set-up of sub-spheres that are not in its arrays.
  double min_rad(int type) override { return least_radius_[type]; }
  double max_rad(int type) override { return greatest_radius_[type]; }
  int min_type() override;
  int max_type() override;

  void add_to(LedgerRows &) override;

  void begin_anew() override;
  void save(CheckpointWriter &) override;
  void restore(const CheckpointReader &) override;

  void each_in_flight(const Visit &) const override;

  void set_arrays(int i) override { atom->mask[i] |= unheld_; }

  void jump() override;
  void change_arrays() override;
  void show() override;
  void hide() override;
  void bring_back() override;
  double body_skin() const override { return body_skin_; }

 private:
  std::unique_ptr<Agglomerates> agglomerates_;
  std::unique_ptr<HertzLaw> law_;
  BodyMaker *bonds_ = nullptr;
  Obstacle *plate_ = nullptr;
  std::vector<SideWall *> walls_;
  class FixContactHistory *history_ = nullptr;
  double gravity_ = 0, speed_ = 0, tolerance_ = 0;  // m/s^2, m/s, share of the energy of the impact
  Vec down_ = Vec(0, 0, -1);   // unit vector
  class StoneStream *stream_ = nullptr;
  std::vector<std::unique_ptr<FreeBody>> bodies_;
  std::vector<double> bond_energy_, pair_energy_;  // room for the energies of bodies, by least tag, J
  std::unique_ptr<HeldBodies> held_;
  std::vector<int> calm_, still_;  // looks in a row at which a body was calm, and even still, by its least tag
  PlateOutline outline_;       // of the plate, with the reach that all safe_until hold for
  double largest_modulus_ = 0;  // E* of all pairs of types, Pa
  std::vector<double> least_radius_, greatest_radius_;  // by type, of the deck's sub-spheres, m; 0: there are none
  int unheld_ = 0;             // bit of the group
  double body_skin_ = 0;       // of neighbours within a body, m; 0: that of the deck
  int least_fragment_ = 0;   // sub-spheres: a fragment of fewer is taken out as soon as it flies
  int shown_ = 0;              // sub-spheres appended by show
  bigint jumped_ = 0, departures_ = 0;

  void note_radii();
  std::vector<FreeBody *> bodies_in_flight();
  int body_of(int tag) const;
  Vec weight() const { return gravity_ * down_; }  // m/s^2
  void visit_parts(const FreeBody &, const Visit &) const;
  bool has_left(const Outline &) const;
  bool is_dust(const FreeBody &) const;
  bool is_clear(FreeBody &) const;
  bool have_left(const Outline &a, const Outline &b) const { return stream_ && has_left(a) && has_left(b); }
  void take_out_those_that_left();
  void check_count() const;
  double time_to_obstacle(Outline &) const;
  void find_surface(ArrayBody &) const;
  bool is_pushed(int label) const;
  void update_reach();
  void find_safe_until(FreeBody &);
  struct Look;
  double rest_s() const;
  int horizon() const;
  double horizon_s() const;
  double unforeseen_s() const;
  void find_pairs(Look &) const;
  void watch_bodies_in_flight(const Look &);
  bool is_calm(ArrayBody &);
  void let_calm_bodies_depart(Look &);
  void keep_those_that_meet(Look &, const std::vector<char> &is_part, std::vector<char> &leaves);
  bool is_gentle(const Look &, ArrayBody &, double limit_N);
  void depart(ArrayBody &);
  void note_elastic_energies();
  void add_pair_energy_by_body(double *energy) const;
  void remove_leaving();
  int put_in_arrays(FreeBody &, double half_step);
  bigint next_event() const;
};

}  // namespace LAMMPS_NS
