#pragma once
#include <vector>

#include "interfaces/agglomerates.h"
#include "laws/plastic_law.h"
#include "contact/sphere_memory.h"

namespace LAMMPS_NS {

class Atom;
class CheckpointReader;
class CheckpointWriter;
class LAMMPS;

// The plate gives way under sub-spheres (PlasticLaw). A plastic indentation is remembered with the sub-sphere that made
// it, until this is clear of the plate and more than the radius of the indentation away.
class PlasticIndentation {
 public:
  PlasticIndentation(LAMMPS *lmp, const Agglomerates &agglomerates, double yield_pressure_Pa);

  // Presses sub-sphere i by `depth` (m) into the plate, `modulus` being E* of the contact, Pa. Returns the overlap at
  // which an elastic contact has the same force, m.
  double press(int i, double modulus, double depth);
  // That overlap when sub-sphere i, now at `depth`, was at the depth `before` a step ago, m.
  double overlap_before(int i, double modulus, double depth, double before) const;
  PlasticLaw::Indentation under(int i, double modulus) const;
  const std::vector<double> &energy() const { return energy_; }  // taken by yielding so far, by agglomerate, J
  SphereMemory &memory() { return memory_; }

  void save(CheckpointWriter &) const;
  void restore(const CheckpointReader &);

 private:
  const Atom *atom_;
  const Agglomerates &agglomerates_;
  PlasticLaw law_;
  SphereMemory memory_;  // largest overlap, and x, y where the sub-sphere was last pressed, m
  std::vector<double> energy_;
};

}  // namespace LAMMPS_NS
