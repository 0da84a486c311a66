// One bond written as in the text books: the reference for the packed kernels, and the source of energies and events.

#include <algorithm>
#include <cmath>

#include "kernels/bond_kernel.h"
#include "base/vec.h"

namespace LAMMPS_NS {

namespace {

// q a q^-1, multiplied out as in the text books.
Vec rotated(const Rotation &q, const Vec &a) { return (q * Rotation{0, a} * q.inverse()).v; }

}  // namespace

BondState bond_state(const Bond &b, const AtomRecord &i, const AtomRecord &j) {
  const Rotation qi{i.q[0], Vec(i.q + 1)}, qj{j.q[0], Vec(j.q + 1)};
  const Vec d0(b.direction), branch = Vec(j.x) - Vec(i.x);
  const double r = norm(branch);
  const Vec n = 1 / r * branch;

  // The bond's axis as each end carries it; their mean against the branch is the shear of the bond.
  const Vec di = rotated(qi, d0), dj = rotated(qj, d0), mean = 0.5 * (di + dj);
  const double cosine = dot(mean, n);
  const Vec p = mean - cosine * n;
  // How j is turned against i, as a rotation vector in the frame of i (2 sin(theta/2), 1 % low at 0.5 rad).
  const Rotation relative = qi.inverse() * qj;
  const Vec turn = 2.0 * relative.v;
  const double twist = dot(turn, d0);
  const Vec bend = turn - twist * d0;

  // U = k_n (r - r0)^2/2 + k_s r0^2 |p|^2/2 + k_b |bend|^2/2 + k_t twist^2/2; forces and torques are its gradient.
  // The pull has besides its part of the gradient of the sub-spheres' energy of dilatation.
  const double stretch = r - b.length, ks_r02 = b.k_shear * b.length * b.length;
  const BondMaterial &material = *b.material;
  const double beam_pull = b.k_normal * stretch, dilatation = 0.5 * (i.dilatation + j.dilatation);
  const double pull = beam_pull + material.volumetric_modulus * b.area * dilatation;
  const Vec moment = b.k_bend * bend + b.k_twist * twist * d0;
  const Vec torque = rotated(qi, relative.w * moment - cross(moment, relative.v));

  BondState s;
  (ks_r02 * cosine / r * p - pull * n).to(s.force_j);
  (torque - 0.5 * ks_r02 * cross(di, p)).to(s.torque_i);
  (-1.0 * torque - 0.5 * ks_r02 * cross(dj, p)).to(s.torque_j);
  s.energy = 0.5 * (beam_pull * stretch + ks_r02 * dot(p, p) + dot(moment, turn));

  const double shear_force = std::fabs(ks_r02 * cosine / r) * norm(p);
  const double bending = b.k_bend * norm(bend), twisting = b.k_twist * std::fabs(twist);
  s.normal = pull / b.area;
  s.tension = s.normal + bending * 4 / (b.radius * b.area);
  s.shear = shear_force / b.area + twisting * 2 / (b.radius * b.area);
  s.mode = INTACT;
  if (s.shear * b.area + b.tan_friction * pull > b.shear_force) s.mode = SHEAR;
  const double pressure_force = -material.bulk_modulus() * b.area * dilatation;
  s.loading = std::max((s.tension * b.area - material.strengthening * std::max(pressure_force, 0.0)) / b.tensile_force,
                       (s.shear * b.area + b.tan_friction * pull) / b.shear_force);
  const double over_threshold = std::max(pressure_force - material.threshold_share * b.tensile_force, 0.0);
  if (s.tension * b.area > b.tensile_force + material.strengthening * over_threshold) s.mode = TENSION;
  return s;
}

void add_to_ends(const BondState &s, ForceRecord &i, ForceRecord &j) {
  for (int k = 0; k < 3; k++) {
    i.f[k] -= s.force_j[k];
    j.f[k] += s.force_j[k];
    i.torque[k] += s.torque_i[k];
    j.torque[k] += s.torque_j[k];
  }
}

namespace {

class PlainKernel : public BondKernel {
 public:
  void build(const std::vector<LocalBond> &bonds, int) override { bonds_ = bonds; }

  void add_stretches(const AtomRecord *atom, double *stretch) override {
    for (const LocalBond &b : bonds_) {
      if (!b.bond->material->feels_dilatation()) continue;
      const double own = b.bond->area * (norm(Vec(atom[b.j].x) - Vec(atom[b.i].x)) - b.bond->length);
      stretch[b.i] += own;
      stretch[b.j] += own;
    }
  }

  int add_forces(const AtomRecord *atom, ForceRecord *force, int *broken) override {
    int n_broken = 0;
    size_t kept = 0;
    for (const LocalBond &b : bonds_) {
      const BondState s = bond_state(*b.bond, atom[b.i], atom[b.j]);
      if (s.mode != INTACT) {
        broken[n_broken++] = b.id;
        continue;
      }
      add_to_ends(s, force[b.i], force[b.j]);
      bonds_[kept++] = b;
    }
    bonds_.resize(kept);
    return n_broken;
  }

  void revive(const LocalBond &b) override { bonds_.push_back(b); }

 private:
  std::vector<LocalBond> bonds_;
};

}  // namespace

std::unique_ptr<BondKernel> make_plain_kernel() { return std::make_unique<PlainKernel>(); }

std::unique_ptr<BondKernel> make_bond_kernel(const std::string &name) {
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  const bool avx512 = avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq");
  if (name == "plain") return make_plain_kernel();
  if (avx512 && (name == "avx512" || name == "auto")) return make_avx512_kernel();
  if (avx2 && (name == "avx2" || name == "auto")) return make_avx2_kernel();
  if (name == "sse2" || name == "auto") return make_sse2_kernel();
  return nullptr;
}

}  // namespace LAMMPS_NS
