#include "coupling/plate_shapes.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "error.h"
#include "lammps.h"

namespace LAMMPS_NS {

namespace {
const char FORMAT[] = "shapes 3";  // another one where the same numbers mean something else
const int AT_ONCE = 8;  // shapes, whose numbers at a point fill a line of the processor's cache
}  // namespace

PlateShapes::PlateShapes(LAMMPS *lmp, const std::string &file) {
  FILE *in = std::fopen(file.c_str(), "rb");
  if (in && !is_of_this_format(in))
    lmp->error->all(FLERR, ("Fix wall/plate: " + file + " is not of the format '" + FORMAT + "': this engine and the program that wrote the "
                            "deck are of different versions").c_str());
  const bool whole = in && read(in);
  if (in) std::fclose(in);
  if (!whole) lmp->error->all(FLERR, ("Cannot read the mode shapes from " + file).c_str());
}

bool PlateShapes::is_of_this_format(FILE *in) {
  char format[sizeof FORMAT] = {};
  return std::fread(format, 1, sizeof format - 1, in) == sizeof format - 1 && !std::strcmp(format, FORMAT);
}

bool PlateShapes::read(FILE *in) {
  long long size[4];
  double geometry[4];
  if (std::fread(size, 8, 4, in) != 4 || std::fread(geometry, 8, 4, in) != 4) return false;
  nx_ = size[0], ny_ = size[1], directions_ = size[2], modes_ = size[3];
  x0_ = geometry[0], y0_ = geometry[1], dx_ = geometry[2], dy_ = geometry[3];
  if (nx_ < 4 || ny_ < 4 || modes_ < 1 || (directions_ != 1 && directions_ != 3)) return false;
  const long start = std::ftell(in);
  std::fseek(in, 0, SEEK_END);
  if (std::ftell(in) - start != 1. * nx_ * ny_ * modes_ * (8 + 4 * (directions_ - 1))) return false;
  std::fseek(in, start, SEEK_SET);
  shape_.resize(nx_ * ny_ * numbers());
  return take<double>(in, 0, modes()) && take<float>(in, modes(), numbers());
}

template <class Number> bool PlateShapes::take(FILE *in, int first, int end) {
  const size_t points = nx_ * ny_;
  std::vector<Number> taken;
  for (int k = first; k < end; k += AT_ONCE) {
    const int some = std::min(AT_ONCE, end - k);
    taken.resize(points * some);
    if (std::fread(taken.data(), sizeof(Number), taken.size(), in) != taken.size()) return false;
    for (size_t point = 0; point < points; point++)
      for (int m = 0; m < some; m++) shape_[point * numbers() + k + m] = taken[m * points + point];
  }
  return true;
}

namespace {
// Weights of the four nodes -1, 0, 1, 2 for a point at s in [0, 1] between the middle two (Lagrange), and their slopes.
void lagrange(double s, double *weight, double *slope) {
  weight[0] = -s * (s - 1) * (s - 2) / 6;
  weight[1] = (s + 1) * (s - 1) * (s - 2) / 2;
  weight[2] = -(s + 1) * s * (s - 2) / 2;
  weight[3] = (s + 1) * s * (s - 1) / 6;
  slope[0] = -((3 * s - 6) * s + 2) / 6;
  slope[1] = ((3 * s - 4) * s - 1) / 2;
  slope[2] = -((3 * s - 2) * s - 2) / 2;
  slope[3] = (3 * s * s - 1) / 6;
}
}  // namespace

// The slope along x divides by dx_ in `su`, that along y by dy_ at the end.
__attribute__((target_clones("avx2", "default")))
void PlateShapes::at(double x, double y, double *shape, double *by_x, double *by_y) const {
  const double u = (x - x0_) / dx_, v = (y - y0_) / dy_;
  const long long iu = std::clamp<long long>(std::floor(u), 1, nx_ - 3);
  const long long iv = std::clamp<long long>(std::floor(v), 1, ny_ - 3);
  const int n = numbers();
  double wu[4], wv[4], su[4], sv[4];
  lagrange(u - iu, wu, su);
  lagrange(v - iv, wv, sv);
  std::fill_n(shape, n, 0.0);
  std::fill_n(by_x, n, 0.0);
  std::fill_n(by_y, n, 0.0);
  for (int a = 0; a < 4; a++) {
    const double *p0 = &shape_[((iu - 1 + a) * ny_ + iv - 1) * n], *p1 = p0 + n, *p2 = p1 + n, *p3 = p2 + n;
#pragma omp simd
    for (int m = 0; m < n; m++) {
      const double along_y = wv[0] * p0[m] + wv[1] * p1[m] + wv[2] * p2[m] + wv[3] * p3[m];
      const double slope = sv[0] * p0[m] + sv[1] * p1[m] + sv[2] * p2[m] + sv[3] * p3[m];
      shape[m] += wu[a] * along_y;
      by_x[m] += su[a] / dx_ * along_y;
      by_y[m] += wu[a] / dy_ * slope;
    }
  }
}

}  // namespace LAMMPS_NS
