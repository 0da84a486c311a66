#include "touching.h"

#include <algorithm>
#include <cstring>

#include "atom.h"
#include "checkpoint_file.h"

namespace LAMMPS_NS {

namespace {

// Of the wall on a sub-sphere that it touches, W.
double power(const NearSphere &p, const Atom *atom) {
  double sum = 0;
  for (int d = 0; d < 3; d++) sum += p.force[d] * atom->v[p.i][d] + p.torque[d] * atom->omega[p.i][d];
  return sum;
}

}  // namespace

void add_work_of_wall(std::vector<double> &work, const std::vector<NearSphere> &near, const Atom *atom,
                      const Agglomerates &agglomerates, double half_dt) {
  for (const NearSphere &p : near)
    if (p.touches) work[agglomerates.of_tag(atom->tag[p.i])] += half_dt * power(p, atom);
}

// Rows of tag, force, torque.
void save_touching(CheckpointWriter &out, const std::string &name, const std::vector<NearSphere> &near,
                   const Atom *atom) {
  std::vector<double> rows;
  for (const NearSphere &p : near) {
    if (!p.touches) continue;
    rows.push_back(atom->tag[p.i]);
    rows.insert(rows.end(), p.force, p.force + 3);
    rows.insert(rows.end(), p.torque, p.torque + 3);
  }
  out.rows(name, rows);
}

// Everything else is found anew when the next step lists what is near.
std::vector<NearSphere> touching_from(const CheckpointReader &in, const std::string &name, Atom *atom) {
  const std::vector<double> &rows = in.rows(name, 7);
  std::vector<NearSphere> near;
  for (size_t k = 0; k < rows.size(); k += 7) {
    NearSphere p;
    p.i = atom->map(static_cast<int>(rows[k]));
    if (p.i < 0 || p.i >= atom->nlocal) continue;
    p.touches = true;
    std::copy_n(&rows[k + 1], 3, p.force);
    std::copy_n(&rows[k + 4], 3, p.torque);
    near.push_back(p);
  }
  return near;
}

int position_of_contact(int narg, char **arg) {
  for (int k = 3; k < narg; k++)
    if (std::strcmp(arg[k], "contact") == 0) return k;
  return narg;
}

std::vector<char *> &arguments_of_stock_wall(int narg, char **arg) {
  static char style[] = "wall/gran";
  static std::vector<char *> base;
  base.assign({arg[0], arg[1], style});
  base.insert(base.end(), arg + std::min(narg, position_of_contact(narg, arg) + 1), arg + narg);
  return base;
}

}  // namespace LAMMPS_NS
