#pragma once
#include <memory>
#include <vector>

#include "wall/contact_recorder.h"
#include "wall/fix_wall.h"
#include "interfaces/free_flight_partners.h"
#include "contact/plate_contact.h"
#include "coupling/plate_coupling.h"

namespace LAMMPS_NS {

// fix ID group wall/plate agglomerates FILE forces FILE extent XMIN XMAX YMIN YMAX co_step N
//     [rows N] [contacts FILE every N] [yield_pressure P] [surface FILE | faces FILE]
//     [shapes FILE to_plate FILE from_plate FILE [weak_contact FORCE SPEED CO_STEPS MOST_CO_STEPS]]
//     contact (arguments of wall/gran with a zplane at 0)
//
// The top face of the plate. At each step the fix asks where the plate is under each sub-sphere near it (PlateCoupling;
// a plate without mode shapes is rigid and gets no messages), lets the contact law act there (PlateContact), adds up
// the works, and passes the forces on, their mean over each co-step of N steps counting (PlateCoupling,
// ContactRecorder, whose rows of forces cover `rows` steps, or a co-step). With a `surface` file bonded stones touch as
// the smooth bodies that they stand for (SmoothContact), with a file of `faces` those are columns of rock (FaceColumns).
// Forces and lengths are in SI units.
class FixWallPlate : public FixWall, public Obstacle, public Pushed, public StoneKeeper, public PlateBeneath {
 public:
  FixWallPlate(class LAMMPS *, int, char **);
  ~FixWallPlate() override;

  void setup(int) override;
  void post_integrate() override;
  void post_force(int) override;
  void end_of_step() override;
  void post_run() override;

  void grow_arrays(int) override;
  void copy_arrays(int, int, int) override;
  void set_arrays(int) override;
  int pack_exchange(int, double *) override;
  int unpack_exchange(int, double *) override;

  void add_to(LedgerRows &) override;

  void enter(const EnteringStone &stone) override { contact_->enter(stone); }
  void leave(int agglomerate) override { contact_->leave(agglomerate); }
  void came_back() override { contact_->came_back(); }

  void begin_anew() override {
    if (coupling_) coupling_->forget_shapes();
  }
  void save(CheckpointWriter &) override;
  void restore(const CheckpointReader &) override;
  void saved(long long step) override;

  const double *extent() const override { return extent_; }
  double reach() const override { return plate_reach(); }
  double outside(const std::vector<int> &tags) const override { return contact_->outside(tags); }
  Shell surface(const std::vector<int> &tags) const override { return contact_->surface(tags); }
  double patch_height() const override { return contact_->listed_height(); }
  double faces_outside() const override { return contact_->faces_outside(); }
  void add_faces(int i, std::vector<Face> &faces) override { contact_->add_faces(i, faces); }
  int co_step() const override { return co_step_; }
  int longest_message() const override { return co_step_ * (coupling_ ? coupling_->most_co_steps() : 1); }
  bool is_pushed() const override;
  std::vector<double> contacts_now() const override;
  bool is_quiet() const override { return step_in_co_step_ == 0 && !(coupling_ && coupling_->is_engaged()); }
  void skip(long long co_steps) override;
  void ask_reach() override;

 private:
  std::unique_ptr<PlateContact> contact_;
  std::unique_ptr<PlateCoupling> coupling_;  // only of a plate that moves
  std::unique_ptr<ContactRecorder> recorder_;
  double extent_[4];           // XMIN XMAX YMIN YMAX, m
  int co_step_ = 1, step_in_co_step_ = 0;
  int contacts_every_ = 1;     // steps between two records of all contacts
  double listed_reach_ = 0;    // of the plate, with which near_ was listed, m
  std::vector<double> work_on_plate_;  // of the stones so far, by agglomerate, J

  struct Options;
  Options read_options(int narg, char **arg);
  double plate_reach() const { return coupling_ ? coupling_->reach() : 0; }
  void list_near() override;
  void list_farther();
  void end_co_step(bool first);
  void add_work();
  void add_forces(double weight);

  Vec from_wall(const NearSphere &) const override;
  void find_plate(size_t near) override {
    if (coupling_) coupling_->find(near_[near], near, step_in_co_step_);
  }
};

}  // namespace LAMMPS_NS
