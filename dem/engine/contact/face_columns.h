#pragma once
#include <string>
#include <vector>

#include "bodies/outline.h"
#include "kernels/bond_network.h"
#include "contact/face_press.h"
#include "contact/sphere_memory.h"
#include "base/vec.h"

namespace LAMMPS_NS {

class Atom;
class CheckpointReader;
class CheckpointWriter;
class LAMMPS;
struct EnteringStone;

// The column of rock between a flat face of a stone and the centre of a sub-sphere behind it (docs/contact.md).
struct FaceColumn {
  Vec normal;            // of the face, outwards, in the undeformed stone
  double height = 0;     // of the column: from the centre of the sub-sphere to the face, m
  double stiffness = 0;  // N/m
  double area = 0;       // share of the face, m^2
};

// Which sub-spheres meet the plate with a face. A contact begins as one of a face where the face is parallel to the
// plate and the sub-sphere has kept its bonds, else as one of the sub-sphere itself; it stays what it is until it is
// free, so that it is conservative.
//
// File: the most that a face lies outside its sub-sphere, m. Then lines of tag, normal, height, stiffness and area, by
// ascending tags; or the word `stream`, where they come with their stones (fix stones).
class FaceColumns {
 public:
  FaceColumns(LAMMPS *, const std::string &file, int tags);
  void setup();
  void enter(const EnteringStone &);
  void leave(int first_tag, int count);

  double outside() const { return outside_; }
  double outside_of(int i);  // the same of the faces with which sub-sphere i may press from now on

  // Sub-sphere i at `distance` (m) of its centre from the plate, which it approaches by `speed` (m/s). `is_over_plate`:
  // and not beside it.
  FacePress press(int i, double distance, double speed, bool is_over_plate);

  // Those with which sub-sphere i may press from now on.
  void add_faces(int i, std::vector<Face> &);

  SphereMemory &memory() { return memory_; }
  void save(CheckpointWriter &out) const { memory_.save(out, "wall_faces"); }
  void restore(const CheckpointReader &in) { memory_.restore(in, "wall_faces"); }

 private:
  LAMMPS *lmp_;
  const Atom *atom_;
  BondNetwork *bonds_ = nullptr;
  std::vector<std::vector<FaceColumn>> columns_;  // by tag
  SphereMemory memory_;       // 0: free, ALONE, or 1 + number of the column that presses; its offset, m; its force, N
  double outside_ = 0;
  std::vector<int> held_, all_;  // bonds of each tag: that hold, and that there were
  long long counted_ = -1;       // changes of the bonds when they were counted

  FacePress now(int i, double distance, double way);
  int column_beneath(int i) const;
  bool has_its_bonds(int tag);
  bool may_press(int i);
  void put(const double *row);
};

}  // namespace LAMMPS_NS
