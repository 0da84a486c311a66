"""All sub-spheres and bonds of a scene, ready for the deck."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from common.scene import Scene
from common.tables import Refused
from dem.stones.arrangement import Arrangement
from dem.stones.bonds import Bonds, bond_network
from dem.stones.contact_patch import StoneSurface
from dem.stones.library import packed_sphere, surface_of
from dem.stones.packing import Packing, SphereContainer

# A sub-sphere is drawn in by this factor against its radius in the packing, so that a bonded pair has no contact
# before its bond breaks: no stiffness counted twice. Its density makes up for the mass.
CONTACT_RADIUS_RATIO = 0.975


@dataclass(frozen=True)
class Assembly:
    """n sub-spheres and m bonds.

    `center_m` (n, 3), `radius_m` (n,) of contact, `mass_kg` (n,), `material` (n,) index into `materials`,
    `agglomerate` (n,) 0-based and ascending; `bond_first`, `bond_second` (m,) 0-based sub-spheres, `bond_vector_m`
    (m, 3) from first to second, `bond_radius_m` (m,), all in the undeformed state; `bond_strength_factor` (m,) on both
    strengths of the material. `surfaces`: of each agglomerate where stones touch as smooth bodies, else empty.
    """

    materials: list[str]
    center_m: np.ndarray
    radius_m: np.ndarray
    mass_kg: np.ndarray
    material: np.ndarray
    agglomerate: np.ndarray
    bond_first: np.ndarray
    bond_second: np.ndarray
    bond_vector_m: np.ndarray
    bond_radius_m: np.ndarray
    bond_strength_factor: np.ndarray
    surfaces: tuple[StoneSurface, ...] = ()

    @property
    def n_particles(self) -> int:
        """Number of sub-spheres."""
        return len(self.radius_m)

    @property
    def n_bonds(self) -> int:
        """Number of bonds, 0 for unbonded spheres."""
        return len(self.bond_first)

    @property
    def bond_material(self) -> np.ndarray:
        """(m,) index into `materials` of each bond."""
        return self.material[self.bond_first]

    @property
    def sizes(self) -> np.ndarray:
        """Number of sub-spheres of each agglomerate."""
        return np.bincount(self.agglomerate)

    @property
    def stone_materials(self) -> list[str]:
        """Name of the material of each agglomerate."""
        first = np.append(0, np.cumsum(self.sizes)[:-1])
        return [self.materials[m] for m in self.material[first]]


def assemble(scene: Scene, arrangement: Arrangement, cache_dir: Path | None = None) -> Assembly:
    """Pack each stone and set it down above the plate, its lowest point `gap_m` up, or higher to arrive later.

    Packings come from the library in `cache_dir`, if that is given. Raises Refused, a key of `stones.agglomerate`,
    where sub-spheres are too few for a smooth contact.
    """
    stones = scene.stones
    materials = sorted(set(arrangement.material))  # LIGGGHTS wants types without gaps
    parts, surfaces = [], []
    for k, (place, material) in enumerate(zip(arrangement.position_m, arrangement.material)):
        packing, radius, network = _stone(scene, k, cache_dir)
        lowest = (packing.center_m[:, 2] - radius).min()
        if scene.has_smooth_contact:
            lowest = -stones.radius_m
            surfaces.append(_surface(scene, packing, network, material, cache_dir))
        center = packing.center_m + [place[0], place[1], _height_m(scene, k) - lowest]
        bonds = (network.first, network.second, network.vector_m, network.radius_m)
        mass = scene.materials[material].density_kg_m3 * 4 / 3 * np.pi * stones.radius_m**3
        parts.append((center, radius, mass * radius**3 / (radius**3).sum(), materials.index(material), bonds,
                      scene.stones.strength_factor[k] if scene.stones.strength_factor else 1.0))
    first = np.cumsum([0, *(len(p[0]) for p in parts)])
    return Assembly(
        materials=materials,
        center_m=np.vstack([p[0] for p in parts]),
        radius_m=np.concatenate([p[1] for p in parts]),
        mass_kg=np.concatenate([p[2] for p in parts]),
        material=np.concatenate([np.full(len(p[0]), p[3]) for p in parts]),
        agglomerate=np.concatenate([np.full(len(p[0]), k) for k, p in enumerate(parts)]),
        bond_first=np.concatenate([p[4][0] + f for p, f in zip(parts, first)]),
        bond_second=np.concatenate([p[4][1] + f for p, f in zip(parts, first)]),
        bond_vector_m=np.vstack([p[4][2] for p in parts]),
        bond_radius_m=np.concatenate([p[4][3] for p in parts]),
        bond_strength_factor=np.concatenate([np.full(len(p[4][0]), p[5]) for p in parts]),
        surfaces=tuple(surfaces),
    )


def _height_m(scene: Scene, index: int) -> float:
    """Of the stone's lowest point: what it falls in its time of arrival on top of the gap."""
    later = scene.stones.arrival_s[index] if scene.stones.arrival_s else 0.0
    return scene.stones.gap_m + scene.stones.speed_m_s * later + 0.5 * scene.time.gravity_m_s2 * later**2


def _stone(scene: Scene, index: int, cache_dir: Path | None) -> tuple[Packing, np.ndarray, Bonds]:
    """Packing of one stone about its own centre, radii of contact (n,), and bonds; an unbonded sphere has none."""
    stones = scene.stones
    if stones.agglomerate is None:
        none = np.zeros(0, dtype=int)
        one = Packing(np.zeros((1, 3)), np.array([stones.radius_m]), SphereContainer(stones.radius_m))
        return one, one.radius_m, Bonds(none, none, np.zeros((0, 3)), np.zeros(0))
    # A place keeps its packing whatever its material, so that a sweep changes the material alone.
    packing = packed_sphere(stones.radius_m, stones.agglomerate.subspheres, stones.seed + index, cache_dir)
    order = _along_z_curve(packing.center_m, 2 * packing.radius_m.max())
    packing = replace(packing, center_m=packing.center_m[order], radius_m=packing.radius_m[order])
    return packing, CONTACT_RADIUS_RATIO * packing.radius_m, bond_network(packing)


def _surface(scene: Scene, packing: Packing, network: Bonds, material: str,
             cache_dir: Path | None) -> StoneSurface:
    try:
        return surface_of(packing, network, scene.bond_of(material), cache_dir)
    except ValueError as error:
        allowed = f"must be more where contact = 'smooth', such as 200: {error}"
        raise Refused("subspheres", len(packing.radius_m), allowed) from None


def _along_z_curve(points: np.ndarray, cell: float) -> np.ndarray:
    """Order of points (n, 3) along Morton's curve through cells of size `cell`: neighbours in space become neighbours
    in memory, where the engine's bonds look for them."""
    cells = ((points - points.min(axis=0)) / cell).astype(np.int64)
    key = np.zeros(len(points), dtype=np.int64)
    for bit in range(20):
        for axis in range(3):
            key |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(key, kind="stable")
