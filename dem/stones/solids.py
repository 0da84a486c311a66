"""Solids: random convex polyhedra, and the surface in a mesh file; their volume, area, centre and moments.

A polyhedron is the convex hull of points on a sphere that repel each other a little, stretched so that its extents
along three axes are as 1 : elongation : elongation x flatness. All solids are kept with the volume of the unit sphere
and their centre of mass at the origin.

The surface in a file is closed and of triangles, and need not be convex. It is a container for packings.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.distance import cdist

from common.scene.stones import Shape, ShapeTable
from common.tables import InputError, refuse_unreadable

BLOCK = 1 << 20  # pairs of a point and a triangle that are looked at together
LEAST_CLEARANCE = 1e-9  # of the size
TINY = 1e-300  # in place of zero, for triangles and sides of no extent
SLOTS = 8      # nearest triangles that count as walls of a point, each by itself: corners are pressed from all sides
COUNTED = 1.7  # so many mean radii of sub-spheres away a triangle still counts; the nearest one always does
UNSURE = 0.5   # as near to the surface a centre may have come out of it


def winding_number(point: np.ndarray, corner: np.ndarray, triangle: np.ndarray) -> np.ndarray:
    """How often a closed surface goes round each point (n, 3): 1 inside, 0 outside. The sum of the solid angles of its
    triangles over 4 pi, each by A. van Oosterom and J. Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125."""
    turns = np.empty(len(point))
    for here in _blocks(len(point), len(triangle)):
        a, b, c = (corner[triangle[:, k]] - point[here, None] for k in range(3))
        la, lb, lc = (np.linalg.norm(side, axis=2) for side in (a, b, c))
        over = np.einsum("ptk,ptk->pt", a, np.cross(b, c))
        under = la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb
        turns[here] = np.arctan2(over, under).sum(axis=1) / (2 * np.pi)
    return turns


def nearest_points(point: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """The nearest point (m, 3) of each triangle a, b, c (m, 3) to each `point` (m, 3): that of the plane where it lies
    in the triangle, else the nearest one of its sides."""
    to_b, to_c, off = b - a, c - a, point - a
    bb, bc, cc, b_off, c_off = (_dot(*two) for two in (
        (to_b, to_b), (to_b, to_c), (to_c, to_c), (to_b, off), (to_c, off)))
    area2 = np.maximum(bb * cc - bc * bc, TINY)
    share_b, share_c = (cc * b_off - bc * c_off) / area2, (bb * c_off - bc * b_off) / area2
    foot = a + share_b[:, None] * to_b + share_c[:, None] * to_c
    on_sides = np.stack([_on_side(point, p, q) for p, q in ((a, b), (b, c), (c, a))])
    away = point - on_sides
    best = on_sides[_dot(away, away).argmin(axis=0), np.arange(len(point))]
    inside = (share_b >= 0) & (share_c >= 0) & (share_b + share_c <= 1)
    return np.where(inside[:, None], foot, best)


def _on_side(point: np.ndarray, p: np.ndarray, q: np.ndarray) -> np.ndarray:
    along = q - p
    share = np.clip(_dot(point - p, along) / np.maximum(_dot(along, along), TINY), 0, 1)
    return p + share[:, None] * along


def sides_of(triangle: np.ndarray) -> np.ndarray:
    """(3 t, 2) of triangles (t, 3), each from corner to corner as the triangle is turned."""
    return np.vstack([triangle[:, [0, 1]], triangle[:, [1, 2]], triangle[:, [2, 0]]])


def is_open(sides: np.ndarray) -> bool:
    """Does a side not belong to two triangles?"""
    return bool(np.any(np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)[1] != 2))


def fault_of(corner: np.ndarray, triangle: np.ndarray) -> str | None:
    """Why a closed surface of triangles bounds no solid, or None: they must all be turned the same way, and none may
    cut another one."""
    sides = sides_of(triangle)
    if len(np.unique(sides, axis=0)) < len(sides):
        return "must hold a closed surface whose triangles are all turned the same way"
    cut = _first_cut(corner, triangle, sides[sides[:, 0] < sides[:, 1]])
    if cut is not None:
        return "must not cut itself, as it does at (" + ", ".join(f"{x:.4g}" for x in cut) + ")"
    return None


def _first_cut(corner: np.ndarray, triangle: np.ndarray, side: np.ndarray) -> np.ndarray | None:
    """A point (3,) where a side passes through a triangle of which it has no corner."""
    size = np.ptp(corner, axis=0).max()
    low, high = corner[triangle].min(axis=1), corner[triangle].max(axis=1)
    a, normal = corner[triangle[:, 0]], np.cross(corner[triangle[:, 1]] - corner[triangle[:, 0]],
                                                 corner[triangle[:, 2]] - corner[triangle[:, 0]])
    for here in _blocks(len(side), len(triangle)):
        p, q = corner[side[here, 0]], corner[side[here, 1]]
        near = np.all((np.minimum(p, q)[:, None] <= high) & (np.maximum(p, q)[:, None] >= low), axis=2)
        near &= ~(side[here, None, :, None] == triangle[None, :, None, :]).any(axis=(2, 3))
        k, t = np.nonzero(near)
        start, end = (_dot(end[k] - a[t], normal[t]) for end in (p, q))
        least = LEAST_CLEARANCE * size * np.linalg.norm(normal[t], axis=1)
        through = (np.minimum(start, end) < -least) & (np.maximum(start, end) > least)
        k, t, share = k[through], t[through], (start / np.where(through, start - end, 1.0))[through]
        at = p[k] + share[:, None] * (q[k] - p[k])
        miss = np.linalg.norm(at - nearest_points(at, *(corner[triangle[t, m]] for m in range(3))), axis=1)
        if np.any(miss < LEAST_CLEARANCE * size):
            found: np.ndarray = at[miss.argmin()]
            return found
    return None


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("...k,...k->...", a, b)


def _blocks(rows: int, columns: int) -> list[slice]:
    step = max(1, BLOCK // max(1, columns))
    return [slice(k, k + step) for k in range(0, rows, step)]


@dataclass(frozen=True)
class MeshContainer:
    """A solid about the origin: its corners (c, 3) and triangles (t, 3), outward, as tuples; and its volume."""

    corners: tuple[tuple[float, float, float], ...]
    triangles: tuple[tuple[int, int, int], ...]
    volume_m3: float

    @cached_property
    def _corner(self) -> np.ndarray:
        return np.array(self.corners)

    @cached_property
    def _triangle(self) -> np.ndarray:
        return np.array(self.triangles)

    @cached_property
    def _spheres(self) -> tuple[np.ndarray, np.ndarray]:
        """Centres (t, 3) and radii (t,) of spheres that hold each triangle."""
        points = self._corner[self._triangle]
        center = points.mean(axis=1)
        return center, np.linalg.norm(points - center[:, None], axis=2).max(axis=1)

    @property
    def half_size_m(self) -> np.ndarray:
        half: np.ndarray = np.abs(self._corner).max(axis=0)
        return half

    def contains(self, x: np.ndarray) -> np.ndarray:
        """(n,) is each of the points x (n, 3) inside?"""
        return winding_number(x, self._corner, self._triangle) > 0.5

    def walls(self, x: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """The walls as seen from the centres x (n, 3) of sub-spheres that fill the solid: the nearest triangles, each
        with the distance to its nearest point and the direction from there. From a little outside there is the nearest
        one only, with a negative distance."""
        center, radius = self._spheres
        unit = (self.volume_m3 / (4 / 3 * np.pi * len(x))) ** (1 / 3)
        least = cdist(x, center) - radius
        nearest = (least + 2 * radius).min(axis=1)  # no triangle is nearest that begins beyond this
        point, t = np.nonzero(least <= np.maximum(nearest, COUNTED * unit)[:, None])
        off = x[point] - nearest_points(x[point], *(self._corner[self._triangle[t, k]] for k in range(3)))
        distance = np.sqrt(_dot(off, off))
        order = np.lexsort((distance, point))
        point, off, distance = point[order], off[order], distance[order]
        slot = np.arange(len(point)) - np.searchsorted(point, point)
        first = np.flatnonzero(slot == 0)
        unsure = point[first[distance[first] < UNSURE * unit]]
        outside = np.zeros(len(x), dtype=bool)
        outside[unsure] = ~self.contains(x[unsure])
        walls = []
        for k in range(min(SLOTS, slot.max() + 1)):
            d, normal = np.full(len(x), np.inf), np.zeros_like(x)
            here = slot == k
            at = point[here]
            sign = np.where(outside[at], -1.0, 1.0)
            d[at] = np.where(outside[at] & (k > 0), np.inf, sign * distance[here])
            normal[at] = (sign / np.maximum(distance[here], 1e-300))[:, None] * off[here]
            walls.append((d, normal))
        return walls

    def in_units(self, length_m: float) -> "MeshContainer":
        corners = tuple(map(tuple, (self._corner / length_m).tolist()))
        return MeshContainer(corners, self.triangles, self.volume_m3 / length_m**3)


SPREAD_TURNS = 5          # of the repulsion between the corners
CONVEX_TOLERANCE = 0.01   # of the size: the deepest dent of what is taken to be its hull
MOST_TRIANGLES = 5000     # of a solid that is not convex
MOST_BYTES = 200e6        # of a mesh file
DARTS = 2000              # that look for places round which a surface goes twice


@dataclass(frozen=True)
class Solid:
    """A solid of the volume of the unit sphere about its centre of mass: `corner` (c, 3), `triangle` (t, 3) of
    corners, outward `normal` (t, 3) and distance `offset` (t,) of each triangle's plane."""

    corner: np.ndarray
    triangle: np.ndarray
    normal: np.ndarray
    offset: np.ndarray
    is_convex: bool = True

    @property
    def reach(self) -> float:
        """Radius of the sphere about the centre that holds it."""
        return float(np.linalg.norm(self.corner, axis=1).max())

    @property
    def volume(self) -> float:
        """By the divergence theorem."""
        return float(moments(self.corner, self.triangle)[0])

    @property
    def second_moment(self) -> np.ndarray:
        """(3, 3) integral of x x^T over the volume."""
        return moments(self.corner, self.triangle)[2]


def moments(corner: np.ndarray, triangle: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Volume, first (3,) and second (3, 3) moment about the origin of a closed surface of triangles with outward
    normals. Each spans a tetrahedron with the origin, of volume det/6 and moments det/24 s and det/120 (sum x x^T +
    s s^T), s the sum of its corners."""
    points = corner[triangle]
    det = np.linalg.det(points)
    total = points.sum(axis=1)
    second = np.einsum("t,tki,tkj->ij", det, points, points) + np.einsum("t,ti,tj->ij", det, total, total)
    return float(det.sum() / 6), det @ total / 24, second / 120


@lru_cache(maxsize=4096)
def solid_of(shape: Shape, seed: int) -> Solid:
    """The solid of one stone. A file has one, whatever the seed. Raises InputError, which names the file."""
    return _from_file(Path(shape)) if isinstance(shape, str) else polyhedron(shape, seed)


def polyhedron(shape: ShapeTable, seed: int) -> Solid:
    corners = shape.corners
    rng = np.random.default_rng([seed, corners])
    point = rng.normal(size=(corners, 3))
    point /= np.linalg.norm(point, axis=1)[:, None]
    for _ in range(SPREAD_TURNS):  # else slivers
        away = point[:, None] - point[None]
        distance2 = (away**2).sum(axis=2) + np.eye(corners)
        point += 0.3 / corners**0.5 * (away / distance2[..., None] ** 1.5).sum(axis=1) / corners
        point /= np.linalg.norm(point, axis=1)[:, None]
    point *= np.cumprod([1.0, *shape.extent_ratios]) / np.ptp(point, axis=0)
    return _centred(point)


def _centred(point: np.ndarray) -> Solid:
    """The convex hull of points (n, 3), moved and scaled."""
    hull = ConvexHull(point)
    index = np.full(len(point), -1)
    index[hull.vertices] = np.arange(len(hull.vertices))
    corner, triangle = point[hull.vertices], index[hull.simplices]
    normal = hull.equations[:, :3]
    inward = np.einsum("ti,ti->t", np.cross(corner[triangle[:, 1]] - corner[triangle[:, 0]],
                                            corner[triangle[:, 2]] - corner[triangle[:, 0]]), normal) < 0
    triangle[inward] = triangle[inward][:, ::-1]
    volume, first, _ = moments(corner, triangle)
    return _scaled(corner, triangle, normal, volume, first, True)


def _scaled(corner: np.ndarray, triangle: np.ndarray, normal: np.ndarray, volume: float, first: np.ndarray,
            is_convex: bool) -> Solid:
    size = (4 / 3 * np.pi / volume) ** (1 / 3)
    corner = size * (corner - first / volume)
    return Solid(corner, triangle, normal, np.einsum("ti,ti->t", normal, corner[triangle[:, 0]]), is_convex)


def _from_file(file: Path) -> Solid:
    """Raises InputError for a file that cannot be read or holds no closed surface of triangles."""
    import meshio  # late: most stones are of no mesh, and it takes a third as long to import as numpy and scipy

    refuse_unreadable(file, MOST_BYTES)
    try:
        with np.errstate(over="ignore"):  # meshio's test of whether an STL file is text
            mesh = meshio.read(file)
    except (Exception, SystemExit) as error:  # meshio ends the process for what it cannot read
        said = (str(error).splitlines() or [type(error).__name__])[0]
        raise InputError(f"{file}: cannot be read as a mesh: {said}") from None
    triangle = mesh.cells_dict.get("triangle")
    if triangle is None or len(triangle) < 4 or not np.all(np.isfinite(mesh.points)):
        raise InputError(f"{file}: must hold a closed surface of triangles")
    point, same = np.unique(np.round(mesh.points, 12), axis=0, return_inverse=True)
    triangle = same.ravel()[triangle]
    if is_open(sides_of(triangle)):
        raise InputError(f"{file}: must hold a closed surface: an edge does not belong to two triangles")
    try:
        hull = ConvexHull(point)
    except QhullError:
        raise InputError(f"{file}: must hold a solid: its points lie in a plane") from None
    # Wherever the triangles' normals point: those of a convex surface lie on its hull.
    centres = np.vstack([point, point[triangle].mean(axis=1)])
    inside_m = -(centres @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1).min()
    return _with_dents(file, point, triangle) if inside_m > CONVEX_TOLERANCE * np.ptp(point, axis=0).max() else (
        _centred(point))


def _with_dents(file: Path, point: np.ndarray, triangle: np.ndarray) -> Solid:
    """A solid that is not convex. Raises InputError where the surface bounds none."""
    if len(triangle) > MOST_TRIANGLES:
        raise InputError(f"{file}: holds {len(triangle)} triangles: must be at most {MOST_TRIANGLES} where the surface "
                         "is not convex")
    fault = fault_of(point, triangle)
    if fault is not None:
        raise InputError(f"{file}: {fault}")
    if moments(point, triangle)[0] < 0:
        triangle = triangle[:, ::-1]
    dart = np.random.default_rng(1).uniform(point.min(axis=0), point.max(axis=0), (DARTS, 3))
    turns = np.round(winding_number(dart, point, triangle))
    if turns.min() < 0 or turns.max() > 1:
        times = turns.max() if turns.max() > 1 else turns.min()
        raise InputError(f"{file}: must bound one solid: its surface goes {times:g} times round some of it")
    volume, first, _ = moments(point, triangle)
    normal = np.cross(point[triangle[:, 1]] - point[triangle[:, 0]], point[triangle[:, 2]] - point[triangle[:, 0]])
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    return _scaled(point, triangle, normal, volume, first, False)
