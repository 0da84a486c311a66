#include "bodies/held_bodies.h"

#include <algorithm>
#include <cmath>

#include "atom.h"
#include "interfaces/checkpoint_file.h"
#include "lammps.h"
#include "update.h"

namespace LAMMPS_NS {

namespace {
const int STILL_LOOKS = 3;          // in a row, as for free flight
const double STRENGTH_SHARE = 0.1;
const double TAKEN_SHARE = 0.5;     // of the limit: a body that is pushed harder is not taken
}  // namespace

HeldBodies::HeldBodies(LAMMPS *lmp, const Vec &gravity_m_s2, double speed_m_s, double tolerance, int tags, int unheld)
    : lmp_(lmp), gravity_(gravity_m_s2), speed_(speed_m_s), tolerance_(tolerance), unheld_(unheld), held_(tags + 1, 0),
      still_(tags + 1, 0) {}

void HeldBodies::count_still(const std::vector<ArrayBody> &bodies) {
  for (const ArrayBody &b : bodies)
    still_[b.label] = b.inner_energy <= tolerance_ * energy_of_impact(b) ? still_[b.label] + 1 : 0;
}

void HeldBodies::choose(std::vector<ArrayBody> &bodies, const std::function<bool(ArrayBody &, double)> &is_gentle) {
  for (ArrayBody &b : bodies) {
    if (b.departs || b.atoms.size() == 1 || still_[b.label] < STILL_LOOKS) continue;
    const ArrayBody own = alone(b);
    const Limits most = limits(own);
    const bool gentle = is_gentle(b, most.least_N);
    if (!gentle) let_go(b.label);
    else if (!held_[b.label]) take(own, most);
  }
}

// Without what is trapped in it.
ArrayBody HeldBodies::alone(const ArrayBody &b) const {
  const std::vector<int> &body = bonds_->body_of_tag();
  ArrayBody own(lmp_->atom, b.label);
  for (int i : b.atoms)
    if (body[lmp_->atom->tag[i]] == b.label) own.atoms.push_back(i);
  own.measure();
  return own;
}

HeldBodies::Limits HeldBodies::limits(const ArrayBody &b) const {
  const std::vector<BodyMaker::Support> &supports = bonds_->supports_of_tags();
  Limits most;
  double stiffness = 0, bonds = 0;
  for (int i : b.atoms) {
    const BodyMaker::Support &s = supports[lmp_->atom->tag[i]];
    most.parts_N.push_back(STRENGTH_SHARE * s.tensile_N);
    stiffness += s.stiffness_N_m, bonds += s.bonds;
  }
  const double k = stiffness / bonds * std::cbrt(b.atoms.size());
  most.all_N = std::sqrt(2 * k * tolerance_ * energy_of_impact(b));
  most.least_N = std::min(most.all_N, *std::min_element(most.parts_N.begin(), most.parts_N.end()));
  return most;
}

void HeldBodies::take(const ArrayBody &b, const Limits &most) {
  Atom *atom = lmp_->atom;
  Vec push;
  for (int i : b.atoms) push += Vec(atom->f[i]) - atom->rmass[i] * gravity_;
  if (norm(push) > TAKEN_SHARE * most.least_N) return;
  bodies_.push_back(std::make_unique<HeldBody>(atom, b, most.parts_N, most.all_N));
  set_held(*bodies_.back(), true);
  bonds_->take_energy(b.label, b.inner_energy);
}

void HeldBodies::set_held(const HeldBody &b, bool held) {
  changed_ = true;
  held_[b.label()] = held;
  for (const HeldBody::Part &p : b.parts()) {
    bonds_->hold(p.tag, held);
    int &groups = lmp_->atom->mask[lmp_->atom->map(p.tag)];
    groups = held ? groups & ~unheld_ : groups | unheld_;
  }
}

// The integrator goes on with its sub-spheres, and expects their weight in the forces of the last step.
void HeldBodies::erase(size_t k) {
  Atom *atom = lmp_->atom;
  set_held(*bodies_[k], false);
  for (const HeldBody::Part &p : bodies_[k]->parts()) {
    const int i = atom->map(p.tag);
    (Vec(atom->f[i]) + atom->rmass[i] * gravity_).to(atom->f[i]);
  }
  still_[bodies_[k]->label()] = 0;
  bodies_.erase(bodies_.begin() + k);
}

void HeldBodies::let_go(int label) {
  for (size_t k = bodies_.size(); k-- > 0;)
    if (bodies_[k]->label() == label) erase(k);
}

void HeldBodies::find() {
  changed_ = false;
  for (auto &b : bodies_) b->find(lmp_->atom);
}

void HeldBodies::move() {
  for (auto &b : bodies_) b->move(lmp_->atom, lmp_->update->dt);
}

void HeldBodies::push() {
  for (size_t k = bodies_.size(); k-- > 0;) {
    bodies_[k]->push(lmp_->atom, lmp_->update->dt, gravity_);
    if (bodies_[k]->is_overloaded()) erase(k);
  }
}

void HeldBodies::save(CheckpointWriter &out) const {
  std::vector<double> row;
  for (const auto &b : bodies_) b->append_to(row);
  out.common("held_count", {static_cast<double>(bodies_.size())});
  out.common("held_still", std::vector<double>(still_.begin(), still_.end()));
  out.rows("held_bodies", row);
}

void HeldBodies::restore(const CheckpointReader &in) {
  const std::vector<double> &still = in.common("held_still", still_.size());
  std::copy(still.begin(), still.end(), still_.begin());
  bodies_.clear();
  std::fill(held_.begin(), held_.end(), 0);
  const double *row = in.rows("held_bodies", 1).data();
  for (int k = 0; k < static_cast<int>(in.common("held_count", 1)[0]); k++) {
    bodies_.push_back(std::make_unique<HeldBody>(row));
    set_held(*bodies_.back(), true);
  }
  find();
}

}  // namespace LAMMPS_NS
