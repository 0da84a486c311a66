#pragma once
#include <string>
#include <vector>

#include "coupling/watchdog.h"

namespace LAMMPS_NS {

class LAMMPS;

// The engine's end of the coupling with the plate (docs/coupling.md). There are two files, usually named pipes: the
// engine writes what the stones did to the plate, and the plate answers where it will be.
//
//   to the plate:   int64 step, int64 co-steps passed since the last message, int64 co-steps to extrapolate,
//                   double modal force[modes], the mean over the co-steps passed, N kg^-1/2
//   from the plate: int64 step (the same), double reach, double amplitude[modes], double rate[modes]
//
// The answer tells where the plate is predicted to be after the co-steps to extrapolate. `reach` bounds |w| anywhere
// until the next message if nothing touches the plate. Step -1 of the engine says that it has finished; the plate
// answers -1, so that neither side is gone before the other has looked. Step -2 says that it has taken a checkpoint, at
// the step that stands in the place of the co-steps passed; the plate answers -2 when it has, too.
class PlateLink {
 public:
  PlateLink(LAMMPS *lmp, const std::string &to_plate, const std::string &from_plate, int modes);
  ~PlateLink();
  void open();  // before the first message of a resumed run; otherwise the first message opens the files itself
  void message(long long step, long long co_steps_passed, long long extrapolated_co_steps, const double *modal_force);
  void checkpoint(long long step);  // returns when the plate's half of the checkpoint of this step is on disk
  void finish();                    // returns when the plate knows

  double reach = 0;                     // m
  std::vector<double> amplitude, rate;  // kg^1/2 m and kg^1/2 m/s

 private:
  LAMMPS *lmp_;
  int out_ = -1, in_ = -1;
  bool answered_ = false;  // has the plate ever?
  std::string to_, from_;
  PlateWatchdog plate_;

  void send(long long step, long long co_steps, long long extrapolated, const double *modal_force);
  void tell(long long kind, long long step);
  void receive(void *data, size_t bytes);
  void receive_answer(long long step);
  void check_answer(long long step) const;
  void wait_for_input();
  void check_plate();
};

}  // namespace LAMMPS_NS
