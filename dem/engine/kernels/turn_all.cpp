#include "kernels/turn_all.h"

#include "base/quaternion.h"

namespace LAMMPS_NS {

namespace {
// A quaternion in one register.
typedef double Four __attribute__((vector_size(32), aligned(8), may_alias));
typedef long long Places __attribute__((vector_size(32)));
}  // namespace

// The sub-spheres of a body that is held have one angular velocity, so a turn is kept as long as it stays the same.
__attribute__((target_clones("avx2", "default")))
void turn_all(double *q, const double *omega, int count, double half_dt) {
  Four c{}, first{}, second{}, third{};
  const double *known = nullptr;
  for (int k = 0; k < count; k++, q += 4, omega += 3) {
    if (!known || omega[0] != known[0] || omega[1] != known[1] || omega[2] != known[2]) {
      const HalfTurn t(omega, half_dt);
      c = Four{t.c, t.c, t.c, t.c};
      first = Four{-t.u0, t.u0, t.u1, t.u2};
      second = Four{-t.u1, t.u1, t.u2, t.u0};
      third = Four{-t.u2, -t.u2, -t.u0, -t.u1};
      known = omega;
    }
    Four &r = *reinterpret_cast<Four *>(q);
    const Four old = r;
    r = c * old + first * __builtin_shuffle(old, Places{1, 0, 0, 0}) +
        second * __builtin_shuffle(old, Places{2, 3, 1, 2}) + third * __builtin_shuffle(old, Places{3, 2, 3, 1});
  }
}

}  // namespace LAMMPS_NS
