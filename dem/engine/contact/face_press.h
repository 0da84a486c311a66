#pragma once
#include <algorithm>

namespace LAMMPS_NS {

// How a face presses by the column of rock behind it (face_columns.h).
struct FacePress {
  bool acts = false;                          // or the sub-sphere itself touches
  double depth = 0, stiffness = 0, area = 0;  // of the face below the plate, m; of the column, N/m and m^2
  double way = 0;                             // of the sub-sphere along the normal in this step, m
  double force_before = 0;                    // a step ago, N

  // k depth. The integrator does the work of a step with the mean of the forces at both its ends, which is right but for
  // the step in which the contact begins or ends; half of k depth (1 + depth/way) in that step makes the sum right too.
  double force() const {
    const double d = std::max(depth, 0.0);
    return stiffness * d * (d < way ? 0.5 * (1 + d / way) : 1);
  }
  double stored() const { return 0.5 * stiffness * std::max(depth, 0.0) * std::max(depth, 0.0); }  // J
  double pressure() const { return force() / area; }
};

}  // namespace LAMMPS_NS
