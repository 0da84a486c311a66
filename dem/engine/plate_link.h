#pragma once
#include <string>
#include <vector>

#include "peer.h"

namespace LAMMPS_NS {

class LAMMPS;

// The engine's end of the file exchange with the plate (docs/exchange.md). Two files, usually named pipes:
// the engine writes what the stones did to the plate, the plate answers where it will be.
//
//   to the plate:   int64 step, int64 co-steps passed, int64 co-steps ahead, double mean modal force[modes] over the passed
//   from the plate: int64 step (the same), double reach, double amplitude[modes], double rate[modes]
//
// `reach` bounds |w| anywhere until the next exchange if nothing touches the plate. The answer to step s tells where
// the plate is predicted to be so many co-steps ahead. A step of -1 from the engine says that it has finished, -2 that it
// has taken a checkpoint at the step that stands in the place of the co-steps; the plate answers -2 when it has, too.
class PlateLink {
 public:
  PlateLink(LAMMPS *lmp, const std::string &to_plate, const std::string &from_plate, int modes);
  ~PlateLink();
  void open();  // before the first exchange of a resumed run; otherwise that opens the files itself
  void exchange(long long step, long long co_steps, long long ahead, const double *modal_force);
  void checkpoint(long long step);  // the plate keeps its half of the checkpoint of this step; returns when it has
  void finish();

  double reach = 0;
  std::vector<double> amplitude, rate;

 private:
  LAMMPS *lmp_;
  int out_ = -1, in_ = -1;
  bool answered_ = false;  // has the plate ever?
  std::string to_, from_;
  Peer plate_;

  void send(long long step, long long co_steps, long long ahead, const double *modal_force);
  void receive(void *data, size_t bytes);
  void receive_answer(long long step);
  void wait_for_input();
  void check_plate();
};

}  // namespace LAMMPS_NS
