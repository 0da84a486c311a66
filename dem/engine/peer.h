#pragma once
#include <string>

namespace LAMMPS_NS {

// Is the process at the other end of a pipe stuck? The twin of dem/coupling/watchdog.py: told from its processor time, which a
// working process uses even on a crowded machine. Knows nothing about a peer that it was not told about.
class Peer {
 public:
  // From the environment: PLATE_PROCESS is "HOST PID", set by who starts the engine; empty or of another host: unknown.
  static Peer plate();
  // Call it often while the peer is waited for. Empty, or what is wrong.
  std::string trouble();

 private:
  int pid_ = 0;
  long cpu_ = -1;
  double still_s_ = 0, last_s_ = 0;
};

}  // namespace LAMMPS_NS
