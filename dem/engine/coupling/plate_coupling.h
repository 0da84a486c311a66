#pragma once
#include <algorithm>
#include <string>
#include <vector>

#include "contact/plate_contact.h"
#include "coupling/plate_link.h"
#include "coupling/plate_shapes.h"

namespace LAMMPS_NS {

class CheckpointReader;
class CheckpointWriter;
class LAMMPS;

// While the stones push with less than `force_N` and nothing comes near faster than `speed_m_s`, the contact is weak
// (chips at rest, say) and one message serves `co_steps` co-steps, or with a weaker push up to `most_co_steps`.
struct WeakContact {
  double force_N = 0, speed_m_s = 0;
  int co_steps = 1, most_co_steps = 1;
};

// Where the elastic plate is under each sub-sphere. The forces on the plate are projected on its mode shapes, and their
// mean since the last message goes to the plate, which answers where it is predicted to be at the next one. In between
// it moves on the cubic that has the places and velocities of both ends. While nothing is near the plate there are no
// messages. All ranks call its functions together.
class PlateCoupling {
 public:
  PlateCoupling(LAMMPS *, const std::string &shapes_file, const std::string &to_plate, const std::string &from_plate,
                int co_step, const WeakContact &);

  void setup() { extrapolated_co_steps_ = 1; }
  void set_extent(const double *extent) { std::copy_n(extent, 4, extent_); }  // XMIN XMAX YMIN YMAX of the plate, m
  void list(const std::vector<NearSphere> &);                    // is a new list of what is near; what was keeps its shapes
  void forget_shapes() { sites_.clear(); }                       // a list must follow
  void place(std::vector<NearSphere> &, int step_in_co_step);    // finds the plate beneath each now
  void find(NearSphere &, size_t number, int step_in_co_step);   // the same for one of them, whatever was known of it
  void add_forces(const std::vector<NearSphere> &, double share);  // of the mean over this co-step
  // True if there was a message. Then `predict` must follow, with a list of all that the plate can now reach.
  bool end_co_step(const std::vector<NearSphere> &, bool first);
  void predict(const std::vector<NearSphere> &);

  double reach() const { return link_.reach; }  // bounds |w| until the next message, m
  bool is_engaged() const { return engaged_; }
  int most_co_steps() const { return weak_.most_co_steps; }  // that a message serves
  void skip(long long co_steps) { co_steps_passed_ += co_steps; }
  void ask_reach();
  void finish();

  void save(CheckpointWriter &);
  void restore(const CheckpointReader &);
  void saved(long long step);

 private:
  struct Site {                  // of each near sub-sphere
    int tag = 0;
    bool is_active = false;      // may it touch the plate before the next message?
    double x = 0, y = 0;         // where the mode shapes hold, m
    double taken_x = 0, taken_y = 0;  // where they and their slopes were taken from the grid
    // Each PlateShapes::numbers() of them: where they hold; where they were taken, with the slopes along x and y.
    std::vector<double> shapes;
    bool has_shape() const { return !shapes.empty(); }
    struct Way {
      double w0 = 0, w1 = 0;       // displacement of the plate at the last and at the next message, m
      double rate0 = 0, rate1 = 0; // and its velocity, m/s
      // With s from 0 at the last message to 1 at the next.
      double displacement(double s, double interval_s) const;
      double velocity(double s, double interval_s) const;
    } way[3];                      // upwards, and along x and y where friction moves the plate
  };

  LAMMPS *lmp_;
  PlateShapes shapes_;
  PlateLink link_;  // holds the predicted amplitudes and their rates
  const int co_step_;
  const WeakContact weak_;
  double extent_[4];
  std::vector<Site> sites_;
  std::vector<double> amplitude0_, rate0_;  // at the last message
  std::vector<double> modal_force_;  // sum over the co-steps passed of the mean of each, N kg^-1/2
  long long co_steps_passed_ = 0;    // since the last message
  int extrapolated_co_steps_ = 1;    // from the last message to the next
  bool engaged_ = false;             // was anything near the plate at the last message?

  double interval_s() const;         // between messages
  bool anything_near(const std::vector<NearSphere> &) const;
  int co_steps_to_extrapolate(const std::vector<NearSphere> &) const;
  void send_message(const std::vector<NearSphere> &);
  bool is_within_reach(const NearSphere &, double way) const;
  void predict(const NearSphere &, Site &);
  void follow(const NearSphere &, Site &) const;
  void take_shape(double x, double y, Site &) const;
  void place(NearSphere &, const Site &, int step_in_co_step) const;
};

}  // namespace LAMMPS_NS
