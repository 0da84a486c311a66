#pragma once
#include <cstdio>
#include <memory>
#include <utility>
#include <vector>

#include "agglomerates.h"
#include "checkpointed.h"
#include "fix.h"
#include "free_flight_partners.h"

namespace LAMMPS_NS {

// fix ID group pictures agglomerates FILE file FILE every N [impact M FIRST LAST [FIRST LAST ...]]
//
// Appends where all sub-spheres are and how they move, and the contacts with the plate: int64 step, int64 number of
// contacts, float32 x y z (m) and vx vy vz (m/s) of each sub-sphere in the order of the tags, and of each contact a row
// as contact_recorder.h has it. That is every N steps, and every M steps from one of the steps FIRST to its LAST while
// anything pushes on the plate. It changes nothing, so that a run with pictures gives the same numbers as one without.
// It comes after fix wall/plate and before fix free_flight.
class FixPictures : public Fix, public Checkpointed, public ActsInFreeFlight {
 public:
  FixPictures(class LAMMPS *, int, char **);
  ~FixPictures() override;
  int setmask() override;
  void init() override;
  void setup(int) override;
  void end_of_step() override;
  void post_run() override;
  int acts_every() const override { return every_; }  // nothing pushes while all bodies are in free flight
  void save(CheckpointWriter &) override { post_run(); }
  void restore(const CheckpointReader &) override {}

 private:
  std::unique_ptr<Agglomerates> agglomerates_;
  int every_ = 0, impact_every_ = 0;                // steps
  std::vector<std::pair<bigint, bigint>> impacts_;  // first and last step
  Pushed *plate_ = nullptr;
  FlyingSpheres *flying_ = nullptr;
  std::FILE *file_ = nullptr;

  bool is_due() const;
  bool is_pushed() const;
  void write() const;
};

}  // namespace LAMMPS_NS
