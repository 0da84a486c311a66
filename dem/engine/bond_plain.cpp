// One bond written as in the text books: the reference for the packed kernels, and the source of energies and events.

#include <cmath>

#include "bond_kernel.h"

namespace LAMMPS_NS {

namespace {

struct Vec {
  double x, y, z;
};
Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vec operator*(double s, Vec a) { return {s * a.x, s * a.y, s * a.z}; }
double dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec cross(Vec a, Vec b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
void store(Vec a, double *out) { out[0] = a.x, out[1] = a.y, out[2] = a.z; }

struct Quaternion {
  double w;
  Vec v;
};
Quaternion conjugate(Quaternion q) { return {q.w, -1.0 * q.v}; }
Quaternion operator*(Quaternion a, Quaternion b) {
  return {a.w * b.w - dot(a.v, b.v), a.w * b.v + b.w * a.v + cross(a.v, b.v)};
}
Vec rotate(Quaternion q, Vec a) { return (q * Quaternion{0, a} * conjugate(q)).v; }

}  // namespace

BondState bond_state(const Bond &b, const AtomRecord &i, const AtomRecord &j) {
  const Quaternion qi{i.q[0], {i.q[1], i.q[2], i.q[3]}}, qj{j.q[0], {j.q[1], j.q[2], j.q[3]}};
  const Vec d0{b.direction[0], b.direction[1], b.direction[2]};
  const Vec branch = Vec{j.x[0], j.x[1], j.x[2]} - Vec{i.x[0], i.x[1], i.x[2]};
  const double r = std::sqrt(dot(branch, branch));
  const Vec n = 1 / r * branch;

  // The bond's axis as each end carries it; their mean against the branch is the shear of the bond.
  const Vec di = rotate(qi, d0), dj = rotate(qj, d0), mean = 0.5 * (di + dj);
  const double cosine = dot(mean, n);
  const Vec p = mean - cosine * n;
  // How j is turned against i, as a rotation vector in the frame of i (2 sin(theta/2), 1 % low at 0.5 rad).
  const Quaternion relative = conjugate(qi) * qj;
  const Vec turn = 2.0 * relative.v;
  const double twist = dot(turn, d0);
  const Vec bend = turn - twist * d0;

  // U = k_n (r - r0)^2/2 + k_s r0^2 |p|^2/2 + k_b |bend|^2/2 + k_t twist^2/2; forces and torques are its gradient.
  const double stretch = r - b.length, ks_r02 = b.k_shear * b.length * b.length;
  const double pull = b.k_normal * stretch;
  const Vec moment = b.k_bend * bend + b.k_twist * twist * d0;
  const Vec torque = rotate(qi, relative.w * moment - cross(moment, relative.v));

  BondState s;
  store(ks_r02 * cosine / r * p - pull * n, s.force_j);
  store(torque - 0.5 * ks_r02 * cross(di, p), s.torque_i);
  store(-1.0 * torque - 0.5 * ks_r02 * cross(dj, p), s.torque_j);
  s.energy = 0.5 * (pull * stretch + ks_r02 * dot(p, p) + dot(moment, turn));

  const double shear_force = std::fabs(ks_r02 * cosine / r) * std::sqrt(dot(p, p));
  const double bending = b.k_bend * std::sqrt(dot(bend, bend)), twisting = b.k_twist * std::fabs(twist);
  s.normal = pull / b.area;
  s.tension = s.normal + bending * 4 / (b.radius * b.area);
  s.shear = shear_force / b.area + twisting * 2 / (b.radius * b.area);
  s.mode = INTACT;
  if (s.shear * b.area + b.tan_friction * pull > b.shear_force) s.mode = SHEAR;
  if (s.tension * b.area > b.tensile_force) s.mode = TENSION;
  return s;
}

namespace {

class PlainKernel : public BondKernel {
 public:
  void build(const std::vector<LocalBond> &bonds, int) override { bonds_ = bonds; }

  int add_forces(const AtomRecord *atom, ForceRecord *force, int *broken) override {
    int n_broken = 0;
    size_t kept = 0;
    for (const LocalBond &b : bonds_) {
      const BondState s = bond_state(*b.bond, atom[b.i], atom[b.j]);
      if (s.mode != INTACT) {
        broken[n_broken++] = b.id;
        continue;
      }
      for (int k = 0; k < 3; k++) {
        force[b.i].f[k] -= s.force_j[k];
        force[b.j].f[k] += s.force_j[k];
        force[b.i].torque[k] += s.torque_i[k];
        force[b.j].torque[k] += s.torque_j[k];
      }
      bonds_[kept++] = b;
    }
    bonds_.resize(kept);
    return n_broken;
  }

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
