#pragma once
#include <functional>
#include <vector>

#include "interfaces/agglomerates.h"
#include "interfaces/free_flight_partners.h"
#include "bodies/outline.h"

namespace LAMMPS_NS {

class Atom;

// A body whose sub-spheres are in LIGGGHTS's arrays, as it moves at this step. SI units.
class ArrayBody : public Outline {
 public:
  int label;               // least tag
  std::vector<int> atoms;  // local indices
  double inner_energy;     // kinetic energy relative to rigid motion, J
  Vec momentum, omega;     // angular momentum about the centre of mass, and the angular velocity that it means
  Tensor inertia;          // about the centre of mass
  bool departs = false;                 // into free flight, at this look
  bool is_trapped = false;              // in the cracks of another one
  std::vector<ArrayBody *> trapped;     // fragments in the cracks of this one
  Obstacle *plate = nullptr;            // if there is one that its faces can touch

  ArrayBody(const Atom *atom, int label) : label(label), atom_(atom) {}
  void measure();
  void take_trapped();  // makes one body of this and what is trapped in it
  double energy_over(const ArrayBody &host) const;  // kinetic energy relative to the rigid motion of `host`, J

 protected:
  void place(std::vector<Sphere> &spheres) override;
  void place_faces(std::vector<Face> &faces) override;

 private:
  const Atom *atom_;
  double own_inertia(int i) const;  // of a sub-sphere about its centre
};

// All bodies in the arrays, measured. `label_of` gives the least tag of the body of a tag, which goes up to `tags`.
std::vector<ArrayBody> bodies_in_arrays(const Atom *, int tags, const std::function<int(int)> &label_of);

// Finds the loose fragments in the cracks of each body, of its own agglomerate and no heavier, the heaviest body first.
using MayFlyAlong = std::function<bool(const ArrayBody &fragment, const ArrayBody &host)>;
void find_trapped(std::vector<ArrayBody> &, const Agglomerates &, const MayFlyAlong &);

}  // namespace LAMMPS_NS
