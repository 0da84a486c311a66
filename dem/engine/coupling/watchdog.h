#pragma once
#include <string>

namespace LAMMPS_NS {

// Tells whether the plate's process is stuck while the engine waits for its answer; the twin of
// dem/coupling/pipes.py. A process is stuck when it uses no processor time, which a working one does even on a
// crowded machine.
class PlateWatchdog {
 public:
  // From the environment: PLATE_PROCESS is "HOST PID" or "HOST PID SECONDS", set by who starts the engine, with how long
  // the plate may do nothing, 10 s unsaid. Where it is missing, or names another host, nothing is ever found.
  static PlateWatchdog from_environment();
  // To be called often during the wait. Returns nothing, or one line that says what is wrong.
  std::string trouble();

 private:
  int pid_ = 0;
  long cpu_ = -1;  // clock ticks
  double stuck_s_ = 10, still_s_ = 0, last_s_ = 0;
};

}  // namespace LAMMPS_NS
