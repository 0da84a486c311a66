"""The touching agglomerate of `make bench`, on a face-centred cubic lattice."""

from __future__ import annotations

import numpy as np

from dem.stones.packing import Packing, SphereContainer

# Centre of the fcc sphere from a lattice site, in lattice constants. With radius_m/subsphere_radius_m from 12.029 to
# 12.046 this cut holds 998 sub-spheres and 5181 touching pairs; no centre of symmetry gives these counts.
FCC_CENTRE = (0.05, 0.10, 0.20)


def fcc_sphere(radius_m: float, subsphere_radius_m: float | None = None) -> Packing:
    """Touching equal sub-spheres on a face-centred cubic lattice, all that lie whole inside the sphere.

    By default radius_m/12.04, the agglomerate of `make bench`: 998 sub-spheres, 5181 touching pairs. Raises
    ValueError where not even one sub-sphere fits.
    """
    r = radius_m / 12.04 if subsphere_radius_m is None else subsphere_radius_m
    if not 0 < r < np.inf or not 0 < radius_m < np.inf:
        raise ValueError(f"radii {radius_m} and {r}: must be positive")
    constant = 2 * np.sqrt(2) * r
    steps = np.arange(-int(2 * radius_m / constant) - 2, int(2 * radius_m / constant) + 3)
    site = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    center = constant * (site[site.sum(1) % 2 == 0] / 2 - FCC_CENTRE)
    center = center[np.linalg.norm(center, axis=1) + r <= radius_m]
    if len(center) == 0:
        raise ValueError(f"subsphere_radius_m = {r}: no such sub-sphere of the lattice fits into {radius_m} m")
    return Packing(center, np.full(len(center), r), SphereContainer(radius_m))
