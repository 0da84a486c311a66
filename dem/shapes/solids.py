"""Solids: random convex polyhedra, and the surface in a mesh file; their volume, area, centre and moments.

A polyhedron is the convex hull of points on a sphere that repel each other a little, stretched so that its extents
along three axes are as 1 : elongation : elongation x flatness. All solids are kept with the volume of the unit sphere
and their centre of mass at the origin.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from common.scene.stones import ShapeTable
from common.tables import InputError, refuse_unreadable
from dem.shapes.mesh import fault_of, is_open, sides_of, winding_number

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
def solid_of(shape: ShapeTable, seed: int) -> Solid:
    """The solid of one stone. A file has one, whatever the seed. Raises InputError, which names the file."""
    return _from_file(Path(shape.file)) if shape.file is not None else polyhedron(shape, seed)


def polyhedron(shape: ShapeTable, seed: int) -> Solid:
    """A random polyhedron."""
    corners = shape.corners
    rng = np.random.default_rng([seed, corners])
    point = rng.normal(size=(corners, 3))
    point /= np.linalg.norm(point, axis=1)[:, None]
    for _ in range(SPREAD_TURNS):  # else slivers
        away = point[:, None] - point[None]
        distance2 = (away**2).sum(axis=2) + np.eye(corners)
        point += 0.3 / corners**0.5 * (away / distance2[..., None] ** 1.5).sum(axis=1) / corners
        point /= np.linalg.norm(point, axis=1)[:, None]
    point *= np.array([1.0, shape.elongation, shape.elongation * shape.flatness]) / np.ptp(point, axis=0)
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
