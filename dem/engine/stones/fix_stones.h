#pragma once
#include <cstdio>
#include <memory>
#include <vector>

#include "interfaces/agglomerates.h"
#include "interfaces/checkpointed.h"
#include "interfaces/energy_holder.h"
#include "fix.h"
#include "interfaces/free_flight_partners.h"
#include "stones/stone_file.h"
#include "interfaces/stone_stream.h"

namespace LAMMPS_NS {

// fix ID group stones file FILE agglomerates FILE left FILE [gravity G] [down X Y Z]
//
// A stream of stones (docs/stream.md). Each enters the arrays at its step, with its bonds and its surface, and fix
// free_flight hands over what has left the plate for good. What a stone held when its last piece has gone is forgotten
// as soon as the ledger has its last row. Where a stone is to enter and something is in the way, it enters as much
// later; those behind it do not wait for it. So memory and cost follow the stones that are near. The deck's `read_data`
// has no sub-spheres. The fix comes after fixes bond/parallel and wall/plate and before free_flight. It works on one
// rank, as bodies in free flight do.
//
// `left` is a table with a row for each body that was taken out.
class FixStones : public Fix, public Checkpointed, public EnergyHolder, public StoneStream,
                  public ActsInFreeFlight {
 public:
  FixStones(class LAMMPS *, int, char **);
  ~FixStones() override;
  int setmask() override;
  void init() override;
  void post_run() override;
  double max_rad(int type) override { return file_->greatest_radius(type); }
  double min_rad(int type) override { return type <= file_->types() ? file_->least_radius() : 0; }
  int min_type() override { return 1; }
  int max_type() override { return file_->types(); }
  double compute_scalar() override { return static_cast<double>(near_.size()); }  // stones that are near

  void add_to(LedgerRows &) override;

  const std::vector<int> &near() const override { return near_; }
  int tags_near() const override { return tags_near_; }
  bigint next_entry() const override;
  std::vector<Ball> wanted() override;
  void let_enter(const std::vector<Vec> &flying) override;
  void take_out(const LeftBody &) override;
  std::vector<int> close_finished() override;
  double entered_kinetic_J() const override { return entered_kinetic_; }
  double entered_mass_height() const override { return entered_mass_height_; }
  double smallest_radius() const override { return file_->least_radius(); }
  void take_up(const CheckpointReader &) override;

  void begin_anew() override { forget(); }  // a checkpoint has no bonds of stones that have gone
  void save(CheckpointWriter &) override;
  void restore(const CheckpointReader &) override {}  // take_up did, before the set-up

 private:
  struct Gone {          // of a stone, what was taken out with its pieces; how late it entered
    int tags = 0;
    double kinetic = 0, momentum_z = 0, mass_height = 0, bond_elastic = 0, pair_elastic = 0, waited_steps = 0;
  };
  std::unique_ptr<Agglomerates> agglomerates_;
  std::unique_ptr<StoneFile> file_;
  std::vector<int> order_;     // agglomerates by their step of entry
  size_t due_ = 0;             // how many of them have come to their step
  std::vector<EnteringStone> waiting_;  // of those, what something is in the way of
  std::vector<int> near_, to_forget_;
  std::vector<Gone> gone_;     // by agglomerate
  double range_ = 0;           // between centres of sub-spheres that could touch, m
  bool tries_ = false;         // do those that wait try to enter at this step?
  int tags_near_ = 0;
  double entered_kinetic_ = 0, entered_mass_height_ = 0;
  Vec weight_ = Vec(0, 0, 0), up_ = Vec(0, 0, 1);  // m/s^2; unit vector
  FILE *left_ = nullptr;

  void make_room_for_tags();
  bool find_due();
  void enter_waiting(double half_step, const std::vector<Vec> &flying);
  Ball ball_of(const EnteringStone &) const;
  void enter(const EnteringStone &, double half_step);
  bool is_free(const EnteringStone &, const std::vector<Vec> &flying) const;
  void add_atom(const EnteringStone &, int k, double half_step);
  void forget();
};

}  // namespace LAMMPS_NS
