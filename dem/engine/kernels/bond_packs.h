#pragma once
// The same bond as bond_state in bond_plain.cpp, W at a time in vector registers.
//
// Bonds lie in packs of W, one number of all W bonds beside the other. The records of the 2 W sub-spheres are loaded
// whole and transposed in registers, the formulas run on all W bonds at once, and the forces are transposed back.
// A large stone does not fit in the near caches, so a bond is one cache line, 64 bytes: what its material has in common
// with the others stands once in front of their packs, and the rest is computed.
// Included once per width; each translation unit is compiled for its own instruction set.

#include <immintrin.h>

#include <cmath>

#include "kernels/bond_kernel.h"

namespace LAMMPS_NS {
namespace {

template <int W> struct Simd;
template <> struct Simd<2> {
  typedef double Reg __attribute__((vector_size(16)));
  static Reg root(Reg a) { return _mm_sqrt_pd(a); }
  template <class Mask> static bool any(Mask m) { return _mm_movemask_pd((__m128d)m) != 0; }
};
#ifdef __AVX2__
template <> struct Simd<4> {
  typedef double Reg __attribute__((vector_size(32)));
  static Reg root(Reg a) { return _mm256_sqrt_pd(a); }
  template <class Mask> static bool any(Mask m) { return _mm256_movemask_pd((__m256d)m) != 0; }
};
#endif
#ifdef __AVX512F__
template <> struct Simd<8> {
  typedef double Reg __attribute__((vector_size(64)));
  static Reg root(Reg a) { return _mm512_maskz_sqrt_pd(0xff, a); }
  template <class Mask> static bool any(Mask m) { return _mm512_test_epi64_mask((__m512i)m, (__m512i)m) != 0; }
};
#endif

// In-register transpose of W rows of W numbers: log2(W) rounds of pairwise shuffles.
inline void transpose(Simd<2>::Reg *m) {
  const Simd<2>::Reg low = __builtin_shufflevector(m[0], m[1], 0, 2), high = __builtin_shufflevector(m[0], m[1], 1, 3);
  m[0] = low, m[1] = high;
}
#ifdef __AVX2__
inline void transpose(Simd<4>::Reg *m) {
  typedef Simd<4>::Reg R;
  const R a = __builtin_shufflevector(m[0], m[1], 0, 4, 2, 6), b = __builtin_shufflevector(m[0], m[1], 1, 5, 3, 7);
  const R c = __builtin_shufflevector(m[2], m[3], 0, 4, 2, 6), d = __builtin_shufflevector(m[2], m[3], 1, 5, 3, 7);
  m[0] = __builtin_shufflevector(a, c, 0, 1, 4, 5), m[2] = __builtin_shufflevector(a, c, 2, 3, 6, 7);
  m[1] = __builtin_shufflevector(b, d, 0, 1, 4, 5), m[3] = __builtin_shufflevector(b, d, 2, 3, 6, 7);
}
#endif
#ifdef __AVX512F__
inline void transpose(Simd<8>::Reg *m) {
  typedef Simd<8>::Reg R;
  R t[8], u[8];
  for (int k = 0; k < 8; k += 2) {
    t[k] = __builtin_shufflevector(m[k], m[k + 1], 0, 8, 2, 10, 4, 12, 6, 14);
    t[k + 1] = __builtin_shufflevector(m[k], m[k + 1], 1, 9, 3, 11, 5, 13, 7, 15);
  }
  for (int k = 0; k < 8; k += 4)
    for (int h = 0; h < 2; h++) {
      u[k + h] = __builtin_shufflevector(t[k + h], t[k + h + 2], 0, 1, 8, 9, 4, 5, 12, 13);
      u[k + h + 2] = __builtin_shufflevector(t[k + h], t[k + h + 2], 2, 3, 10, 11, 6, 7, 14, 15);
    }
  for (int h = 0; h < 4; h++) {
    m[h] = __builtin_shufflevector(u[h], u[h + 4], 0, 1, 2, 3, 8, 9, 10, 11);
    m[h + 4] = __builtin_shufflevector(u[h], u[h + 4], 4, 5, 6, 7, 12, 13, 14, 15);
  }
}
#endif

template <int W> struct Vec3 {
  typedef typename Simd<W>::Reg R;
  R x, y, z;
  Vec3 operator+(const Vec3 &b) const { return {x + b.x, y + b.y, z + b.z}; }
  Vec3 operator-(const Vec3 &b) const { return {x - b.x, y - b.y, z - b.z}; }
};
template <int W> Vec3<W> operator*(const typename Simd<W>::Reg &s, const Vec3<W> &a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <int W> typename Simd<W>::Reg dot(const Vec3<W> &a, const Vec3<W> &b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <int W> Vec3<W> cross(const Vec3<W> &a, const Vec3<W> &b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

template <int W> struct alignas(64) Pack {
  typename Simd<W>::Reg length, dx, dy, dz, k_normal, radius, tensile;
  int i[W], j[W];
};

// Consecutive packs of bonds of one material.
struct Stretch {
  const BondMaterial *material;
  size_t end;  // of its packs
};

template <int W> class PackedKernel : public BondKernel {
  typedef typename Simd<W>::Reg R;
  typedef Vec3<W> V;
  static constexpr int PARTS = 8 / W;  // registers a record
  static constexpr size_t PACKS_AHEAD = 3, NEAR_BYTES = 16 << 20;

  struct Ends {
    V x;
    R w;
    V q;
    R dilatation;
  };

  std::vector<Pack<W>> packs_;
  std::vector<int> id_;  // of bond l of pack p at p W + l
  std::vector<size_t> place_;  // there, by id, of bonds that soften
  std::vector<Stretch> stretches_;
  size_t fetched_ = 0;  // packs, of all where they are too many for the near caches, else of none
  std::vector<R> distance_;  // of the two ends of the bonds of each pack, where add_stretches was asked

  static Ends load(const AtomRecord *atom, const int *index) {
    R m[8];
    for (int part = 0; part < PARTS; part++) {
      for (int l = 0; l < W; l++)
        m[part * W + l] = *reinterpret_cast<const R *>(reinterpret_cast<const double *>(atom + index[l]) + part * W);
      transpose(m + part * W);
    }
    return {{m[0], m[1], m[2]}, m[3], {m[4], m[5], m[6]}, m[7]};
  }

  // The positions alone.
  static V load_place(const AtomRecord *atom, const int *index) {
    R m[8];
    for (int part = 0; part < PARTS && part * W < 3; part++) {
      for (int l = 0; l < W; l++)
        m[part * W + l] = *reinterpret_cast<const R *>(reinterpret_cast<const double *>(atom + index[l]) + part * W);
      transpose(m + part * W);
    }
    return {m[0], m[1], m[2]};
  }

  // Asks in time for what a later pack reads and adds to at its ends j. Those at i are near: bonds are in their order.
  template <class Sum> void fetch(size_t k, const AtomRecord *atom, const Sum *sum) const {
    if (k + PACKS_AHEAD >= fetched_) return;
    for (const int j : packs_[k + PACKS_AHEAD].j) __builtin_prefetch(atom + j), __builtin_prefetch(sum + j, 1);
  }

  // What is left of it where the bond has softened.
  static R area(const Pack<W> &b, const R &compliance) { return compliance * b.k_normal * b.length; }

  static void add(ForceRecord *force, const int *index, const V &f, const V &torque) {
    R m[8] = {f.x, f.y, f.z, torque.x, torque.y, torque.z, R{}, R{}};
    for (int part = 0; part < PARTS; part++) transpose(m + part * W);
    for (int l = 0; l < W; l++)
      for (int part = 0; part < PARTS; part++)
        *reinterpret_cast<R *>(reinterpret_cast<double *>(force + index[l]) + part * W) += m[part * W + l];
  }

  static V rotate(const R &w, const V &q, const V &a) {
    const V t = cross<W>(q, a) + cross<W>(q, a);
    return a + w * t + cross<W>(q, t);
  }

  static R absolute(const R &a) { return a < 0 ? -a : a; }

  static void set(Pack<W> &p, int l, const Bond &b) {
    p.k_normal[l] = b.k_normal, p.radius[l] = b.radius, p.tensile[l] = b.tensile_force;
  }

  // Broken bonds leave their lane without stiffness and area, and out of reach of the criterion.
  static void retire(Pack<W> &b, int l) {
    b.k_normal[l] = b.radius[l] = 0;
    b.tensile[l] = 1e150;
  }

  // A lane without a bond, between the two spare records.
  static Pack<W> empty(int spare) {
    Pack<W> p = Pack<W>();
    for (int l = 0; l < W; l++) {
      p.i[l] = spare, p.j[l] = spare + 1;
      p.length[l] = p.dx[l] = 1;
      retire(p, l);
    }
    return p;
  }

 public:
  void build(const std::vector<LocalBond> &bonds, int spare) override {
    packs_.clear(), id_.clear(), stretches_.clear();
    int l = W;  // lane of the next bond
    for (const LocalBond &local : bonds) {
      const Bond &b = *local.bond;
      const bool other = stretches_.empty() || stretches_.back().material != b.material;
      if (other) stretches_.push_back({b.material, 0});
      if (other || l == W) packs_.push_back(empty(spare)), id_.resize(packs_.size() * W, -1), l = 0;
      stretches_.back().end = packs_.size();
      Pack<W> &p = packs_.back();
      id_[(packs_.size() - 1) * W + l] = local.id;
      p.i[l] = local.i, p.j[l] = local.j;
      p.length[l] = b.length;
      p.dx[l] = b.direction[0], p.dy[l] = b.direction[1], p.dz[l] = b.direction[2];
      set(p, l, b);
      if (b.material->softens()) {
        if (place_.size() <= static_cast<size_t>(b.id)) place_.resize(b.id + 1);
        place_[b.id] = (packs_.size() - 1) * W + l;
      }
      l++;
    }
    fetched_ = packs_.size() * sizeof(Pack<W>) > NEAR_BYTES ? packs_.size() : 0;
  }

  void add_stretches(const AtomRecord *atom, double *stretch) override {
    distance_.resize(packs_.size());
    size_t begin = 0;
    for (const Stretch &s : stretches_) {
      if (s.material->feels_dilatation()) add_stretches(*s.material, begin, s.end, atom, stretch);
      begin = s.end;
    }
  }

  int add_forces(const AtomRecord *atom, ForceRecord *force, int *broken) override {
    int n_broken = 0;
    size_t begin = 0;
    for (const Stretch &s : stretches_) {
      int *const room = broken + n_broken;
      n_broken += s.material->feels_dilatation() ? add_forces<true>(*s.material, begin, s.end, atom, force, room)
                                                 : add_forces<false>(*s.material, begin, s.end, atom, force, room);
      begin = s.end;
    }
    return n_broken;
  }

  void revive(const LocalBond &b) override {
    const size_t place = place_[b.id];
    set(packs_[place / W], place % W, *b.bond);
  }

 private:
  void add_stretches(const BondMaterial &material, size_t begin, size_t end, const AtomRecord *atom, double *stretch) {
    const R compliance = R{} + 1 / material.modulus;
    for (size_t k = begin; k < end; k++) {
      const Pack<W> &b = packs_[k];
      fetch(k, atom, stretch);
      const V branch = load_place(atom, b.j) - load_place(atom, b.i);
      const R r = Simd<W>::root(dot<W>(branch, branch)), own = area(b, compliance) * (r - b.length);
      distance_[k] = r;
      for (int l = 0; l < W; l++) stretch[b.i[l]] += own[l], stretch[b.j[l]] += own[l];
    }
  }

  template <bool DILATES> int add_forces(const BondMaterial &material, size_t begin, size_t end, const AtomRecord *atom, ForceRecord *force,
                 int *broken) {
    const R half = R{} + 0.5, quarter = R{} + 0.25;
    const R shear_share = R{} + 1 / material.stiffness_ratio;
    const R cohesion = R{} + material.shear_strength / material.tensile_strength;
    const R tan_friction = R{} + material.tan_friction;
    const R volumetric = R{} + material.volumetric_modulus, bulk = R{} + material.bulk_modulus();
    const R strengthening = R{} + material.strengthening, threshold = R{} + material.threshold_share;
    const R compliance = R{} + 1 / material.modulus;
    int n_broken = 0;
    for (size_t k = begin; k < end; k++) {
      Pack<W> &b = packs_[k];
      fetch(k, atom, force);
      const Ends i = load(atom, b.i), j = load(atom, b.j);
      const V d0{b.dx, b.dy, b.dz};
      const V branch = j.x - i.x;
      const R r = DILATES ? distance_[k] : Simd<W>::root(dot<W>(branch, branch)), r_inverse = 1 / r;
      const V n = r_inverse * branch;

      const V di = rotate(i.w, i.q, d0), dj = rotate(j.w, j.q, d0);
      const V mean = half * (di + dj);
      const R cosine = dot<W>(mean, n);
      const V p = mean - cosine * n;
      const R w = i.w * j.w + dot<W>(i.q, j.q);
      const V half_turn = i.w * j.q - j.w * i.q - cross<W>(i.q, j.q);
      const V turn = half_turn + half_turn;
      const R twist = dot<W>(turn, d0);
      const V bend = turn - twist * d0;

      R pull = b.k_normal * (r - b.length), tensile = b.tensile;
      if (DILATES) {
        const R volume_force = half * (i.dilatation + j.dilatation) * area(b, compliance);  // over its modulus
        const R over_threshold = R{} - bulk * volume_force - threshold * b.tensile;
        pull += volumetric * volume_force;
        tensile += strengthening * (over_threshold > 0 ? over_threshold : R{});
      }
      const R kr = b.k_normal * b.radius, shear_kr = shear_share * kr;  // k_b = kr r/4, k_t = shear_kr r/2
      V moment = quarter * kr * b.radius * bend + half * shear_kr * b.radius * twist * d0;
      R shearing = shear_share * b.k_normal * b.length * b.length;
      R slope = shearing * cosine * r_inverse;

      // Tension: pull + |M_b| 4/r > limit. Shear: |F_s| + |M_t| 2/r > limit - tan(phi) pull. Squared, sign kept.
      const R tension_margin = tensile - pull;
      const R shear_margin = cohesion * b.tensile - tan_friction * pull - shear_kr * absolute(twist);
      const R bending2 = kr * kr * dot<W>(bend, bend);
      const R excess = bending2 - tension_margin * absolute(tension_margin);
      const R shear_excess = slope * slope * dot<W>(p, p) - shear_margin * absolute(shear_margin);
      const auto fails = (excess > 0) | (shear_excess > 0);
      R normal_force = pull;
      if (Simd<W>::any(fails)) {
        const R keep = fails ? R{} : R{} + 1.0;
        for (int l = 0; l < W; l++)
          if (keep[l] == 0) {
            broken[n_broken++] = id_[k * W + l];
            retire(b, l);
          }
        normal_force *= keep, slope *= keep, shearing *= keep;
        moment = keep * moment;
      }

      const V force_j = slope * p - normal_force * n;
      const V torque = rotate(i.w, i.q, w * moment - cross<W>(moment, half_turn));
      const R half_shearing = half * shearing;
      const V zero{R{}, R{}, R{}};
      add(force, b.i, zero - force_j, torque - half_shearing * cross<W>(di, p));
      add(force, b.j, force_j, zero - torque - half_shearing * cross<W>(dj, p));
    }
    return n_broken;
  }
};

}  // namespace
}  // namespace LAMMPS_NS
