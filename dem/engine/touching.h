#pragma once
#include <string>
#include <vector>

#include "agglomerates.h"
#include "plate_contact.h"

namespace LAMMPS_NS {

class Atom;

// The work of a wall over a step is force x (v before + v after)/2 dt, which is what the leapfrog integrator adds to the
// kinetic energy. The first half is added when the force is known, the second when the next velocity is, so a
// checkpoint keeps what touches.
void add_work_of_wall(std::vector<double> &work, const std::vector<NearSphere> &, const Atom *, const Agglomerates &,
                      double half_dt);
void save_touching(CheckpointWriter &, const std::string &name, const std::vector<NearSphere> &, const Atom *);
std::vector<NearSphere> touching_from(const CheckpointReader &, const std::string &name, Atom *);

// Arguments `fix ID group wall/gran ...` for the base class of a fix that hands on what follows `contact`.
int position_of_contact(int narg, char **arg);
std::vector<char *> &arguments_of_stock_wall(int narg, char **arg);

}  // namespace LAMMPS_NS
