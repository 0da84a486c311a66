#pragma once
#include <memory>
#include <string>
#include <vector>

#include "agglomerates.h"
#include "checkpointed.h"
#include "fix.h"
#include "hertz_law.h"
#include "idle_body.h"

namespace LAMMPS_NS {

// fix ID group idle agglomerates FILE [gravity G] speed V tolerance TOL every N
//
// Bodies (sub-spheres that intact bonds hold together) that touch nothing and do not vibrate leave LIGGGHTS's arrays
// and fly as rigid bodies on their exact path until they could touch something; when all do, time jumps (docs/idle.md).
// A body is calm when the kinetic energy of its inner motion is below TOL x m V^2/2, V being the speed of the impact.
// Looked at every N steps. Gravity acts along -z. For one rank; after all other fixes.
class FixIdle : public Fix, public Checkpointed {
 public:
  FixIdle(class LAMMPS *, int, char **);
  ~FixIdle() override;
  int setmask() override;
  void init() override;
  void setup(int) override;
  void end_of_step() override;
  void begin_anew() override;
  void save(CheckpointWriter &) override;
  void restore(const CheckpointReader &) override;
  double compute_scalar() override;        // sub-spheres that are idle
  double compute_vector(int) override;     // 1: steps jumped over; 2: departures

  // For the run loop.
  void jump();           // ahead to just before the next step at which something happens
  void change_arrays();  // between pre_exchange and the build of neighbour lists
  void show();           // appends idle bodies to the arrays if a dump or a restart is due
  void hide();           // and takes them out again
  void bring_back();     // all idle bodies, for good, at the end of a step

  // Idle bodies at the present step, without those still in the arrays.
  std::vector<IdleBody *> bodies();

 private:
  class AwakeBody;
  std::unique_ptr<Agglomerates> agglomerates_;
  std::unique_ptr<HertzLaw> law_;
  class FixBondParallel *bonds_ = nullptr;
  class FixWallPlate *wall_ = nullptr;
  class FixLedger *ledger_ = nullptr;
  class FixContactHistory *history_ = nullptr;
  double gravity_ = 0, speed_ = 0, tolerance_ = 0;
  std::vector<std::unique_ptr<IdleBody>> bodies_;
  std::vector<int> calm_;      // looks in a row at which a body was calm, by its least tag
  PlateOutline plate_;         // with the reach that all safe_until hold for
  int shown_ = 0;              // sub-spheres appended by show
  bigint jumped_ = 0, departures_ = 0;

  int body_of(int tag) const;
  std::vector<AwakeBody> find_awake();
  void update_reach();
  void watch_idle(std::vector<AwakeBody> &);
  double free_time(IdleBody &);
  void find_lodged(std::vector<AwakeBody> &);
  bool is_calm(const AwakeBody &);
  void retire_calm(std::vector<AwakeBody> &);
  void retire(AwakeBody &);
  void note_elastic_energies();
  void remove_leaving();
  int insert(IdleBody &, double half_step);
};

}  // namespace LAMMPS_NS
