// The engine: stock LIGGGHTS from libliggghts with ten fix styles added.
//
//   bond/parallel   bonds between the sub-spheres of an agglomerate (fix_bond_parallel.h)
//   wall/plate      the granular wall that moves with the plate       (fix_wall_plate.h)
//   smooth_pairs    stones that touch each other as smooth bodies  (fix_smooth_pairs.h)
//   wall/side       a wall that stands on the edge of the plate     (fix_wall_side.h)
//   ledger          energies and momenta of each agglomerate          (fix_ledger.h)
//   monitor         stops a run that is not stable                    (fix_monitor.h)
//   pictures        where the sub-spheres are, for ParaView       (fix_pictures.h)
//   checkpoint      keeps the state of a run and takes it up again    (fix_checkpoint.h)
//   free_flight     bodies in free flight leave the force loops       (fix_free_flight.h)
//   stones          stones come and go                                (fix_stones.h)
//
// It runs any LIGGGHTS deck: `liggghts-bonded -in deck`. The styles are added once, so a deck must not use `clear`.

#include <mpi.h>

#include <cstdio>
#include <cstdlib>
#include <new>

#include "comm.h"
#include "bonds/fix_bond_parallel.h"
#include "record/fix_checkpoint.h"
#include "flight/fix_free_flight.h"
#include "record/fix_ledger.h"
#include "record/fix_monitor.h"
#include "record/fix_pictures.h"
#include "smooth/fix_smooth_pairs.h"
#include "stones/fix_stones.h"
#include "wall/fix_wall_plate.h"
#include "wall/fix_wall_side.h"
#include "input.h"
#include "lammps.h"
#include "library_check.h"
#include "modify.h"

using namespace LAMMPS_NS;

namespace {

// Modify keeps its table of fix styles private. An explicit template instantiation may name a private member,
// which gives access without touching the library's headers.
typedef Fix *(*FixCreator)(LAMMPS *, int, char **);
typedef std::map<std::string, FixCreator> *Modify::*FixMap;
FixMap fix_map();
template <FixMap member> struct Expose {
  friend FixMap fix_map() { return member; }
};
template struct Expose<&Modify::fix_map>;

template <class F> Fix *create(LAMMPS *lmp, int narg, char **arg) { return new F(lmp, narg, arg); }

void add_styles(LAMMPS *lmp) {
  std::map<std::string, FixCreator> &styles = *(lmp->modify->*fix_map());
  styles["bond/parallel"] = &create<FixBondParallel>;
  styles["wall/plate"] = &create<FixWallPlate>;
  styles["wall/side"] = &create<FixWallSide>;
  styles["ledger"] = &create<FixLedger>;
  styles["monitor"] = &create<FixMonitor>;
  styles["pictures"] = &create<FixPictures>;
  styles["checkpoint"] = &create<FixCheckpoint>;
  styles["free_flight"] = &create<FixFreeFlight>;
  styles["smooth_pairs"] = &create<FixSmoothPairs>;
  styles["stones"] = &create<FixStones>;
}

// What MPI does at the start and this engine has no use for, unless the user asks for it. Its look for graphics cards
// connects to X displays of "localhost", ten times, each of which waits for the name server where that name is unknown.
// A single rank starts a daemon of its own, with which it could start others. Messages go through shared memory or TCP;
// drivers of other networks wait 0.2 s for their cards.
// The directory that a single rank would make for its files, and never use, has parents that all programs with MPI
// share: one that starts may miss what another that ends has just removed.
void start_without_detours() {
  setenv("HWLOC_COMPONENTS", "-gl", 0);
  setenv("OMPI_MCA_ess_singleton_isolated", "1", 0);
  setenv("OMPI_MCA_pml", "ob1", 0);
  if (!std::getenv("OMPI_COMM_WORLD_SIZE")) setenv("OMPI_MCA_orte_create_session_dirs", "0", 0);  // no mpirun
}

}  // namespace

int main(int argc, char **argv) {
  start_without_detours();
  MPI_Init(&argc, &argv);
  std::setvbuf(stdout, nullptr, _IOLBF, 0);  // an error of one rank aborts, and must not take its message along
  int exit_code = 0;
  {
    LAMMPS lmp(argc, argv, MPI_COMM_WORLD);
    const char *mismatch = library_mismatch(&lmp);
    if (mismatch) {
      std::fprintf(stderr,
                   "liggghts-bonded: class %s of this libliggghts has another size than in the headers the engine "
                   "was built with; rebuild the engine\n",
                   mismatch);
      exit_code = 3;
    } else {
      add_styles(&lmp);
      try {
        lmp.input->file();
      } catch (const FixCheckpoint::Stopped &at) {
        if (lmp.comm->me == 0) std::printf("Stopped at the checkpoint of step %lld\n", at.step);
        exit_code = FixCheckpoint::STOPPED;
      } catch (const std::bad_alloc &) {
        std::printf("ERROR: not enough memory\n");
        MPI_Abort(MPI_COMM_WORLD, 1);
      }
    }
  }
  MPI_Barrier(MPI_COMM_WORLD);
  MPI_Finalize();
  return exit_code;
}
