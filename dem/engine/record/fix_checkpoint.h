#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "interfaces/checkpoint_file.h"
#include "interfaces/checkpointed.h"
#include "fix.h"
#include "interfaces/free_flight_partners.h"

namespace LAMMPS_NS {

// fix ID group checkpoint every N directory DIR [resume STEP] [identity TEXT] [walltime T] streams FILE...
//
// It must be the last fix of a deck, after `velocity`. Every N steps (whole co-steps) there is a step at which the
// run can be resumed. The neighbour lists are built anew after each such step, whether a checkpoint is taken or not,
// so that a resumed run goes on as the undisturbed one does, on one rank bit by bit. A checkpoint is taken when the
// last one is so long ago that its cost is below one part in a hundred. When T seconds have passed since the fix was
// defined, one is taken at the next such step, and the run ends there; T = never is the default.
//
// STEP > 0 resumes the run at DIR/engine_STEP.checkpoint. The streams, which are the files that the run appends to,
// are cut back to their length at that step. Each checkpoint carries TEXT, which names the run. Who starts the engine
// has compared it, and checked what the streams hold until there. The last two checkpoints stay on disk. The set-up of LIGGGHTS computes forces from velocities half a step too
// late and advances contacts a second time; when it has finished they are put back as they were.
class FixCheckpoint : public Fix, public ResumesRun, public ActsInFreeFlight {
 public:
  FixCheckpoint(class LAMMPS *, int, char **);
  int setmask() override;
  void init() override;
  void setup(int) override;
  void end_of_step() override;
  bool is_resuming() const override { return resumed_ != nullptr; }
  int acts_every() const override { return nevery; }

  struct Stopped {  // thrown when a checkpoint was asked for and is on disk; main ends with STOPPED
    long long step;
  };
  static const int STOPPED = 75;  // EX_TEMPFAIL of sysexits.h: try again later

 private:
  std::string directory_, identity_;
  struct Stream {  // length and CRC-32 of what the last checkpoint found in the file
    std::string file;
    long long length = 0;
    uint32_t crc = 0;
  };
  std::vector<Stream> streams_;
  std::unique_ptr<CheckpointReader> resumed_;
  std::vector<long long> saved_;  // steps of the checkpoints on disk, the latest last
  double next_time_ = 0, stop_time_;  // s, of MPI_Wtime

  std::string file(long long step) const;
  std::vector<Checkpointed *> others() const;
  void save();
  void save_atoms(CheckpointWriter &);
  void save_contacts(CheckpointWriter &);
  void save_streams(CheckpointWriter &);
  void read_on(Stream &, int descriptor);
  void cut_streams();
  void keep_two();
  void resume(long long step);
  void put_in_order(const std::vector<double> &rows);
  void restore_forces();
  void restore_contacts();
};

}  // namespace LAMMPS_NS
