#pragma once
#include <memory>
#include <vector>

#include "bodies/free_body.h"
#include "bodies/held_bodies.h"
#include "fix.h"
#include "flight/free_flight_looks.h"
#include "interfaces/agglomerates.h"
#include "interfaces/checkpointed.h"
#include "interfaces/energy_holder.h"
#include "interfaces/free_flight_partners.h"

namespace LAMMPS_NS {

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
  bool holds_others() const override { return held_->has_changed(); }
  void change_arrays() override;
  void show() override;
  void hide() override;
  void bring_back() override;
  double body_skin() const override { return body_skin_; }

 private:
  std::unique_ptr<Agglomerates> agglomerates_;
  std::unique_ptr<HeldBodies> held_;
  FreeFlightLooks::Bodies bodies_;
  std::unique_ptr<FreeFlightLooks> looks_;
  BodyMaker *bonds_ = nullptr;
  Obstacle *plate_ = nullptr;
  class FixContactHistory *history_ = nullptr;
  class StoneStream *stream_ = nullptr;
  Vec down_ = Vec(0, 0, -1);   // unit vector
  Vec weight_;                 // m/s^2
  std::vector<double> least_radius_, greatest_radius_;  // by type, of the deck's sub-spheres, m; 0: there are none
  int unheld_ = 0;             // bit of the group
  double body_skin_ = 0;       // of neighbours within a body, m; 0: that of the deck
  int shown_ = 0;              // sub-spheres appended by show
  bigint jumped_ = 0;

  void note_radii();
  std::vector<FreeBody *> bodies_in_flight();
  void visit_parts(const FreeBody &, const Visit &) const;
  void check_count() const;
  void remove_leaving();
  int put_in_arrays(FreeBody &, double half_step);
  bigint next_event() const;
};

}  // namespace LAMMPS_NS
