#pragma once

namespace LAMMPS_NS {

class CheckpointReader;
class CheckpointWriter;

// A fix with state of its own that a checkpoint keeps. All ranks call these together.
class Checkpointed {
 public:
  virtual ~Checkpointed() {}
  // Called at the end of each step at which a checkpoint may be taken, whether one is taken or not. The fix makes
  // anew what depends on how the run came here, such as the order of a list, so that a resumed run goes on in the
  // same order.
  virtual void begin_anew() {}
  virtual void save(CheckpointWriter &) = 0;  // must also flush the files that the fix appends to
  // Called after setup() of a resumed run; setup() must leave alone what is restored here.
  virtual void restore(const CheckpointReader &) = 0;
  // Called when the engine's half of the checkpoint of this step is on disk.
  virtual void saved(long long) {}

  bool resuming = false;  // set before setup() of a resumed run
};

// Knows whether the next set-up goes on from a checkpoint, at which bodies may be in free flight.
class ResumesRun {
 public:
  virtual ~ResumesRun() {}
  virtual bool is_resuming() const = 0;
};

}  // namespace LAMMPS_NS
