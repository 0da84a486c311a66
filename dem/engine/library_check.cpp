#include "library_check.h"

#include <malloc.h>

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "error.h"
#include "force.h"
#include "group.h"
#include "input.h"
#include "lammps.h"
#include "memory.h"
#include "modify.h"
#include "neighbor.h"
#include "output.h"
#include "universe.h"
#include "update.h"

using namespace LAMMPS_NS;

namespace {
// An allocator hands out what `new T` asked for (sanitizers, valgrind) or rounds it up to 16 n + 8 bytes, at least 24
// (glibc).
bool allocated_as(const void *object, unsigned long size) {
  const unsigned long usable = malloc_usable_size(const_cast<void *>(object));
  return size <= usable && usable <= (size <= 24 ? 24 : (size + 7) / 16 * 16 + 8);
}
}  // namespace

const char *library_mismatch(LAMMPS *lmp) {
#define CHECK(member, T) \
  if (!allocated_as(lmp->member, sizeof(T))) return #T;
  CHECK(memory, Memory)
  CHECK(error, Error)
  CHECK(universe, Universe)
  CHECK(input, Input)
  CHECK(atom, Atom)
  CHECK(update, Update)
  CHECK(neighbor, Neighbor)
  CHECK(domain, Domain)
  CHECK(force, Force)
  CHECK(modify, Modify)
  CHECK(group, Group)
  CHECK(output, Output)
#undef CHECK
  return nullptr;
}
