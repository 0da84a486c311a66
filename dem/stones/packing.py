"""Random dense packings of sub-spheres inside a sphere or a cylinder, and the touching fcc sphere.

The packing is a jammed state found by energy minimisation. Sub-spheres of fixed proportions repel each other and the
wall like soft springs, and all of them swell together by one scale s under a constant pressure p:

    H(x, s) = 1/2 sum over pairs and walls of (1 - d/(s sigma))_+^2 - p n ln s

(sigma the sum of the two radii, or the one radius at a wall, at s = 1). At the minimum the mean overlap is about p/3,
so lowering p step by step leads to the random close packing from above, as in C. S. O'Hern et al., Phys. Rev. E 68
(2003) 011306; the minimiser is FIRE, E. Bitzek et al., Phys. Rev. Lett. 97 (2006) 170201. See docs/stones.md.

Packings are kept for every later run (common/files/cache.py): one takes a third of a second to find and a few
milliseconds to read. It is the same bit by bit for the same radius, number, seed and code; so is what a run makes of
it.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from common.files.cache import cached, key_of
from dem.stones.solids import MeshContainer, Solid

OVERLAP_TOLERANCE = 1e-3  # largest overlap of the result, relative to the sum of the two radii
SIZE_RATIO = 1.5  # of the largest radius to the smallest; radii are evenly spread between
PRESSURES = (1e-1, 1e-2, 1e-3, 3e-4)
SKIN = 0.3  # of the neighbour list, in mean radii
TOUCHING = 5e-3  # gap below which sub-spheres count as touching, relative to the sum of their radii (a wall has none)

# Distances of points from a curved wall (n,) or from f flat ones (n, f), and the inward normals (n, 3) or (f, 3).
Walls = list[tuple[np.ndarray, np.ndarray]]
REFERENCE_RADIUS_m = 0.025  # with which a packing is kept; all sizes are alike


@dataclass(frozen=True)
class SphereContainer:
    """A sphere about the origin; what it says of its methods holds for all containers."""

    radius_m: float

    @property
    def volume_m3(self) -> float:
        return 4 / 3 * np.pi * self.radius_m**3

    @property
    def half_size_m(self) -> np.ndarray:
        """(3,) half of the extent along x, y, z."""
        return np.full(3, self.radius_m)

    def walls(self, x: np.ndarray) -> Walls:
        """The walls as seen from points x (n, 3)."""
        r = np.sqrt((x**2).sum(1))
        return [(self.radius_m - r, -x / np.maximum(r, 1e-300)[:, None])]

    def in_units(self, length_m: float) -> "SphereContainer":
        """The same in units of `length_m`."""
        return SphereContainer(self.radius_m / length_m)


@dataclass(frozen=True)
class CylinderContainer:
    """Axis along z, from -length/2 to length/2."""

    radius_m: float
    length_m: float

    @property
    def volume_m3(self) -> float:
        return np.pi * self.radius_m**2 * self.length_m

    @property
    def half_size_m(self) -> np.ndarray:
        return np.array([self.radius_m, self.radius_m, self.length_m / 2])

    def walls(self, x: np.ndarray) -> Walls:
        r = np.sqrt((x[:, :2] ** 2).sum(1))
        side = np.zeros_like(x)
        side[:, :2] = -x[:, :2] / np.maximum(r, 1e-300)[:, None]
        ends = np.column_stack([self.length_m / 2 + x[:, 2], self.length_m / 2 - x[:, 2]])
        return [(self.radius_m - r, side), (ends, np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]))]

    def in_units(self, length_m: float) -> "CylinderContainer":
        return CylinderContainer(self.radius_m / length_m, self.length_m / length_m)


@dataclass(frozen=True)
class ConvexContainer:
    """A convex solid about the origin: rows of outward normal (3) and distance from the origin of its faces, and its
    volume."""

    faces: tuple[tuple[float, float, float, float], ...]
    extent_m: tuple[float, float, float]  # largest |x|, |y|, |z|
    volume_m3: float

    @property
    def half_size_m(self) -> np.ndarray:
        return np.array(self.extent_m)

    def walls(self, x: np.ndarray) -> Walls:
        normal, offset_m = self._planes
        return [(offset_m - x @ normal.T, -normal)]

    @cached_property
    def _planes(self) -> tuple[np.ndarray, np.ndarray]:
        """Normals (f, 3) and distances (f,) of the faces."""
        faces = np.array(self.faces)
        return faces[:, :3], faces[:, 3]

    def in_units(self, length_m: float) -> "ConvexContainer":
        faces = tuple((a, b, c, d / length_m) for a, b, c, d in self.faces)
        x, y, z = self.extent_m
        return ConvexContainer(faces, (x / length_m, y / length_m, z / length_m), self.volume_m3 / length_m**3)


Container = SphereContainer | CylinderContainer | ConvexContainer | MeshContainer


@dataclass(frozen=True)
class Packing:
    """n sub-spheres in a container about the origin: `center_m` (n, 3), `radius_m` (n,), the bonding radii."""

    center_m: np.ndarray
    radius_m: np.ndarray
    container: Container

    @property
    def wall_gap_m(self) -> np.ndarray:
        """(n,) distance of each sub-sphere to the nearest wall, negative where it sticks out."""
        return _wall_distances(self.container, self.center_m).min(axis=1) - self.radius_m


def pack_sphere(radius_m: float, count: int, seed: int) -> Packing:
    """`pack` in a sphere, turned so that sub-spheres touch both poles (z = -radius_m to the overlap tolerance,
    z = +radius_m nearly)."""
    packing = pack(SphereContainer(radius_m), count, seed)
    return packing if count == 1 else replace(packing, center_m=_touch_the_poles(packing))


def near_pairs(center_m: np.ndarray, radius_m: np.ndarray, gap_tolerance: float) -> np.ndarray:
    """(m, 2) pairs i < j, sorted, with a gap of at most `gap_tolerance` times the sum of the two radii."""
    reach = 2 * radius_m.max() * (1 + gap_tolerance)
    i, j = cKDTree(center_m).query_pairs(reach, output_type="ndarray").T
    distance = np.linalg.norm(center_m[j] - center_m[i], axis=1)
    near = distance <= (1 + gap_tolerance) * (radius_m[i] + radius_m[j])
    pairs = np.column_stack([np.minimum(i, j), np.maximum(i, j)])[near]
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


def pack(container: Container, count: int, seed: int) -> Packing:
    """A random dense packing of `count` sub-spheres in a container; one of them fills it.

    The same arguments give the same packing on the same kind of machine and library versions; elsewhere round-off leads
    to another packing of the same quality. Raises ValueError for a size that is not positive or a count below 1.
    """
    if not np.all(np.isfinite(container.half_size_m) & (container.half_size_m > 0)):
        raise ValueError(f"the size of {container} must be positive")
    if count < 1:
        raise ValueError(f"count = {count}: must be at least 1")
    if count == 1:
        return Packing(np.zeros((1, 3)), np.array([container.half_size_m.min()]), container)
    # First by the largest size, so that a packing does not depend on its size even in round-off; then in units of the
    # radius with which `count` equal sub-spheres would fill the container's whole volume.
    size_m = float(container.half_size_m.max())
    shape = container.in_units(size_m)
    unit = (shape.volume_m3 / (4 / 3 * np.pi * count)) ** (1 / 3)
    rng = np.random.default_rng(seed)
    size = rng.permutation(np.linspace(1.0, SIZE_RATIO, count))
    swelling = _Swelling(shape.in_units(unit), size / (size**3).mean() ** (1 / 3), rng)
    for pressure in PRESSURES:
        swelling.minimise(pressure)
    center, radius = swelling.result()
    return Packing(center * unit * size_m, radius * unit * size_m, container)


class _Swelling:
    """The state of the minimisation: centres x, scale s of the radii, neighbour list."""

    def __init__(self, container: Container, size: np.ndarray, rng: np.random.Generator):
        self.container, self.size, self.n = container, size, len(size)
        self.scale = 0.5
        self.x = _random_points(container, self.n, rng)
        self._list_neighbours()

    def _list_neighbours(self) -> None:
        radius = self.scale * self.size
        i, j = cKDTree(self.x).query_pairs(2 * radius.max() + SKIN, output_type="ndarray").T
        near = np.sqrt(((self.x[j] - self.x[i]) ** 2).sum(1)) < radius[i] + radius[j] + SKIN
        self.i, self.j = i[near], j[near]
        self.sigma = self.size[self.i] + self.size[self.j]
        self.listed_x, self.listed_scale = self.x.copy(), self.scale

    def _refresh_neighbours(self) -> None:
        way = self.x - self.listed_x
        moved = np.sqrt(np.einsum("ik,ik->i", way, way).max())
        swollen = (self.scale - self.listed_scale) * self.size.max()
        if 2 * (moved + swollen) > SKIN:
            self._list_neighbours()

    def forces(self, pressure: float) -> tuple[np.ndarray, float]:
        """-dH/dx (n, 3) and -dH/d(ln s)."""
        self._refresh_neighbours()
        x = np.ascontiguousarray(self.x.T)
        branch = x.take(self.j, axis=1)
        branch -= x.take(self.i, axis=1)
        distance = np.sqrt((branch**2).sum(0))
        touching = np.flatnonzero(distance < self.scale * self.sigma)
        i, j, distance, sigma = (one.take(touching) for one in (self.i, self.j, distance, self.sigma))
        sigma *= self.scale
        overlap = 1 - distance / sigma
        push = branch.take(touching, axis=1)
        push *= overlap / (sigma * distance)
        force = np.zeros_like(self.x)
        for k, along in enumerate(push):
            force[:, k] += np.bincount(j, along, self.n) - np.bincount(i, along, self.n)
        squeeze = (overlap * (1 - overlap)).sum()
        radius = self.scale * self.size
        for distance, normal in self.container.walls(self.x):
            overlap = np.maximum(1 - distance.T / radius, 0.0)
            push = (overlap / radius).T
            force += push @ normal if push.ndim == 2 else push[:, None] * normal
            squeeze += (overlap * (1 - overlap)).sum()
        return force, pressure * self.n - squeeze

    def minimise(self, pressure: float, tolerance: float = 0.02, max_steps: int = 20000) -> None:
        """FIRE until the rms force on a sub-sphere is below `tolerance` times the pressure."""
        dt, dt_max, mixing, uphill_free = 0.1, 1.0, 0.1, 0
        v, v_scale = np.zeros_like(self.x), 0.0
        for _ in range(max_steps):
            f, f_scale = self.forces(pressure)
            ff = (f**2).sum() + f_scale**2 / self.n
            if ff < self.n * (tolerance * pressure) ** 2:
                return
            power = (f * v).sum() + f_scale * v_scale
            if power > 0:
                blend = mixing * np.sqrt(((v**2).sum() + self.n * v_scale**2) / ff)
                v = (1 - mixing) * v + blend * f
                v_scale = (1 - mixing) * v_scale + blend * f_scale / self.n
                uphill_free += 1
                if uphill_free > 5:
                    dt, mixing = min(1.1 * dt, dt_max), 0.99 * mixing
            else:
                v, v_scale, uphill_free = np.zeros_like(v), 0.0, 0
                dt, mixing = 0.5 * dt, 0.1
            v += dt * f
            v_scale += dt * f_scale / self.n
            self.x = self.x + dt * v
            self.scale *= np.exp(dt * v_scale)
        raise RuntimeError("the packing did not come to rest")

    def result(self) -> tuple[np.ndarray, np.ndarray]:
        """Centres and radii, shrunk a last time where an overlap is above the tolerance."""
        radius = self.scale * self.size
        i, j = near_pairs(self.x, radius, 0.0).T
        distance = np.sqrt(((self.x[j] - self.x[i]) ** 2).sum(1))
        clear = min((distance / (radius[i] + radius[j])).min(initial=1.0),
                    (_wall_distances(self.container, self.x).T / radius).min())
        return self.x, radius * min(1.0, clear / (1 - OVERLAP_TOLERANCE))


def _wall_distances(container: Container, x: np.ndarray) -> np.ndarray:
    """Of points x (n, 3) from all walls, (n, walls)."""
    return np.column_stack([distance for distance, _ in container.walls(x)])


def _random_points(container: Container, count: int, rng: np.random.Generator) -> np.ndarray:
    points = np.zeros((0, 3))
    while len(points) < count:
        x = rng.uniform(-1, 1, (2 * count, 3)) * container.half_size_m
        inside = container.contains(x) if isinstance(container, MeshContainer) else (
            _wall_distances(container, x) > 0).all(axis=1)
        points = np.vstack([points, x[inside]])
    return points[:count]


def _touch_the_poles(packing: Packing) -> np.ndarray:
    """Centres turned so that one sub-sphere touches the lowest point and its best antipode nearly the highest.

    Any turn leaves a random packing random; this one makes the height of every stone the container's diameter.
    """
    at_wall = np.flatnonzero(packing.wall_gap_m < TOUCHING * packing.radius_m)
    direction = packing.center_m[at_wall]
    direction = direction / np.linalg.norm(direction, axis=1)[:, None]
    down, up = np.unravel_index(np.argmin(direction @ direction.T), (len(at_wall), len(at_wall)))
    turn, _ = Rotation.align_vectors([[0, 0, -1], [0, 0, 1]], direction[[down, up]], weights=[np.inf, 1])
    return turn.apply(packing.center_m)


def packed(solid: Solid | None, count: int, seed: int, cache_dir: Path | None) -> Packing:
    """In a solid of the volume of the reference sphere, or as `pack_sphere` in that sphere itself; from `cache_dir`
    if it is there. Without a directory it is packed."""
    container: Container = SphereContainer(REFERENCE_RADIUS_m) if solid is None else (
        container_of(solid).in_units(1 / REFERENCE_RADIUS_m))

    def find() -> dict[str, np.ndarray]:
        packing = pack_sphere(REFERENCE_RADIUS_m, count, seed) if solid is None else pack(container, count, seed)
        return {"center_m": packing.center_m, "radius_m": packing.radius_m}

    kept = cached(cache_dir, "packing", key_of(Path(__file__), container, count, seed), find)
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
