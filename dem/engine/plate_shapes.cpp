#include "plate_shapes.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "error.h"
#include "lammps.h"

namespace LAMMPS_NS {

PlateShapes::PlateShapes(LAMMPS *lmp, const std::string &file) {
  FILE *in = std::fopen(file.c_str(), "rb");
  long long size[4];
  double geometry[4];
  bool whole = in && std::fread(size, 8, 4, in) == 4 && std::fread(geometry, 8, 4, in) == 4;
  if (whole) {
    nx_ = size[0], ny_ = size[1], directions_ = size[2], modes_ = size[3];
    x0_ = geometry[0], y0_ = geometry[1], dx_ = geometry[2], dy_ = geometry[3];
    whole = nx_ >= 4 && ny_ >= 4 && (directions_ == 1 || directions_ == 3);
  }
  if (whole) {
    shape_.resize(nx_ * ny_ * numbers());
    whole = std::fread(shape_.data(), 8, shape_.size(), in) == shape_.size();
  }
  if (in) std::fclose(in);
  if (!whole) lmp->error->all(FLERR, ("Cannot read the mode shapes from " + file).c_str());
}

namespace {
// Weights of the four nodes -1, 0, 1, 2 for a point at s in [0, 1] between the middle two (Lagrange).
void lagrange(double s, double *weight) {
  weight[0] = -s * (s - 1) * (s - 2) / 6;
  weight[1] = (s + 1) * (s - 1) * (s - 2) / 2;
  weight[2] = -(s + 1) * s * (s - 2) / 2;
  weight[3] = (s + 1) * s * (s - 1) / 6;
}
}  // namespace

void PlateShapes::at(double x, double y, double *shape) const {
  const double u = (x - x0_) / dx_, v = (y - y0_) / dy_;
  const long long iu = std::clamp<long long>(std::floor(u), 1, nx_ - 3);
  const long long iv = std::clamp<long long>(std::floor(v), 1, ny_ - 3);
  double wu[4], wv[4];
  lagrange(u - iu, wu);
  lagrange(v - iv, wv);
  std::fill(shape, shape + numbers(), 0.0);
  for (int a = 0; a < 4; a++)
    for (int b = 0; b < 4; b++) {
      const double w = wu[a] * wv[b];
      const double *node = &shape_[((iu - 1 + a) * ny_ + iv - 1 + b) * numbers()];
      for (int m = 0; m < numbers(); m++) shape[m] += w * node[m];
    }
}

}  // namespace LAMMPS_NS
