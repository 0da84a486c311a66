#include "contact/plastic_indentation.h"

#include <algorithm>
#include <cmath>

#include "atom.h"
#include "interfaces/checkpoint_file.h"
#include "lammps.h"

namespace LAMMPS_NS {

namespace {
const int INDENTATION_COLUMNS = 3;
const double UNPRESSED = 1e-6;  // of the radius: between the elastic contact and a sub-sphere that is not pressed
}  // namespace

PlasticIndentation::PlasticIndentation(LAMMPS *lmp, const Agglomerates &agglomerates, double yield_pressure_Pa)
    : atom_(lmp->atom), agglomerates_(agglomerates), law_(yield_pressure_Pa),
      memory_(lmp, INDENTATION_COLUMNS, "wall/plate:indentation"), energy_(agglomerates.count(), 0.0) {}

double PlasticIndentation::press(int i, double modulus, double depth) {
  const double R = atom_->radius[i], *x = atom_->x[i];
  double *row = memory_.row(i), &largest = row[0], &x0 = row[1], &y0 = row[2];
  if (largest <= law_.yield_overlap(modulus, R)) {
    if (depth <= law_.yield_overlap(modulus, R)) return depth;
  } else if (depth <= 0) {
    const PlasticLaw::Indentation d = law_.indentation(modulus, R, largest);
    if (std::hypot(x[0] - x0, x[1] - y0) > std::sqrt(d.radius * (largest - d.depth))) largest = 0;
    return depth;
  }
  if (depth > largest) {
    energy_[agglomerates_.of_tag(atom_->tag[i])] += law_.taken(modulus, R, depth) - law_.taken(modulus, R, largest);
    largest = depth;
  }
  const double force = law_.force(modulus, R, depth, largest);
  if (force > 0) x0 = x[0], y0 = x[1];
  // A sub-sphere in its indentation that is not pressed is just clear of the elastic contact.
  return force > 0 ? PlasticLaw::hertz_overlap(modulus, R, force) : std::min(depth, -UNPRESSED * R);
}

// At its largest depth it came along the curve of loading, elsewhere along that of unloading.
double PlasticIndentation::overlap_before(int i, double modulus, double depth, double before) const {
  const double R = atom_->radius[i], largest = memory_.row(i)[0];
  const double force = law_.force(modulus, R, before, depth < largest ? largest : before);
  return force > 0 ? PlasticLaw::hertz_overlap(modulus, R, force) : 0;
}

PlasticLaw::Indentation PlasticIndentation::under(int i, double modulus) const {
  return law_.indentation(modulus, atom_->radius[i], memory_.row(i)[0]);
}

void PlasticIndentation::save(CheckpointWriter &out) const {
  out.sum("wall_plastic", energy_);
  memory_.save(out, "wall_indentations");
}

void PlasticIndentation::restore(const CheckpointReader &in) {
  energy_ = in.sum("wall_plastic", energy_.size());
  memory_.restore(in, "wall_indentations");
}

}  // namespace LAMMPS_NS
