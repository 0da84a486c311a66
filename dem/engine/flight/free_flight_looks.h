#pragma once
#include <memory>
#include <vector>

#include "bodies/array_body.h"
#include "bodies/free_body.h"
#include "bodies/held_bodies.h"
#include "interfaces/agglomerates.h"
#include "interfaces/free_flight_partners.h"
#include "laws/hertz_law.h"
#include "pointers.h"

namespace LAMMPS_NS {

class CheckpointReader;
class CheckpointWriter;
class StoneStream;

const bigint FAR_AHEAD = 1000000000000000;  // steps

// What the deck tells of free flight.
struct FlightRules {
  Vec weight;              // m/s^2
  double speed = 0;        // of the impact, m/s
  double tolerance = 0;    // share of the energy of the impact below which a body is calm
  int every = 0;           // steps between two looks
  int least_fragment = 0;  // sub-spheres: a fragment of fewer is taken out as soon as it flies
};

// The looks of fix free_flight, each N steps: which bodies leave the arrays, which come back, and which are held.
class FreeFlightLooks : protected Pointers {
 public:
  using Bodies = std::vector<std::unique_ptr<FreeBody>>;  // in free flight
  FreeFlightLooks(LAMMPS *, const FlightRules &, const Agglomerates &, HeldBodies &, Bodies &);
  void init();
  void setup();
  // Each is true if the arrays change at the next step.
  bool look();
  bool watch_plate();      // which may have been struck since the last look
  int horizon() const;     // steps until the next look has been acted on
  bigint departures() const { return departures_; }

  void save(CheckpointWriter &) const;
  void restore(const CheckpointReader &);

 private:
  const FlightRules rules_;
  const Agglomerates &agglomerates_;
  HeldBodies &held_;
  Bodies &bodies_;
  std::unique_ptr<HertzLaw> law_;
  BodyMaker *bonds_ = nullptr;
  Obstacle *plate_ = nullptr;
  std::vector<SideWall *> walls_;
  StoneStream *stream_ = nullptr;
  std::vector<int> calm_, still_;  // looks in a row at which a body was calm, and even still, by its least tag
  std::vector<double> bond_energy_, pair_energy_;  // room for the energies of bodies, by least tag, J
  PlateOutline outline_;           // of the plate, with the reach that all safe_until hold for
  double largest_modulus_ = 0;     // E* of all pairs of types, Pa
  bigint departures_ = 0;

  struct Look;
  int body_of(int tag) const { return bonds_ ? bonds_->body_of_tag()[tag] : tag; }
  double rest_s() const;
  double horizon_s() const;
  double unforeseen_s() const;
  double time_to_message(Outline &) const;
  double time_to_obstacle(Outline &) const;
  bool has_left(const Outline &) const;
  bool have_left(const Outline &a, const Outline &b) const { return stream_ && has_left(a) && has_left(b); }
  bool is_dust(const FreeBody &) const;
  bool is_clear(FreeBody &) const;
  bool is_pushed(int label) const;
  bool is_calm(ArrayBody &);
  bool is_gentle(const Look &, ArrayBody &, double limit_N);
  void find_surface(ArrayBody &) const;
  void update_reach();
  void find_safe_until(FreeBody &);
  void find_pairs(Look &) const;
  void take_out_those_that_left();
  void watch_bodies_in_flight(const Look &);
  void let_calm_bodies_depart(Look &);
  void keep_those_that_meet(Look &, const std::vector<char> &is_part, std::vector<char> &leaves);
  void depart(ArrayBody &);
  void note_elastic_energies();
  void add_pair_energy_by_body(double *energy) const;
};

}  // namespace LAMMPS_NS
