#pragma once
#include <vector>

#include "bodies/outline.h"
#include "interfaces/agglomerates.h"
#include "contact/face_press.h"
#include "contact/sphere_memory.h"
#include "interfaces/stone_stream.h"
#include "base/vec.h"

namespace LAMMPS_NS {

class CheckpointReader;
class CheckpointWriter;
class LedgerRows;

// A sub-sphere near the plate. At each step fix wall/plate fills in where it is and how the plate moves beneath it, and
// the contact law what the plate does to it.
struct NearSphere {
  int i = -1;                         // local index
  double outside = 0;                 // how far what touches may reach below it, m
  bool stands_for_patch = false;      // then the plate's push and its motion are those at the foot of the patch
  double to_foot[2] = {0, 0};         // from its centre to there, along x and y, m
  double plate_z = 0, plate_v = 0;    // height (m) and velocity (m/s) of the plate beneath it, or at its nearest edge
  Vec plate_moved;                    // how far from there the plate is for it, m
  double plate_drift[2] = {0, 0};     // velocity of the plate's top face there along x and y, m/s
  bool touches = false;               // does the plate act on it?
  bool in_patch = false;              // together with others of its stone
  Vec normal;                         // of a contact alone: from the nearest point of the plate to its centre
  double push = 0;                    // of the force on the plate, what acts beneath it, N
  double drag[2] = {0, 0};            // and of that on the stones across, along x and y, N
  double force[3], torque[3];         // of the plate on it, N and N m; only where it touches
  double depth = 0;                   // how far it reaches below the surface of the plate, m
  double overlap = 0;                 // of the elastic contact with the same force, m
  FacePress face;                     // of its stone, where that presses and not the sub-sphere
  Vec rubbed;                         // of the force, its tangential dashpot's part, N
};

// The plate as a law sees it that treats several sub-spheres together.
class PlateBeneath {
 public:
  virtual ~PlateBeneath() {}
  virtual const double *extent() const = 0;  // XMIN XMAX YMIN YMAX, m
  virtual void find_plate(size_t near) = 0;  // fills in what the plate does at the foot of a patch, in the list of what is near
};

// The contact law between sub-spheres and the plate. A law sees all sub-spheres of this rank that are near the plate,
// so it may treat each one alone or those of an agglomerate together, and it keeps what history it needs. The plate is
// flat and level under each of them.
//
// A law of its own derives from this class, is made by fix wall/plate where the deck names it, and gives:
//   forces      add_forces adds to the forces and torques of LIGGGHTS's arrays and notes them in each NearSphere. The
//               fix takes works, pushes on the plate and modal forces from there.
//   energies    add_to adds WALL_ELASTIC, WALL_DAMPED, WALL_PLASTIC, WALL_RELEASED, FRICTION, SPRINGS and WALL_DEEPEST,
//               so that the ledger closes.
//   history     memory() is for numbers that travel with a sub-sphere, save and restore are for all that a checkpoint
//               keeps. A NearSphere is forgotten when the list is made anew, so nothing that must last may stand there.
// The sub-spheres of a body in free flight are in none of the lists: it left when it touched nothing, and it comes back
// before it touches anything.
class PlateContact {
 public:
  virtual ~PlateContact() {}
  virtual void enter(const EnteringStone &) {}  // of a stream of stones
  virtual void leave(int) {}                    // an agglomerate of which nothing is left
  virtual void came_back() {}                   // some body from free flight
  virtual void setup() {}  // before the first step of each run
  // Once a step, when the other forces of the step are known. The plate stays within `reach` (m) of z = 0 until the
  // next message. `vflag` asks LIGGGHTS for the virial.
  virtual void add_forces(std::vector<NearSphere> &, double reach, int vflag) = 0;
  // When the velocities at the end of the step are known, with which damping does its work. Adds the work (J, by
  // agglomerate) of what the law gave to sub-spheres beside the forces noted in each NearSphere.
  virtual void end_of_step(const std::vector<NearSphere> &, std::vector<double> &work_on_stone) = 0;
  virtual void add_to(LedgerRows &, const std::vector<NearSphere> &) const = 0;  // see EnergyHolder
  // Elastic normal force, N, and the radius of the sphere that presses, m: what bending and yielding are judged by.
  struct Pressing {
    double force_N, radius_m;
  };
  virtual Pressing pressing(const NearSphere &) const = 0;  // of one that touches

  // How far what touches may reach below sub-spheres of a smooth surface, and up to which height above the plate the
  // law needs to see sub-spheres, m. Fewer than LEAST_IN_PATCH sub-spheres of a surface that hold together touch alone.
  static constexpr int LEAST_IN_PATCH = 3;
  virtual double outside() const { return 0; }
  virtual double listed_height() const { return 0; }
  // Of a body, see Obstacle.
  virtual double outside(const std::vector<int> &) const { return 0; }
  virtual Shell surface(const std::vector<int> &) const { return {}; }
  virtual double faces_outside() const { return 0; }
  virtual void add_faces(int, std::vector<Face> &) {}
  // When the list of what is near is made anew: fills in NearSphere::outside. All ranks call it together.
  virtual void list(std::vector<NearSphere> &) {}
  // Tags of sub-spheres that the law needs to see wherever they are.
  virtual const std::vector<int> &always_listed() const {
    static const std::vector<int> none;
    return none;
  }

  virtual SphereMemory *memory() { return nullptr; }
  virtual void save(CheckpointWriter &, const std::vector<NearSphere> &) const = 0;
  virtual void restore(const CheckpointReader &) = 0;
};

}  // namespace LAMMPS_NS
