#include "record/bond_events.h"

#include <mpi.h>

#include <cstdio>
#include <vector>

#include "comm.h"
#include "error.h"
#include "lammps.h"

namespace LAMMPS_NS {

void BondEvents::open(LAMMPS *lmp, const std::string &file) {
  lmp_ = lmp;
  file_ = file;
  if (lmp->comm->me != 0) return;
  FILE *out = std::fopen(file.c_str(), "a");
  if (!out) lmp->error->one(FLERR, ("cannot write " + file).c_str());
  if (std::ftell(out) == 0) std::fputs("step,bond,agglomerate,x_m,y_m,z_m,mode,stress_Pa,energy_J,area_m2\n", out);
  std::fclose(out);
}

void BondEvents::write() {
  const Comm *comm = lmp_->comm;
  const int mine = lines_.size();
  std::vector<int> count(comm->nprocs, mine), offset(comm->nprocs, 0);
  std::string all = lines_;
  if (comm->nprocs > 1) {
    MPI_Gather(&mine, 1, MPI_INT, count.data(), 1, MPI_INT, 0, lmp_->world);
    for (int p = 1; p < comm->nprocs; p++) offset[p] = offset[p - 1] + count[p - 1];
    if (comm->me == 0) all.resize(offset.back() + count.back());
    MPI_Gatherv(lines_.data(), mine, MPI_CHAR, &all[0], count.data(), offset.data(), MPI_CHAR, 0, lmp_->world);
  }
  lines_.clear();
  if (comm->me != 0 || all.empty()) return;
  FILE *out = std::fopen(file_.c_str(), "a");
  const bool written = out && std::fwrite(all.data(), 1, all.size(), out) == all.size();
  if (!written || std::fclose(out) != 0) lmp_->error->one(FLERR, ("cannot write " + file_).c_str());
}

}  // namespace LAMMPS_NS
