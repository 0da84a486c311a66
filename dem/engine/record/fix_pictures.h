#pragma once
#include <cstdio>
#include <memory>
#include <utility>
#include <vector>

#include "interfaces/agglomerates.h"
#include "interfaces/checkpointed.h"
#include "fix.h"
#include "interfaces/free_flight_partners.h"

namespace LAMMPS_NS {

// fix ID group pictures agglomerates FILE file FILE every N [impact M FIRST LAST [FIRST LAST ...]]
//
// Appends where the sub-spheres of all stones that are near are and how they move, and the contacts with the plate:
// int64 step, contacts, stones; int64 agglomerate (from 0) of each stone; float32 x y z (m) and vx vy vz (m/s) of each
// of their sub-spheres in the order of the tags, zeros where one has left; and of each contact a row as
// contact_recorder.h has it. That is every N steps, and every M steps from one of the steps FIRST to its LAST while
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
  std::vector<int> row_of_;  // of the first sub-sphere of each agglomerate in a picture

  bool is_due() const;
  bool is_pushed() const;
  void write();
};

}  // namespace LAMMPS_NS
