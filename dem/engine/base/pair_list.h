#pragma once
#include <algorithm>

#include "atom.h"
#include "force.h"
#include "lammps.h"
#include "neigh_list.h"
#include "pair.h"

namespace LAMMPS_NS {

// Takes out of LIGGGHTS' list of neighbours the pairs for which `keep(i, j)`, of local indices, is false. They must not
// touch, so they have no history of contact.
template <class Keep> void keep_in_pair_list(LAMMPS *lmp, Keep keep) {
  NeighList *list = lmp->force->pair->list, *history = list->listgranhistory;
  const int numbers = history ? history->dnum : 0;
  for (int k = 0; k < list->inum; k++) {
    const int i = list->ilist[k];
    int *near = list->firstneigh[i], kept = 0;
    for (int m = 0; m < list->numneigh[i]; m++) {
      if (!keep(i, near[m] & NEIGHMASK)) continue;
      near[kept] = near[m];
      if (history) {
        history->firstneigh[i][kept] = history->firstneigh[i][m];
        double *values = history->firstdouble[i];
        std::copy_n(values + m * numbers, numbers, values + kept * numbers);
      }
      kept++;
    }
    list->numneigh[i] = kept;
  }
}

}  // namespace LAMMPS_NS
