#include "flight/neighbour_lists.h"

#include <algorithm>
#include <cmath>

#include "atom.h"
#include "fix.h"
#include "base/pair_list.h"
#include "force.h"
#include "interfaces/free_flight_partners.h"
#include "lammps.h"
#include "modify.h"
#include "neigh_list.h"
#include "neighbor.h"
#include "output.h"
#include "pair.h"
#include "update.h"

namespace LAMMPS_NS {

namespace {
// How many steps lie between two looks at the motion, and how much faster than now it may become until the next one.
const int LOOK_STEPS = 8;
const double FASTER = 2;

double square(const Vec &a) { return dot(a, a); }

// Are two vectors together longer than the limit? Mostly the squares alone tell that they are not.
bool exceeds(double limit, const Vec &a, const Vec &b) {
  const double most = 2 * (square(a) + square(b));
  return most > limit * limit && norm(a) + norm(b) > limit;
}
}  // namespace

void NeighbourLists::init(BodyMaker *bodies, double body_skin) {
  bodies_ = body_skin > 0 ? bodies : nullptr;
  body_skin_ = body_skin;
  built_ = false;
}

bool NeighbourLists::must_build() {
  const int steps = ++lmp_->neighbor->ago;  // since they were made
  return !built_ || is_asked_for() || (steps % LOOK_STEPS == 0 && have_moved());
}

bool NeighbourLists::is_asked_for() const {
  const Modify *modify = lmp_->modify;
  const bigint now = lmp_->update->ntimestep;
  if (lmp_->output->restart_requested(now)) return true;
  for (int k = 0; k < modify->nfix; k++)
    if (modify->fix[k]->force_reneighbor && modify->fix[k]->next_reneighbor == now) return true;
  return false;
}

// Until the next look a sub-sphere goes on at no more than FASTER times its speed.
bool NeighbourLists::have_moved() const {
  const Atom *atom = lmp_->atom;
  const double ahead = FASTER * LOOK_STEPS * lmp_->update->dt, limit = 0.5 * lmp_->neighbor->skin;
  for (int i = 0; i < atom->nlocal; i++)
    if (exceeds(limit, Vec(atom->x[i]) - place_[i], ahead * Vec(atom->v[i]))) return true;
  return std::any_of(groups_.begin(), groups_.end(), [this](const Group &g) { return has_deformed(g); });
}

// May two members have come nearer to each other by the body's skin? Motion beyond a rigid one bounds by how much; any
// rigid motion would do, and the one that fits best bounds it closest.
bool NeighbourLists::has_deformed(const Group &group) const {
  const Atom *atom = lmp_->atom;
  const double ahead = FASTER * LOOK_STEPS * lmp_->update->dt, limit = 0.5 * body_skin_;
  const auto moved = [&](int i) { return Vec(atom->x[i]) - place_[i]; };
  const auto velocity = [&](int i) { return Vec(atom->v[i]); };
  const RigidField displacement = fit(group, moved), motion = fit(group, velocity);
  for (const int i : group.members) {
    const Vec arm = place_[i] - group.middle;
    if (exceeds(limit, moved(i) - displacement(arm), ahead * (velocity(i) - motion(arm)))) return true;
  }
  return false;
}

template <class Field> NeighbourLists::RigidField NeighbourLists::fit(const Group &group, Field field) const {
  RigidField fitted;
  Vec moment;
  for (const int i : group.members) {
    const Vec value = field(i);
    fitted.mean += value;
    moment += cross(place_[i] - group.middle, value);
  }
  fitted.mean = (1.0 / group.members.size()) * fitted.mean;
  fitted.turn = group.inverse_inertia * moment;
  return fitted;
}

void NeighbourLists::build() {
  lmp_->neighbor->build();
  const Atom *atom = lmp_->atom;
  place_.resize(atom->nlocal);
  for (int i = 0; i < atom->nlocal; i++) place_[i] = Vec(atom->x[i]);
  built_ = true;
  if (!bodies_) return;
  note_groups();
  thin_out();
  leave_out_lonely();
}

void NeighbourLists::note_groups() {
  const Atom *atom = lmp_->atom;
  const std::vector<int> &label_of = bodies_->body_of_tag();
  group_of_label_.assign(label_of.size(), -1);
  groups_.clear();
  for (int i = 0; i < atom->nlocal; i++) {
    int &group = group_of_label_[label_of[atom->tag[i]]];
    if (group < 0) group = groups_.size(), groups_.emplace_back();
    groups_[group].members.push_back(i);
  }
  const auto is_alone = [](const Group &g) { return g.members.size() == 1; };
  groups_.erase(std::remove_if(groups_.begin(), groups_.end(), is_alone), groups_.end());
  for (Group &g : groups_) {
    for (const int i : g.members) g.middle += (1.0 / g.members.size()) * place_[i];
    Tensor inertia;
    // A tenth of a sub-sphere's own inertia keeps that of points on a line from being singular.
    for (const int i : g.members) inertia.add_inertia(1, place_[i] - g.middle, 0.04 * atom->radius[i] * atom->radius[i]);
    g.inverse_inertia = inertia.inverse();
  }
}

// Sub-spheres without a pair leave the lists, so that loops over these are shorter. The last one stays, since the
// history of contacts of LIGGGHTS takes it for the end of the arrays.
void NeighbourLists::leave_out_lonely() {
  NeighList *list = lmp_->force->pair->list;
  int kept = 0;
  for (int k = 0; k < list->inum; k++) {
    const int i = list->ilist[k];
    if (has_neighbour_[i] || k == list->inum - 1) list->ilist[kept++] = i;
  }
  list->inum = kept;
}

// Takes out of the lists pairs within a body that lie farther apart than its own skin.
void NeighbourLists::thin_out() {
  const Atom *atom = lmp_->atom;
  has_neighbour_.assign(atom->nlocal, 0);
  const std::vector<int> &label_of = bodies_->body_of_tag();
  const double factor = lmp_->neighbor->contactDistanceFactor;
  keep_in_pair_list(lmp_, [&](int i, int j) {
    const double reach = factor * (atom->radius[i] + atom->radius[j]) + body_skin_;
    if (label_of[atom->tag[i]] == label_of[atom->tag[j]] && square(place_[i] - place_[j]) > reach * reach) return false;
    has_neighbour_[i] = has_neighbour_[j] = 1;
    return true;
  });
}

}  // namespace LAMMPS_NS
