"""The network of parallel bonds of a packing, its fragments, and its elastic constants without a time step.

A bond is a short round beam of radius r_b and length L = |v| between the centres of two sub-spheres, with

    k_n = E A/L,   k_s = k_n/stiffness_ratio (acting at mid-length),   k_b = k_n r_b^2/4,   k_t = k_s r_b^2/2

(D. O. Potyondy and P. A. Cundall, Int. J. Rock Mech. Min. Sci. 41 (2004) 1329), the same as in dem/engine.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from dem.packing import Packing, near_pairs

GAP_TOLERANCE = 0.2  # of the sum of the two radii; see docs/packing.md for what other values do
LEAST_BONDS = 3      # that hold a sub-sphere against any force


@dataclass(frozen=True)
class Bonds:
    """m bonds: `first` < `second` (m,) 0-based sub-spheres, `vector_m` (m, 3) from first to second in the undeformed
    state, `radius_m` (m,) of the beam."""

    first: np.ndarray
    second: np.ndarray
    vector_m: np.ndarray
    radius_m: np.ndarray

    @property
    def length_m(self) -> np.ndarray:
        return np.linalg.norm(self.vector_m, axis=1)

    @property
    def area_m2(self) -> np.ndarray:
        return np.pi * self.radius_m**2

    @property
    def inertia_m4(self) -> np.ndarray:
        """Second moment of area for bending."""
        return np.pi * self.radius_m**4 / 4

    @property
    def polar_m4(self) -> np.ndarray:
        """Second moment of area for twist."""
        return np.pi * self.radius_m**4 / 2

    def __len__(self) -> int:
        return len(self.first)


def bond_network(packing: Packing, gap_tolerance: float = GAP_TOLERANCE, radius_ratio: float = 1.0) -> Bonds:
    """Bond every two sub-spheres with a gap of at most `gap_tolerance` times the sum of their radii.

    The bond's radius is `radius_ratio` times the smaller of the two. A sub-sphere left with fewer than three bonds
    gets its nearest unbonded neighbours, by gap over sum of radii, until it has three (or all there are).

    Raises ValueError for a negative tolerance or a radius ratio that is not positive, and where the network falls
    into separate pieces.
    """
    if not gap_tolerance >= 0 or not radius_ratio > 0:
        raise ValueError(f"gap_tolerance = {gap_tolerance}, radius_ratio = {radius_ratio}: must be >= 0 and > 0")
    n = len(packing.radius_m)
    pairs = _with_least_bonds(packing, near_pairs(packing.center_m, packing.radius_m, gap_tolerance))
    pieces = fragments(n, pairs[:, 0], pairs[:, 1], np.ones(len(pairs), dtype=bool)).max() + 1
    if pieces > 1:
        raise ValueError(f"the bonds leave {n} sub-spheres in {pieces} separate pieces: gap_tolerance = "
                         f"{gap_tolerance} must be larger")
    first, second = pairs.T
    return Bonds(first, second, packing.center_m[second] - packing.center_m[first],
                 radius_ratio * np.minimum(packing.radius_m[first], packing.radius_m[second]))


def _with_least_bonds(packing: Packing, pairs: np.ndarray) -> np.ndarray:
    """The pairs, and more for sub-spheres with fewer than LEAST_BONDS."""
    n = len(packing.radius_m)
    wanted = min(LEAST_BONDS, n - 1)
    added = []
    for k in np.flatnonzero(np.bincount(pairs.ravel(), minlength=n) < wanted):
        distance = np.linalg.norm(packing.center_m - packing.center_m[k], axis=1)
        relative = distance / (packing.radius_m + packing.radius_m[k])
        relative[k] = np.inf
        nearest = np.argsort(relative, kind="stable")[:wanted]
        added += [(min(k, other), max(k, other)) for other in nearest]
    return np.unique(np.vstack([pairs, *added]), axis=0) if added else pairs


def fragments(count: int, first: np.ndarray, second: np.ndarray, intact: np.ndarray) -> np.ndarray:
    """Label (count,), from 0, of the piece that each sub-sphere belongs to by its `intact` (m,) bonds."""
    links = coo_matrix((np.ones(int(np.sum(intact))), (first[intact], second[intact])), shape=(count, count))
    return connected_components(links, directed=False)[1]
