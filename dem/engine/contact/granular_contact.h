#pragma once
#include <memory>
#include <string>
#include <vector>

#include "interfaces/agglomerates.h"
#include "contact/face_columns.h"
#include "laws/hertz_law.h"
#include "contact/plastic_indentation.h"
#include "contact/plate_contact.h"
#include "base/vec.h"

namespace LAMMPS_NS {

// The stock wall of LIGGGHTS at z = 0, as a fix lends it to a contact law.
class StockWall {
 public:
  virtual ~StockWall() {}
  virtual int type() const = 0;          // material of the wall
  virtual Vec from_wall(const NearSphere &) const = 0;  // to its centre, from the nearest point of the wall, m
  virtual void act(int vflag) = 0;       // adds its forces on the sub-spheres near it
  virtual int history_size() const = 0;  // numbers that it remembers of each sub-sphere
  virtual double *history(int i) = 0;
};

// Contact by the stock wall: each sub-sphere alone, with Hertz' law, dashpot, tangential spring and friction. The
// sub-spheres near the plate are moved into the frame of the plate (z - w, v_z - dw/dt at their place), the stock wall
// acts on them there, and they are moved back. So there is contact anywhere without seams, and the contact history
// stays with the stock wall. Beside the plate the nearest point is one of its edge, and the frame is turned so that the
// normal from there is upright: the force is continuous as a centre goes over the edge. The same holds for side walls,
// whose normals are turned upright as well. Where the plate yields, the stock wall meets a sub-sphere at the height at
// which its Hertz force is the plastic one, so that dashpot and friction act on that force too; and so it does where a
// sub-sphere presses with a face of its stone (FaceColumns).
class GranularContact : public PlateContact {
 public:
  // A yield pressure of 0 means a plate that stays elastic, Pa; an empty file of faces, that sub-spheres touch alone, as
  // they do on a plate that yields. Blocks of checkpoints begin with `name`.
  GranularContact(LAMMPS *, const Agglomerates &, StockWall &, double yield_pressure_Pa,
                  const std::string &name = "wall", const std::string &face_file = "");
  void setup() override;
  void enter(const EnteringStone &stone) override;
  void leave(int agglomerate) override;
  void add_forces(std::vector<NearSphere> &, double reach, int vflag) override;
  void end_of_step(const std::vector<NearSphere> &, std::vector<double> &work_on_stone) override;
  void add_to(LedgerRows &, const std::vector<NearSphere> &) const override;
  void add_energies(LedgerRows &, const std::vector<NearSphere> &) const;  // all but the deepest contact of the plate
  Pressing pressing(const NearSphere &) const override;
  double outside() const override { return faces_ ? faces_->outside() : 0; }
  double faces_outside() const override { return outside(); }
  void add_faces(int i, std::vector<Face> &faces) override {
    if (faces_) faces_->add_faces(i, faces);
  }
  double listed_height() const override { return outside(); }
  void list(std::vector<NearSphere> &) override;
  SphereMemory *memory() override;
  void save(CheckpointWriter &, const std::vector<NearSphere> &) const override;
  void restore(const CheckpointReader &) override;

 private:
  LAMMPS *lmp_;
  const Agglomerates &agglomerates_;
  StockWall &wall_;
  std::string name_;
  std::unique_ptr<HertzLaw> law_;
  std::unique_ptr<PlasticIndentation> indentation_;  // only where the plate yields
  std::unique_ptr<FaceColumns> faces_;               // only of stones that touch with them
  struct Kept {  // in space
    double z;
    Vec v, spin;
    Rotation upright;
  };
  std::vector<Kept> kept_;                         // of each near
  std::vector<double> springs_before_;             // tangential, as the last step left them: x, y of each near, m
  std::vector<double> damped_, friction_, gained_; // so far, by agglomerate, J: see LedgerColumn
  std::vector<double> deepest_;  // largest depth over radius so far, by agglomerate; on this rank

  double press(NearSphere &, double distance, bool is_over_plate);
  double overlap_of(int i, double face_force) const;
  double like_a_sphere(const NearSphere &) const;
  double overlap_before(const NearSphere &, double rise) const;
  void move_into_frame_of_plate(std::vector<NearSphere> &);
  void move_back(std::vector<NearSphere> &);
  void let_go(const NearSphere &);
  void measure_friction(NearSphere &, const double *spring_before);
  bool has_springs() const { return wall_.history_size() > 0; }
  double tangential_stiffness(int i, double overlap) const;
  Vec velocity_over_plate(const NearSphere &) const;
  Vec surface_velocity(const NearSphere &) const;
  double modulus(int i) const;
  int agglomerate_of(int i) const;
};

}  // namespace LAMMPS_NS
