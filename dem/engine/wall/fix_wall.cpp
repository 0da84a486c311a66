#include "wall/fix_wall.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>

#include "atom.h"
#include "interfaces/checkpoint_file.h"
#include "base/fix_input.h"
#include "fix_property_atom.h"
#include "base/fixes.h"
#include "primitive_wall.h"
#include "update.h"

using namespace LAMMPS_NS;
using namespace FixConst;

/* --- the line of the deck ------------------------------------------------------------------------------------ */

int FixWall::position_of_contact(int narg, char **arg) {
  for (int k = 3; k < narg; k++)
    if (std::strcmp(arg[k], "contact") == 0) return k;
  return narg;
}

namespace {

std::vector<char *> &arguments_of_stock_wall(int narg, char **arg, int contact) {
  static char style[] = "wall/gran";
  static std::vector<char *> stock;
  stock.assign({arg[0], arg[1], style});
  stock.insert(stock.end(), arg + std::min(narg, contact + 1), arg + narg);
  return stock;
}

}  // namespace

FixWall::FixWall(LAMMPS *lmp, int narg, char **arg)
    : FixWallGran(lmp, arguments_of_stock_wall(narg, arg, position_of_contact(narg, arg)).size(),
                  arguments_of_stock_wall(narg, arg, position_of_contact(narg, arg)).data()),
      own_style_(arg[2]) {
  nevery = 1;
  // The law is asked for each sub-sphere as if the wall were at z = 0.
  const std::vector<std::string> words(arg + position_of_contact(narg, arg), arg + narg);
  auto at = std::find(words.begin(), words.end(), "zplane");
  if (at == words.end() || ++at == words.end() || std::atof(at->c_str()) != 0)
    input().refuse("needs `contact` and then what wall/gran takes, with `zplane 0`");
}

void FixWall::read_agglomerates(const std::string &file) {
  agglomerates_ = std::make_unique<Agglomerates>(lmp, this, file);
  work_on_stone_.assign(agglomerates_->count(), 0);
}

/* --- the step ------------------------------------------------------------------------------------------------ */

int FixWall::setmask() { return FixWallGran::setmask() | POST_INTEGRATE | END_OF_STEP; }

void FixWall::init() {
  if (!contact_match("normal", "hertz")) input().refuse("knows `contact model hertz` only");
  FixWallGran::init();
  agglomerates_->init();
}

void FixWall::pre_force(int) {
  if (!rebuildPrimitiveNeighlist_) return;
  rebuildPrimitiveNeighlist_ = false;
  list_near();
}

void FixWall::take_list_of_stock_wall() {
  int *list;
  near_.assign(primitiveWall_->getNeighbors(list), NearSphere());
  for (size_t k = 0; k < near_.size(); k++) near_[k].i = list[k];
}

void FixWall::post_integrate() { add_half_work(); }

// The work of a wall over a step is force x (v before + v after)/2 dt, which is what the leapfrog integrator adds to the
// kinetic energy. The first half is added when the force is known, the second when the next velocity is, so a
// checkpoint keeps what touches.
void FixWall::add_half_work() {
  const double half_dt = 0.5 * update->dt;
  for (const NearSphere &p : near_) {
    if (!p.touches) continue;
    double power = 0;
    for (int d = 0; d < 3; d++) power += p.force[d] * atom->v[p.i][d] + p.torque[d] * atom->omega[p.i][d];
    work_on_stone_[agglomerates_->of_tag(atom->tag[p.i])] += half_dt * power;
  }
}

double *FixWall::history(int i) { return fix_history_primitive_->array_atom[i]; }

/* --- checkpoint ---------------------------------------------------------------------------------------------- */

// Of what touches: rows of tag, force, torque.
void FixWall::save_wall(CheckpointWriter &out, const std::string &work, const std::string &contacts) const {
  std::vector<double> rows;
  for (const NearSphere &p : near_) {
    if (!p.touches) continue;
    rows.push_back(atom->tag[p.i]);
    rows.insert(rows.end(), p.force, p.force + 3);
    rows.insert(rows.end(), p.torque, p.torque + 3);
  }
  out.sum(work, work_on_stone_);
  out.rows(contacts, rows);
}

// Everything else is found anew when the next step lists what is near.
void FixWall::restore_wall(const CheckpointReader &in, const std::string &work, const std::string &contacts) {
  work_on_stone_ = in.sum(work, work_on_stone_.size());
  near_.clear();
  const std::vector<double> &rows = in.rows(contacts, 7);
  for (size_t k = 0; k < rows.size(); k += 7) {
    NearSphere p;
    p.i = atom->map(static_cast<int>(rows[k]));
    if (p.i < 0 || p.i >= atom->nlocal) continue;
    p.touches = true;
    std::copy_n(&rows[k + 1], 3, p.force);
    std::copy_n(&rows[k + 4], 3, p.torque);
    near_.push_back(p);
  }
}
