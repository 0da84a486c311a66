"""All sub-spheres and bonds of a scene, ready for the deck."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from common.files.cache import BeingFound, not_waiting
from common.scene.scene import Scene
from common.scene.stones import SPHERE, Shape
from common.tables import Refused
from dem.stones.bonds import Bonds, bond_network
from dem.stones.contact_patch import FaceColumns, StoneSurface, faces_of, surface_of
from dem.stones.packing import Packing, REFERENCE_RADIUS_m, SphereContainer, packed, scaled_packing
from dem.stones.solids import MeshContainer, Solid, solid_of
from dem.stones.stone import UPRIGHT, Entry, Stone, Substance, entry_of, flaw_factors, impact_speed_m_s

# A sub-sphere is drawn in by this factor against its radius in the packing, so that a bonded pair has no contact
# before its bond breaks: no stiffness counted twice. Its density makes up for the mass.
CONTACT_RADIUS_RATIO = 0.975
LEAST_SHARE = 0.2  # of a sub-sphere's mass over what its volume would give it, in a stone that is no sphere


@dataclass(frozen=True)
class Assembly:
    """What falls: the `stones`, gravity (3,) in the frame of the plate, and their n sub-spheres and m bonds where each
    stone enters.

    `center_m` (n, 3), `radius_m` (n,) of contact, `mass_kg` (n,), `substance` (n,) index into `substances`,
    `agglomerate` (n,) 0-based and ascending; `bond_first`, `bond_second` (m,) 0-based sub-spheres, `bond_vector_m`
    (m, 3) from first to second, `bond_radius_m` (m,), all in the undeformed state; `bond_strength_factor` (m,) on both
    strengths of the material. `surfaces`: of each agglomerate where stones touch as smooth bodies, else empty; `faces`:
    of each where stones touch with their faces, else empty.
    `is_of_stream`: the scene has a stream, even if all of its stones are there from the start.
    """

    stones: tuple[Stone, ...]
    gravity_m_s2: tuple[float, float, float]
    substances: list[Substance]
    center_m: np.ndarray
    radius_m: np.ndarray
    mass_kg: np.ndarray
    substance: np.ndarray
    agglomerate: np.ndarray
    bond_first: np.ndarray
    bond_second: np.ndarray
    bond_vector_m: np.ndarray
    bond_radius_m: np.ndarray
    bond_strength_factor: np.ndarray
    surfaces: tuple[StoneSurface, ...] = ()
    faces: tuple[FaceColumns | None, ...] = ()
    is_of_stream: bool = False

    @property
    def n_particles(self) -> int:
        return len(self.radius_m)

    @property
    def n_bonds(self) -> int:
        return len(self.bond_first)

    @property
    def bond_substance(self) -> np.ndarray:
        """(m,) index into `substances` of each bond."""
        return self.substance[self.bond_first]

    @property
    def sizes(self) -> np.ndarray:
        """Number of sub-spheres of each agglomerate."""
        return np.bincount(self.agglomerate)

    @property
    def stone_materials(self) -> list[str]:
        return [stone.material for stone in self.stones]

    @property
    def stone_mass_kg(self) -> np.ndarray:
        """(stones,)."""
        return np.bincount(self.agglomerate, self.mass_kg)

    @property
    def mass_height_kg_m(self) -> np.ndarray:
        """(stones,) sum of mass times height, against gravity, of the sub-spheres where each stone enters."""
        return np.bincount(self.agglomerate, self.mass_kg * (self.center_m @ np.array(self.up)))

    @property
    def up(self) -> tuple[float, float, float]:
        """Unit vector against gravity, that of z where there is none."""
        size = math.hypot(*self.gravity_m_s2)
        x, y, z = (-g / size for g in self.gravity_m_s2) if size > 0 else (0.0, 0.0, 1.0)
        return x, y, z

    @property
    def is_stream(self) -> bool:
        """Do stones enter later than at the start, so that the engine takes them in and lets them go?"""
        return self.is_of_stream or any(entry.is_late for entry in self.entries)

    @cached_property
    def entries(self) -> tuple[Entry, ...]:
        """When, where and how fast each stone enters."""
        return tuple(entry_of(stone, self.gravity_m_s2) for stone in self.stones)

    @property
    def kinetic_start_J(self) -> np.ndarray:
        """(stones,) when each enters: of its flight, and of its spin where it has one."""
        speed2 = np.array([math.hypot(*entry.velocity_m_s) ** 2 for entry in self.entries])
        flight = 0.5 * self.stone_mass_kg * speed2
        if not self.spins:
            return flight
        velocity, omega = self.start_motion()
        speed2, spin2 = (velocity**2).sum(axis=1), (omega**2).sum(axis=1)
        return np.bincount(self.agglomerate, self.mass_kg * (speed2 / 2 + self.radius_m**2 * spin2 / 5))

    @property
    def spins(self) -> bool:
        """Does any stone spin when it enters?"""
        return any(any(stone.spin_rad_s) for stone in self.stones)

    def start_motion(self) -> tuple[np.ndarray, np.ndarray]:
        """Velocity and spin (n, 3) of each sub-sphere when its stone enters."""
        velocity = np.array([entry.velocity_m_s for entry in self.entries])[self.agglomerate]
        omega = np.array([stone.spin_rad_s for stone in self.stones])[self.agglomerate]
        center = np.column_stack([np.bincount(self.agglomerate, self.mass_kg * self.center_m[:, k]) for k in range(3)])
        arm = self.center_m - (center / self.stone_mass_kg[:, None])[self.agglomerate]
        return velocity + np.cross(omega, arm), omega

    @property
    def momentum_start_kg_m_s(self) -> np.ndarray:
        """(stones, 3) when each enters."""
        return self.stone_mass_kg[:, None] * np.array([entry.velocity_m_s for entry in self.entries])

    @property
    def impact_speed_m_s(self) -> float:
        """The fastest with which a stone arrives."""
        return max(impact_speed_m_s(stone, self.gravity_m_s2) for stone in self.stones)


@dataclass(frozen=True)
class StoneParts:
    """One stone where it enters: its n sub-spheres and its m bonds, as in `Assembly`, numbered from 0;
    `strength_factor` (m,)."""

    center_m: np.ndarray
    radius_m: np.ndarray
    mass_kg: np.ndarray
    bonds: Bonds
    strength_factor: np.ndarray
    surface: StoneSurface | None
    faces: FaceColumns | None = None


def stone_parts(scene: Scene, stone: Stone, cache_dir: Path | None = None) -> StoneParts:
    """Pack a stone and set it where it enters, its lowest point on the plate when it has come down.

    Packings come from the cache in `cache_dir`, if that is given. Raises Refused, a key of `stones.agglomerate`,
    where sub-spheres are too few for a smooth contact.
    """
    one = _at_reference_size(scene, stone, cache_dir).scaled(stone.radius_m)
    strength = stone.strength_factor * _flaws(stone, one.packing, one.bonds)
    if stone.attitude != UPRIGHT and len(one.bonds):
        one = one.turned(stone.attitude)
    packing, network, surface, faces = one.packing, one.bonds, one.surface, one.faces
    radius = CONTACT_RADIUS_RATIO * packing.radius_m if len(network) else packing.radius_m
    lowest = (packing.center_m[:, 2] - radius).min() if surface is None else -stone.radius_m
    if faces is not None:
        lowest = min(lowest, faces.lowest_m(packing.center_m))
    x, y, height = entry_of(stone, scene.gravity_vector_m_s2).offset_m
    center = packing.center_m + [stone.place_m[0] + x, stone.place_m[1] + y, height - lowest]
    volume = radius**3
    share = stone.mass_kg * volume / volume.sum() if one.mass_share is None else stone.mass_kg * one.mass_share
    return StoneParts(center, radius, share, network, strength, surface, faces)


def _flaws(stone: Stone, packing: Packing, network: Bonds) -> np.ndarray:
    """(m,) factors on the strengths of the bonds of a stone that is not turned yet."""
    if not len(network):
        return np.ones(0)
    bond = stone.substance.bond
    seed = stone.seed if stone.flaw_seed is None else stone.flaw_seed
    return flaw_factors(bond.flaw_modulus, bond.flaw_length_m, seed,
                        packing.center_m[network.first] + network.vector_m / 2)


def _all_parts(scene: Scene, stones: Sequence[Stone], cache_dir: Path | None,
               meanwhile: Callable[[], None]) -> list[StoneParts]:
    """The parts of each stone. Where another process packs a stone, this one goes on with the next and comes back."""
    parts, left = dict[int, StoneParts](), list[int]()
    for k, stone in enumerate(stones):
        try:
            with not_waiting():
                parts[k] = stone_parts(scene, stone, cache_dir)
        except BeingFound:
            if not left:
                meanwhile()
            left.append(k)
    return [parts[k] if k in parts else stone_parts(scene, stone, cache_dir) for k, stone in enumerate(stones)]


def assemble(scene: Scene, stones: Sequence[Stone], cache_dir: Path | None = None,
             meanwhile: Callable[[], None] = lambda: None) -> Assembly:
    """Pack each stone and set it where it enters. Where another process is packing one of them, `meanwhile` is done
    once, and then the others. Raises Refused as `stone_parts` does."""
    substances = sorted({stone.substance for stone in stones})  # LIGGGHTS wants types without gaps
    parts = _all_parts(scene, stones, cache_dir, meanwhile)
    sizes = [len(p.radius_m) for p in parts]
    first = np.cumsum([0, *sizes])
    return Assembly(
        stones=tuple(stones),
        gravity_m_s2=scene.gravity_vector_m_s2,
        substances=substances,
        center_m=np.vstack([p.center_m for p in parts]),
        radius_m=np.concatenate([p.radius_m for p in parts]),
        mass_kg=np.concatenate([p.mass_kg for p in parts]),
        substance=np.repeat([substances.index(stone.substance) for stone in stones], sizes),
        agglomerate=np.repeat(np.arange(len(parts)), sizes),
        bond_first=np.concatenate([p.bonds.first + f for p, f in zip(parts, first)]),
        bond_second=np.concatenate([p.bonds.second + f for p, f in zip(parts, first)]),
        bond_vector_m=np.vstack([p.bonds.vector_m for p in parts]),
        bond_radius_m=np.concatenate([p.bonds.radius_m for p in parts]),
        bond_strength_factor=np.concatenate([p.strength_factor for p in parts]),
        surfaces=tuple(p.surface for p in parts if p.surface is not None),
        faces=tuple(p.faces for p in parts) if any(p.faces is not None for p in parts) else (),
        is_of_stream=scene.stones.is_stream,
    )


@dataclass(frozen=True)
class _StoneAlone:
    """A stone about its own centre: packing, bonds, and its surface where it touches smoothly."""

    packing: Packing
    bonds: Bonds
    surface: StoneSurface | None
    mass_share: np.ndarray | None = None  # (n,) of the stone's mass; None: by volume
    faces: FaceColumns | None = None      # where it touches with them

    def scaled(self, radius_m: float) -> "_StoneAlone":
        """From the size that is kept. A bond network of one material is the softer, the smaller it is."""
        size, surface, faces = radius_m / REFERENCE_RADIUS_m, self.surface, self.faces
        bonds = replace(self.bonds, vector_m=size * self.bonds.vector_m, radius_m=size * self.bonds.radius_m)
        if surface is not None:
            surface = replace(surface.scaled(1 / size), place_m=size * surface.place_m)
        return _StoneAlone(scaled_packing(self.packing, radius_m), bonds, surface, self.mass_share,
                           None if faces is None else faces.scaled(size))

    def turned(self, attitude: tuple[float, float, float, float]) -> "_StoneAlone":
        """By a quaternion (w, x, y, z). The patch about its new lowest point has the mean compliance of patches
        elsewhere."""
        matrix = np.asarray(Rotation.from_quat(np.roll(attitude, -1)).as_matrix())
        surface, faces = self.surface, self.faces
        packing = replace(self.packing, center_m=self.packing.center_m @ matrix.T)
        if surface is not None:
            surface = replace(surface, place_m=packing.center_m, compliance_m_N=surface.compliance_m_N[[1, 1]])
        return _StoneAlone(packing, replace(self.bonds, vector_m=self.bonds.vector_m @ matrix.T), surface,
                           self.mass_share, None if faces is None else faces.turned(matrix))


def _at_reference_size(scene: Scene, stone: Stone, cache_dir: Path | None) -> _StoneAlone:
    """What the stone is made of; an unbonded sphere has no bonds."""
    table = scene.stones.agglomerate
    if table is None:
        none, radius = np.zeros(0, dtype=int), REFERENCE_RADIUS_m
        one = Packing(np.zeros((1, 3)), np.array([radius]), SphereContainer(radius))
        return _StoneAlone(one, Bonds(none, none, np.zeros((0, 3)), np.zeros(0)), None)
    if stone.shape != SPHERE:
        shape = scene.shapes[stone.shape]
        packing, network = _packed(table.subspheres, stone.seed, cache_dir, shape)
        faces = _faces(table.subspheres, stone.seed, cache_dir, shape) if table.contact == "faces" else None
        return _StoneAlone(packing, network, None, mass_shares(packing, solid_of(shape, stone.seed)), faces)
    packing, network = _packed(table.subspheres, stone.seed, cache_dir, None)
    surface = _surface(packing, network, stone, cache_dir) if scene.has_smooth_contact else None
    return _StoneAlone(packing, network, surface)


@lru_cache(maxsize=128)
def _packed(subspheres: int, seed: int, cache_dir: Path | None, shape: Shape | None) -> tuple[Packing, Bonds]:
    packing = packed(None if shape is None else solid_of(shape, seed), subspheres, seed, cache_dir)
    order = _along_z_curve(packing.center_m, 2 * packing.radius_m.max())
    packing = replace(packing, center_m=packing.center_m[order], radius_m=packing.radius_m[order])
    if shape is None:  # the sphere that it stands for is about its centre of mass: no push on it turns the stone
        share = packing.radius_m**3 / (packing.radius_m**3).sum()
        packing = replace(packing, center_m=packing.center_m - share @ packing.center_m)
        return packing, bond_network(packing)
    if isinstance(packing.container, MeshContainer) and not packing.container.contains(packing.center_m).all():
        raise Refused("subspheres", subspheres, "must be more, so that they stay within the surface of their shape")
    try:
        return packing, bond_network(packing)
    except ValueError:
        raise Refused("subspheres", subspheres, "must be more, so that bonds hold all parts of their shape together"
                      ) from None


@lru_cache(maxsize=128)
def _faces(subspheres: int, seed: int, cache_dir: Path | None, shape: Shape) -> FaceColumns:
    packing, _ = _packed(subspheres, seed, cache_dir, shape)
    return faces_of(packing, solid_of(shape, seed), REFERENCE_RADIUS_m, cache_dir)


def mass_shares(packing: Packing, solid: Solid) -> np.ndarray:
    """Shares (n,) of the mass such that a packing has the centre of mass and the inertia of its solid exactly. Of all
    that have, they are nearest to the volumes v_i by entropy: w_i = v_i exp(sum of multipliers x moments), with the
    multipliers by Newton's method. Raises Refused where the packing is so coarse that a share would be very small."""
    x, r = packing.center_m / REFERENCE_RADIUS_m, CONTACT_RADIUS_RATIO * packing.radius_m / REFERENCE_RADIUS_m
    volume = r**3 / (r**3).sum()
    pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
    second = np.column_stack([x[:, i] * x[:, j] + (r**2 / 5 if i == j else 0) for i, j in pairs])
    rows = np.column_stack([np.ones(len(r)), x, second])
    wanted = np.array([1.0, 0.0, 0.0, 0.0, *(solid.second_moment[i, j] / solid.volume for i, j in pairs)])
    multiplier, share = np.zeros(rows.shape[1]), volume
    for _ in range(50):
        miss = wanted - rows.T @ share
        if np.abs(miss).max() < 1e-13:
            break
        multiplier = multiplier + np.linalg.solve((rows * share[:, None]).T @ rows, miss)
        share = volume * np.exp(np.clip(rows @ multiplier, -20, 20))
    if not (np.abs(miss).max() < 1e-9 and np.all(share > LEAST_SHARE * volume)):
        raise Refused("subspheres", len(r), "must be more, so that they can have the inertia of their shape")
    return share


def _surface(packing: Packing, network: Bonds, stone: Stone, cache_dir: Path | None) -> StoneSurface:
    """Compliances go with 1/E, so that one that is kept serves all stones of a material."""
    bond = stone.substance.table.bond
    assert bond is not None
    try:
        return surface_of(packing, network, bond, cache_dir).scaled(1 / stone.substance.youngs_modulus_factor)
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
