#pragma once
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "agglomerates.h"
#include "checkpointed.h"
#include "fix_wall_gran.h"
#include "hertz_law.h"
#include "plastic_law.h"
#include "plate_link.h"
#include "plate_shapes.h"

namespace LAMMPS_NS {

// fix ID group wall/plate agglomerates FILE forces FILE extent XMIN XMAX YMIN YMAX co_step N
//     [contacts FILE every N] [yield_pressure P]
//     [shapes FILE to_plate FILE from_plate FILE [light FORCE SPEED N]]
//     contact (arguments of wall/gran with a zplane at 0)
//
// The stock granular wall as the top face of the plate. Sub-spheres near the plate are moved into the frame of the
// plate (z - w, v_z - dw/dt at their place), the stock wall acts on them there, and they are moved back: contact
// anywhere, no seams, and contact history stays with the stock wall. The forces are projected on the mode shapes and
// their mean over each co-step of N steps goes to the plate, which answers where it is predicted to be at the end of
// the next one. Without shapes the plate is rigid and nothing is exchanged. While the stones push with less than FORCE
// and nothing comes near faster than SPEED, chips at rest say, one exchange serves N co-steps.
//
// With a yield_pressure the plate gives way under a sub-sphere (PlasticLaw): the stock wall meets the sub-sphere at the
// height at which its Hertz force is the plastic one, so that dashpot and friction act on that force too. The dent is
// remembered with the sub-sphere until this is clear of the plate and more than the dent's radius away.
class FixWallPlate : public FixWallGran, public Checkpointed {
 public:
  FixWallPlate(class LAMMPS *, int, char **);
  ~FixWallPlate() override;

  int setmask() override;
  void setup(int) override;
  void post_integrate() override;
  void post_force(int) override;
  void end_of_step() override;
  void post_run() override;
  void save(CheckpointWriter &) override;
  void restore(const CheckpointReader &) override;
  void saved(long long step) override;

  void grow_arrays(int) override;
  void copy_arrays(int, int, int) override;
  void set_arrays(int) override;
  int pack_exchange(int, double *) override;
  int unpack_exchange(int, double *) override;

  // By agglomerate, J: work of the contact on the sub-spheres, and on the moving plate.
  const std::vector<double> &work_on_stone() const { return work_on_stone_; }
  const std::vector<double> &work_on_plate() const { return work_on_plate_; }
  const std::vector<double> &damped() const { return damped_; }  // by the normal dashpots of the contacts
  const std::vector<double> &plastic() const { return plastic_; }  // taken by the plate's yielding
  const std::vector<double> &deepest() const { return deepest_; }  // largest overlap over radius so far; on this rank
  // Elastic energy now stored in the normal contacts, added by agglomerate, J.
  void add_elastic_energy(double *energy) const;

  // For time that passes while nothing can touch the plate (fix idle).
  const double *extent() const { return extent_; }  // XMIN XMAX YMIN YMAX, m
  int co_step() const { return co_step_; }
  double reach() const { return link_ ? link_->reach : 0; }  // bound for |w|, m
  bool is_quiet() const { return step_in_co_step_ == 0 && !following_; }  // no co-step is open
  void skip(long long co_steps) { co_steps_passed_ += co_steps; }  // without forces, while it is quiet
  void ask_reach();  // while it is quiet, at the end of a step

 protected:
  void pre_force(int) override;

 private:
  struct Near {
    int i;                      // local index
    bool active = false;        // may touch the plate before the next exchange
    bool has_shape = false;
    double x, y;                // where the shape was taken
    double w0 = 0, w1 = 0;      // plate at the last and the next exchange, m
    double rate0 = 0, rate1 = 0;
    double w = 0, rate = 0;     // now
    double force[3], torque[3]; // of the last step
    bool touched = false;
    double overlap = 0;         // of the last step as the stock wall sees it, m
    double depth = 0;           // and as it is; the same unless the plate has yielded
  };
  static constexpr int DENT = 3;  // numbers a sub-sphere: largest overlap, and x, y where it was last pressed

  std::unique_ptr<Agglomerates> agglomerates_;
  std::unique_ptr<PlateShapes> shapes_;
  std::unique_ptr<PlateLink> link_;
  std::unique_ptr<HertzLaw> law_;
  std::vector<Near> near_;
  std::vector<double> near_shape_;    // modes() numbers a near sub-sphere
  double extent_[4];
  int co_step_ = 1, step_in_co_step_ = 0;
  long long co_steps_passed_ = 0;     // since the last exchange
  bool following_ = false;            // was the plate asked at the last co-step?
  double light_force_ = 0, light_speed_ = 0;
  int light_co_steps_ = 1, most_co_steps_ = 1;
  int ahead_ = 1;                     // co-steps from the last exchange to the next
  double listed_reach_ = 0;
  std::vector<double> impulse_;       // sum over the co-step of F_z / N by agglomerate, push on the plate
  std::vector<double> modal_impulse_;
  std::vector<double> amplitude0_, rate0_;
  std::vector<double> work_on_stone_, work_on_plate_, damped_;
  std::vector<double> kept_z_;
  FILE *forces_ = nullptr;
  std::vector<double> deepest_;
  FILE *contacts_ = nullptr;
  bool has_contacts_ = false;
  int contacts_every_ = 1;
  std::unique_ptr<PlasticLaw> plastic_law_;  // only where the plate yields
  std::vector<double> plastic_;
  double **dent_ = nullptr;

  void list_near();
  void place_plate();
  void add_forces(double weight);
  void end_co_step(bool first);
  void record_forces();
  void flush();
  bool anything_near() const;
  int co_steps_ahead() const;
  double interval() const;            // between exchanges, s
  void follow_plate();
  void update_shape(size_t k);
  double modulus(int i) const { return law_->modulus(atom->type[i], atom_type_wall_); }
  double press(int i, double depth);
  void record_contacts();
};

}  // namespace LAMMPS_NS
