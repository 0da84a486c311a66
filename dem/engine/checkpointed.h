#pragma once

namespace LAMMPS_NS {

class CheckpointReader;
class CheckpointWriter;

// A fix with state of its own that a checkpoint keeps. All ranks call these together.
class Checkpointed {
 public:
  virtual ~Checkpointed() {}
  // At the end of each step at which a checkpoint may be taken, taken or not: whatever hangs on the way the run came
  // here, such as the order of a list, is made anew, so that a resumed run goes on in the same order.
  virtual void begin_anew() {}
  virtual void save(CheckpointWriter &) = 0;
  // After setup() of a resumed run, which must leave alone what is restored here.
  virtual void restore(const CheckpointReader &) = 0;
  // The engine's half of the checkpoint of this step is on disk.
  virtual void saved(long long) {}

  bool resuming = false;  // set before setup() of a resumed run
};

}  // namespace LAMMPS_NS
