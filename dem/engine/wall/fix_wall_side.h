#pragma once
#include <cstdio>
#include <memory>
#include <string>

#include "wall/fix_wall.h"
#include "interfaces/free_flight_partners.h"
#include "contact/granular_contact.h"
#include "bodies/outline.h"

namespace LAMMPS_NS {

// fix ID group wall/side agglomerates FILE forces FILE every N box XMIN XMAX YMIN YMAX ZMIN ZMAX
//     contact (arguments of wall/gran with a zplane at 0)
//
// A wall that does not move: a rectangle with its edges, given as a box that is flat along one axis (m). Each sub-sphere
// touches it alone, from either side, by the stock contact law (GranularContact).
//
// Forces file: int64 step, double x, y, z, N: a row for each N steps, up to and with this one, in which something pushed
// on the wall, with the mean force on it.
class FixWallSide : public FixWall, public SideWall {
 public:
  FixWallSide(class LAMMPS *, int, char **);
  ~FixWallSide() override;

  void setup(int) override;
  void post_force(int) override;
  void end_of_step() override;
  void post_run() override { flush(); }

  void add_to(LedgerRows &) override;
  const WallOutline &outline() const override { return box_; }

  void save(CheckpointWriter &) override;
  void restore(const CheckpointReader &) override;

 private:
  std::unique_ptr<GranularContact> contact_;
  WallOutline box_;
  int every_ = 0;       // steps of a row of forces
  bigint row_end_ = 0;  // step at which the present one ends
  Vec pushed_;          // sum over the steps of the row so far, on this rank, N
  FILE *forces_ = nullptr;

  std::string read_options(int narg, char **arg);
  Vec from_box(int i) const;
  void add_pushes();
  void write_row();
  void flush();
  void list_near() override;
  Vec from_wall(const NearSphere &p) const override { return from_box(p.i); }
};

}  // namespace LAMMPS_NS
