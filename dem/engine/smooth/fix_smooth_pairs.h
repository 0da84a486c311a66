#pragma once
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "fix.h"
#include "interfaces/agglomerates.h"
#include "interfaces/checkpointed.h"
#include "interfaces/energy_holder.h"
#include "interfaces/free_flight_partners.h"
#include "interfaces/stone_stream.h"
#include "interfaces/takes_pairs.h"
#include "laws/hertz_law.h"
#include "laws/smooth_law.h"
#include "smooth/stone_pieces.h"
#include "smooth/stone_surface.h"

namespace LAMMPS_NS {

// fix ID group smooth_pairs agglomerates FILE surface FILE
//     (pair I J modulus shear_modulus damping_ratio damping_ratio_across friction yield_pressure) of types I <= J, each
//
// Contact of two bonded stones as the smooth bodies that they stand for (docs/contact.md), as SmoothContact does it with
// the plate. Each of the two has a patch about the line of the centres,
//
//   c_k = sum of w x - Q_k (sum of w X),    q = R_1 + R_2 + off - |c_1 - c_2|,
//
// and the members of both have the forces -+ w F(q) along that line: those of a potential, as long as weights w and
// turns Q stand still. At every look these are found anew, and `off` keeps q. Sub-spheres of two pieces with patches do
// not touch each other by themselves.
//
// Both pieces must have half the surface of their patches. A sub-sphere that leaves a patch goes on with its share of the
// force against the nearest one opposite, as a contact of the two that begins at an offset; pairs that overlap when
// their pieces have no patches any more begin without force. Such a contact ends when the two are free, and LIGGGHTS'
// list has them again.
class FixSmoothPairs : public Fix, public Checkpointed, public EnergyHolder, public ActsInFreeFlight, public StoneKeeper,
                       public TakesPairs {
 public:
  FixSmoothPairs(class LAMMPS *, int, char **);
  int setmask() override;
  void init() override;
  void setup(int) override;
  void setup_pre_force(int) override { take_pairs(); }
  void pre_neighbor() override { list_is_new_ = true; }
  void pre_force(int) override { take_pairs(); }
  void post_integrate() override { add_half(); }
  void post_force(int) override;

  void take_pairs() override;
  bool pushes(int label) const override;
  void came_back() override { looked_ = false; }
  void enter(const EnteringStone &) override;
  void leave(int agglomerate) override;
  void add_to(LedgerRows &) override;
  void save(CheckpointWriter &) override;
  void restore(const CheckpointReader &) override;

 private:
  using Weight = StoneSurfaces::Weight;
  struct Law {                 // of two materials
    double modulus, shear_modulus, damping_ratio, damping_ratio_across, friction, yield_pressure;
  };
  struct Side {                // of a pair: one stone
    std::vector<Weight> members, body;
    struct Numbers {
      double agglomerate = 0, piece = 0;
      double share = 1;        // of the patch's surface that is there
      double body_mobility = 0, mass = 0, compliance = 0, compliance_across = 0;
      Vec base;                // Q (sum of w X), m
      // Of the present step, means over the members.
      Vec x, v, spin, spin_x, body_v;   // spin_x of spin x place
      double mobility = 0;     // across the line, of the members as free spheres, 1/kg
    } n;
    Vec center() const { return n.x - n.base; }
    Vec velocity_at(const Vec &point) const { return n.v + cross(n.spin, point) - n.spin_x; }
  };
  struct Pair {
    Side side[2];
    struct Numbers {
      double off = 0, presses = 0, is_new = 1;
      double largest = 0;      // Hertz approach so far, m
      Vec slip;                // of the tangential spring, m
      double spring = 0;       // its stiffness, N/m
      // Of the present step.
      Vec line, point;         // from the first stone to the second; where they touch
      double q = 0, q_rate = 0, elastic = 0, dashpot = 0, rubbing = 0;  // the forces push the stones apart, N
      Vec across;              // force on the first stone, N
      Vec sliding, sliding_before;  // velocity of the first over the second, m/s; at a look, with the members before it
      SmoothLaw::State state;
    } n;
    double share() const { return side[0].n.share * side[1].n.share; }
    int agglomerate(int k) const { return static_cast<int>(side[k].n.agglomerate); }
    std::pair<int, int> pieces() const { return {static_cast<int>(side[0].n.piece), static_cast<int>(side[1].n.piece)}; }
  };
  struct Single {              // contact of two sub-spheres
    double tag[2];
    double offset;             // overlap at which they do not push, m
    Vec x[2], v[2], spin[2];   // of the present step
    Vec normal;                // from the first to the second
    double distance = 0, overlap = 0, elastic = 0, dashpot = 0;  // m, N
    Vec across;                // friction on the first, N
    Vec arm(int k) const { return 0.5 * (k == 0 ? 1 : -1) * distance * normal; }
  };
  struct Felt {
    int tag;
    Vec force, torque;
  };
  struct Books {               // so far, by agglomerate, J
    std::vector<double> work, damped, released, plastic, friction;
  };

  std::unique_ptr<Agglomerates> agglomerates_;
  std::unique_ptr<StoneSurfaces> surfaces_;
  std::unique_ptr<StonePieces> pieces_;
  std::unique_ptr<HertzLaw> hertz_;
  BondNetwork *bonds_ = nullptr;
  std::map<std::pair<int, int>, Law> laws_;   // by types
  std::vector<int> type_;                     // of each agglomerate
  std::vector<Pair> pairs_;
  std::vector<Single> singles_;
  std::vector<Felt> felt_;                    // one a tag, by tag, of this rank, at the last step
  Books books_;
  std::set<std::pair<int, int>> taken_;       // pieces whose pairs of sub-spheres are not in the list of neighbours
  std::vector<int> piece_then_;               // by tag, at the last look
  std::vector<char> is_paired_;               // by agglomerate
  std::vector<int> watched_;                  // bonds of members of pressing patches, which hold
  bool list_is_new_ = true, looked_ = false;

  const SmoothStone &stone(const Side &s) const { return surfaces_->stones()[static_cast<int>(s.n.agglomerate)]; }
  const Law &law(int a, int b) const { return laws_.at(std::minmax(type_[a], type_[b])); }
  SmoothLaw smooth_law(const Pair &) const;
  static double stored(const Single &s) { return 0.4 * s.elastic * (s.overlap - s.offset); }  // J
  int here(int tag) const;                    // local index, -1 where another rank owns it, or none
  void sum(std::vector<double> &) const;
  bool is_first_rank() const;
  void count(std::vector<double> &, int a, int b, double energy) const;
  int agglomerate_of(double tag) const { return agglomerates_->of_tag(static_cast<int>(tag)); }

  // The looks.
  bool must_look() const;
  void look();
  std::vector<std::pair<int, int>> who_is_near() const;
  void renew(Pair &);
  bool place(Pair &, const StonePieces::Motion &, const StonePieces::Motion &, bool anew);
  void release_spring(Pair &);
  bool leave_members(Pair &, int side, const StonePieces::Motion &);
  void leave(Pair &, int side, size_t member);
  void dissolve(Pair &);
  void begin_single(int tag_i, int tag_j, double force, double available);
  void find_pair(int piece_i, int piece_j);
  bool touch_alone(const std::pair<int, int> &pieces) const;
  void note_pairs();
  void free_what_is_taken_no_more(const std::set<std::pair<int, int>> &now);
  bool has_single(int tag_i, int tag_j) const;
  void watch();
  std::map<int, Vec> elastic_forces() const;
  void release_half_a_step(const std::map<int, Vec> &before);

  // The step.
  void drop_what_flies();
  void measure();
  void press(Pair &);
  void press_to_q(Pair &);
  void dampen(Pair &);
  void rub(Pair &);
  void stretch(Pair &, double spring, const Vec &slip, const Vec &moved);
  void press(Single &);
  void hand_out();
  void feel(int tag, const Vec &force, const Vec &torque);
  void add_up_felt();
  void add_half();
};

}  // namespace LAMMPS_NS
