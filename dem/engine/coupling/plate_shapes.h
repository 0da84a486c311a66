#pragma once
#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

namespace LAMMPS_NS {

class LAMMPS;

// Mode shapes of the plate on a regular grid, kg^-1/2. Between the nodes: the cubic through four nodes in each
// direction (error of fourth order in the spacing).
//
// File, little endian: the word of its format, "shapes 3"; int64 nx, ny, directions, modes; double x0, y0, dx, dy (of the
// grid, which reaches beyond the plate so that four nodes surround every point of it); double [modes][nx][ny], upwards.
// A plate that friction can move in its plane has two more directions, x and y, of its top surface: float
// [2][modes][nx][ny].
class PlateShapes {
 public:
  PlateShapes(LAMMPS *lmp, const std::string &file);
  int modes() const { return static_cast<int>(modes_); }
  int directions() const { return static_cast<int>(directions_); }
  int numbers() const { return directions() * modes(); }  // at a point: [directions][modes]
  double cell_m() const { return std::min(dx_, dy_); }
  void at(double x, double y, double *shape, double *by_x, double *by_y) const;  // and its slopes

 private:
  long long nx_, ny_, directions_, modes_;
  double x0_, y0_, dx_, dy_;
  std::vector<double> shape_;  // [nx][ny][directions][modes]

  static bool is_of_this_format(std::FILE *in);
  bool read(std::FILE *in);
  template <class Number> bool take(std::FILE *in, int first, int end);  // of the numbers at a point
};

}  // namespace LAMMPS_NS
