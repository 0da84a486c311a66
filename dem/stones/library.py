"""Packings and surfaces of stones, kept for every later run (common/files/cache.py).

A packing takes a third of a second to find and a few milliseconds to read. It is the same bit by bit for the same
radius, number, seed and code; so is what a run makes of it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from common.files.cache import cached, key_of
from common.scene.scene import BondTable
from dem.stones.bonds import Bonds
from dem.stones.contact_patch import StoneSurface, is_surface, stone_surface
from dem.stones.packing import Container, ConvexContainer, Packing, SphereContainer, pack, pack_sphere
from dem.stones.solids import MeshContainer, Solid

CODE = Path(__file__)
REFERENCE_RADIUS_m = 0.025  # with which a packing is kept; all sizes are alike


def packed(solid: Solid | None, count: int, seed: int, cache_dir: Path | None) -> Packing:
    """In a solid of the volume of the reference sphere, or as `pack_sphere` in that sphere itself; from the library in
    `cache_dir` if it is there. Without a directory it is packed."""
    container: Container = SphereContainer(REFERENCE_RADIUS_m) if solid is None else (
        container_of(solid).in_units(1 / REFERENCE_RADIUS_m))

    def find() -> dict[str, np.ndarray]:
        packing = pack_sphere(REFERENCE_RADIUS_m, count, seed) if solid is None else pack(container, count, seed)
        return {"center_m": packing.center_m, "radius_m": packing.radius_m}

    kept = cached(cache_dir, "packing", key_of(CODE, container, count, seed), find)
    return Packing(kept["center_m"], kept["radius_m"], container)


def container_of(solid: Solid) -> ConvexContainer | MeshContainer:
    """The faces of a solid, of a convex one those that its triangles share once."""
    if not solid.is_convex:
        return MeshContainer(tuple(map(tuple, solid.corner.tolist())), tuple(map(tuple, solid.triangle.tolist())),
                             solid.volume)
    planes = np.unique(np.round(np.column_stack([solid.normal, solid.offset]), 9), axis=0)
    x, y, z = np.abs(solid.corner).max(axis=0).tolist()
    return ConvexContainer(tuple(map(tuple, planes.tolist())), (x, y, z), solid.volume)


def scaled_packing(packing: Packing, radius_m: float) -> Packing:
    """A packing of the reference size at another one."""
    size = radius_m / REFERENCE_RADIUS_m
    return Packing(size * packing.center_m, size * packing.radius_m, packing.container.in_units(1 / size))


def surface_of(packing: Packing, bonds: Bonds, bond: BondTable, cache_dir: Path | None) -> StoneSurface:
    """As `stone_surface`; the compliances, which take longest, come from the library if they are there."""

    def find() -> dict[str, np.ndarray]:
        return {"compliance_m_N": stone_surface(packing, bonds, bond).compliance_m_N}

    key = key_of(CODE, packing.container, packing.center_m.tobytes(), packing.radius_m.tobytes(), bonds.first.tobytes(),
                 bonds.second.tobytes(), bonds.radius_m.tobytes(), bond.youngs_modulus_Pa, bond.stiffness_ratio,
                 bond.volumetric_ratio)
    kept = cached(cache_dir, "surface", key, find)
    return StoneSurface(packing.center_m, is_surface(packing), kept["compliance_m_N"])
