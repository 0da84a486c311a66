#include "coupling/watchdog.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace LAMMPS_NS {

namespace {
const double LONGEST_POLL_s = 0.5; // what one look counts at most: time in which the engine was stopped does not count

double now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}
}  // namespace

PlateWatchdog PlateWatchdog::from_environment() {
  PlateWatchdog watchdog;
  char host[256] = "", mine[256] = "";
  const char *text = std::getenv("PLATE_PROCESS");
  gethostname(mine, sizeof mine - 1);
  const bool known = text && std::sscanf(text, "%255s %d %lf", host, &watchdog.pid_, &watchdog.stuck_s_) >= 2;
  if (known && std::strcmp(host, mine) != 0) watchdog.pid_ = 0;
  watchdog.last_s_ = now_s();
  return watchdog;
}

std::string PlateWatchdog::trouble() {
  if (pid_ == 0) return "";
  char state = 0;
  long user = 0, system = 0;
  FILE *stat = std::fopen(("/proc/" + std::to_string(pid_) + "/stat").c_str(), "r");
  if (!stat) return "";  // gone: the pipe will tell
  char text[1024] = "";
  const size_t size = std::fread(text, 1, sizeof text - 1, stat);
  std::fclose(stat);
  text[size] = 0;
  const char *after_name = std::strrchr(text, ')');
  if (!after_name || std::sscanf(after_name + 1, " %c %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %ld %ld", &state, &user,
                                 &system) != 3)
    return "";
  const double now = now_s();
  if (user + system != cpu_ || state == 'D') still_s_ = 0;
  else still_s_ += std::min(now - last_s_, LONGEST_POLL_s);
  cpu_ = user + system;
  last_s_ = now;
  if (still_s_ <= stuck_s_) return "";
  char still[64] = "";
  std::snprintf(still, sizeof still, ": no processor time in %g s", stuck_s_);
  return std::string("The plate (process ") + std::to_string(pid_) + ")" +
         (state == 'T' || state == 't' ? " is stopped by a signal" : " is stuck") + still;
}

}  // namespace LAMMPS_NS
