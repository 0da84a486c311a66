#pragma once
#include <memory>
#include <string>
#include <vector>

#include "contact/granular_contact.h"
#include "laws/smooth_law.h"
#include "smooth/stone_pieces.h"
#include "smooth/stone_surface.h"

namespace LAMMPS_NS {

// Contact of bonded stones as the smooth bodies that they stand for (docs/contact.md). The surface sub-spheres about
// the contact axis, a patch, carry the law of the smooth stone together; every other sub-sphere meets the plate alone
// (GranularContact).
//
// The patch has come as far as q = sum w_i (R + w - c_i,z), where c_i = x_i - Q X_i is the centre of the stone as
// sub-sphere i has it: X_i is its place in the undeformed stone, Q the mean rotation of its piece, w the plate's
// height. While the patch presses its weights stand still. So q is linear in the places, each member has the force w_i
// F, and the contact is exactly conservative, whatever breaks. When the stone has turned, the weights move on with the
// axis and q stays.
//
// A piece of a stone has a patch while at least half of the patch's surface belongs to it. A sub-sphere that has lost
// half its bonds and its place leaves the patch with its share of the force, as a contact of its own that begins at an
// offset, and never with more energy than its share; the difference counts as released.
//
// What the patch gives to its members is elastic. The dashpot acts between the plate and the whole piece, on each
// sub-sphere by its mass, so that bonds do not feel it and the force on the plate follows from the law of one mass.
class SmoothContact : public PlateContact {
 public:
  SmoothContact(LAMMPS *, const Agglomerates &, StockWall &, PlateBeneath &, double yield_pressure_Pa,
                const std::string &surface_file);
  void setup() override;
  void enter(const EnteringStone &) override;
  void leave(int agglomerate) override;
  void came_back() override { looked_ = false; }
  void add_forces(std::vector<NearSphere> &, double reach, int vflag) override;
  void end_of_step(const std::vector<NearSphere> &, std::vector<double> &work_on_stone) override;
  void add_to(LedgerRows &, const std::vector<NearSphere> &) const override;
  Pressing pressing(const NearSphere &) const override;
  double outside() const override { return surfaces_.outside(); }
  double outside(const std::vector<int> &tags) const override;
  Shell surface(const std::vector<int> &tags) const override { return pieces_->surface(tags); }
  void list(std::vector<NearSphere> &) override;
  double listed_height() const override { return surfaces_.height() + surfaces_.outside(); }
  const std::vector<int> &always_listed() const override { return in_patches_; }  // a chip may turn one far up
  SphereMemory *memory() override { return alone_.memory(); }
  void save(CheckpointWriter &, const std::vector<NearSphere> &) const override;
  void restore(const CheckpointReader &) override;

 private:
  using Weight = StoneSurfaces::Weight;
  struct Patch {
    int agglomerate = 0, piece = 0;
    std::vector<Weight> members;
    std::vector<Weight> body;  // how the dashpot's force is shared by the piece
    double body_mobility = 0;  // speed that a force so shared gives to the point where it acts, per impulse, 1/kg
    double share = 1;          // of the patch's surface that is there
    double base = 0;           // q = base - sum w_i z_i + w
    Vec to_foot;               // from the central member to where the patch presses, the mean place of its members, m
    Vec axis;                  // in the frame of the undeformed stone
    double compliance = 0, compliance_across = 0, mass = 0;
    bool presses = false, is_new = true;
    double largest = 0;        // Hertz approach so far
    Vec slip;                  // of the tangential spring, m
    double spring = 0;         // its stiffness, N/m
    // Of the present step.
    double w = 0, plate_v = 0;             // the plate beneath it
    Vec drift;                             // of its top face in its plane, m/s
    double q = 0, q_rate = 0;              // m, m/s
    double elastic = 0, dashpot = 0;       // force on the stone, N
    double across[2] = {0, 0};             // N
    Vec sliding;                           // velocity of the surface over the plate, m/s
    Vec sliding_before;                    // at a look, that of the members before it
    double mobility = 0;                   // across the plate, of its members as free spheres, 1/kg
    double rubbing = 0;                    // tangential dashpot, N s/m
    SmoothLaw::State state;

    double force() const { return elastic + dashpot; }
    int central() const;                   // tag of the member with the largest weight
  };

  LAMMPS *lmp_;
  const Agglomerates &agglomerates_;
  PlateBeneath &beneath_;
  GranularContact alone_;
  StoneSurfaces surfaces_;
  BondNetwork *bonds_ = nullptr;
  std::unique_ptr<StonePieces> pieces_;
  std::vector<Patch> patches_;
  std::vector<int> patch_of_tag_, near_of_tag_, indexed_;  // the last one: tags in near_of_tag_
  std::vector<int> alone_now_;                       // tags that touch the plate alone, since the last step
  std::vector<int> in_patches_;                      // tags in patch_of_tag_
  std::vector<char> touching_;                       // by tag, at a look: does it touch by itself?
  std::vector<Vec> moved_;                           // the plate, for a sub-sphere that left a patch, by tag, m
  std::vector<double> damped_, plastic_, released_, friction_;  // so far, by agglomerate, J
  std::vector<double> half_work_, half_damped_;      // of this step's dashpots, which the next one does, J
  std::vector<double> deepest_;                      // largest approach over radius so far, by agglomerate
  bool looked_ = false;
  std::vector<int> watched_;                         // bonds of members of pressing patches, which hold
  std::vector<std::pair<int, double>> before_look_;  // tag and elastic force, N, of members of pressing patches
  const std::vector<NearSphere> *near_ = nullptr;    // of the present step

  const SmoothStone &stone(const Patch &p) const { return surfaces_.stones()[p.agglomerate]; }
  SmoothLaw law(const SmoothStone &s) const { return {s.modulus, s.radius, s.yield_pressure}; }
  bool is_first_rank() const;
  void sum(std::vector<double> &) const;
  int here(int tag) const;                           // local index, -1 where another rank owns it

  // The patches, found anew at every so many steps.
  void index(const std::vector<NearSphere> &);
  bool must_look() const;
  void look(std::vector<NearSphere> &, double reach);
  void index_patches();
  void watch();
  void find_patches(int agglomerate, double reach);
  bool is_pushed_outside(int tag) const;
  void place_on_plate(const std::vector<NearSphere> &);
  void find_feet(std::vector<NearSphere> &);
  void mark_feet(std::vector<NearSphere> &) const;
  void drop_idle_patches();
  bool is_taken(int tag) const;
  Vec beyond_outline(const Vec &place) const;
  double height_of_members(const Patch &) const;
  bool is_near(const Patch &) const;
  void renew(Patch &);
  Vec axis_until_next(const StonePieces::Motion &) const;
  void follow_axis(Patch &, const StonePieces::Motion &);
  void spread_over_body(Patch &, const StonePieces::Motion &);
  void leave(Patch &, size_t member);
  void dissolve(Patch &);
  void stand_alone(int tag);
  double depth_of(int tag) const;
  void remember_sliding();
  void release_half_a_step(const std::vector<NearSphere> &);

  // The step.
  void meet_alone(std::vector<NearSphere> &, int vflag);
  void measure();
  void press(Patch &);
  Vec surface_velocity(int i, double plate_z) const;
  void add_sliding(const Weight &, int i, double plate_z, double *sum) const;
  double surface_mobility(int i, double plate_z) const;
  void press_to_q(Patch &);
  void dampen();
  double body_speed(const Patch &) const;
  void rub(Patch &);
  void stretch(Patch &, double spring, const Vec &slip);
  void hand_out(std::vector<NearSphere> &);
};

}  // namespace LAMMPS_NS
