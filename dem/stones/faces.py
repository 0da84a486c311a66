"""The flat faces of a stone, and the columns of rock between them and the sub-spheres behind them.

A face is what the triangles of one plane make. Sub-spheres whose gap to it is small lie behind it; each has the part of
its area that is nearer to it than to the others (by the power distance |x - c|^2 - r^2). The column of rock between
this part and the centre of the sub-sphere carries the contact of the face (docs/contact.md).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from dem.shapes.solids import Solid
from dem.stones.packing import Packing

BEHIND = 0.5      # of its radius: the gap of a sub-sphere that lies behind a face
FEWEST = 3        # sub-spheres behind a face; a plane with fewer is taken to be part of a curved surface
SPACING = 0.15    # of the mean radius of the sub-spheres: between the points that a face is measured by
SAME_PLANE = 1e-6
PARALLEL_rad = 0.005  # a face turned further from the plate's meets it with an edge or a corner; so in dem/engine


@dataclass(frozen=True)
class FaceColumns:
    """k columns: the `sub_sphere` (k,) behind each, the outward `normal` (k, 3) of its face, its `height_m` (k,) from
    the centre of the sub-sphere to the face, its `area_m2` (k,), and the radius (k,) of the circle of the whole face's
    area."""

    sub_sphere: np.ndarray
    normal: np.ndarray
    height_m: np.ndarray
    area_m2: np.ndarray
    face_radius_m: np.ndarray

    def scaled(self, size: float) -> FaceColumns:
        """Of the stone `size` times as large."""
        return replace(self, height_m=size * self.height_m, area_m2=size**2 * self.area_m2,
                       face_radius_m=size * self.face_radius_m)

    def turned(self, matrix: np.ndarray) -> FaceColumns:
        """Of the stone turned by the matrix (3, 3)."""
        return replace(self, normal=self.normal @ matrix.T)

    def lowest_m(self, center_m: np.ndarray) -> float:
        """Least height of a face that is parallel to the plate; `center_m` (n, 3) of all sub-spheres."""
        parallel = -self.normal[:, 2] > np.cos(PARALLEL_rad)
        return float((center_m[self.sub_sphere, 2] - self.height_m)[parallel].min(initial=np.inf))


def face_columns(packing: Packing, solid: Solid, size_m: float) -> FaceColumns:
    """Of a packing in a solid that is `size_m` times as large as that of the unit sphere's volume. Sorted by
    sub-sphere."""
    plane, corners = _planes(solid)
    rows = [_behind(packing, plane[k], size_m * corners[k]) for k in range(len(plane))]
    index, normal, height, area, radius = (np.concatenate(column) for column in zip(*rows, strict=True))
    order = np.argsort(index, kind="stable")
    return FaceColumns(index[order], normal[order], height[order], area[order], radius[order])


def _planes(solid: Solid) -> tuple[np.ndarray, list[np.ndarray]]:
    """Outward normals (p, 3), and of each plane the corners (t, 3, 3) of its triangles."""
    key = np.round(np.column_stack([solid.normal, solid.offset]) / SAME_PLANE).astype(np.int64)
    _, first, member = np.unique(key, axis=0, return_index=True, return_inverse=True)
    corners = solid.corner[solid.triangle]
    return solid.normal[first], [corners[member.ravel() == k] for k in range(len(first))]


def _behind(packing: Packing, normal: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, ...]:
    """The columns of one face: sub-spheres, normals, heights, areas and radius."""
    height = (corners[0, 0] - packing.center_m) @ normal
    behind = np.flatnonzero((height > 0) & (height < (1 + BEHIND) * packing.radius_m))
    point, weight = _points_of(corners, SPACING * packing.radius_m.mean())
    owner = _owner(packing, behind, point) if len(behind) else np.zeros(0, dtype=int)
    area = np.bincount(owner, weight[:len(owner)], len(behind))
    behind, area = behind[area > 0], area[area > 0]
    if len(behind) < FEWEST:
        behind, area = behind[:0], area[:0]
    radius = np.full(len(behind), np.sqrt(weight.sum() / np.pi))
    return behind, np.tile(normal, (len(behind), 1)), height[behind], area, radius


def _owner(packing: Packing, behind: np.ndarray, point: np.ndarray) -> np.ndarray:
    """(n,) which of the sub-spheres has each point, by the power distance: the distance in four dimensions."""
    square = packing.radius_m[behind] ** 2
    above = np.sqrt(square.max() - square)  # of the largest exactly nothing
    tree = cKDTree(np.column_stack([packing.center_m[behind], above]))
    return np.asarray(tree.query(np.column_stack([point, np.zeros(len(point))]))[1])


def _points_of(corners: np.ndarray, spacing_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) spread over triangles (t, 3, 3), and their shares (n,) of the area: the middles of the n^2 equal
    triangles that each is cut into."""
    points, weights = [], []
    for a, b, c in corners:
        longest = max(np.linalg.norm(b - a), np.linalg.norm(c - a), np.linalg.norm(c - b))
        cuts = max(1, int(np.ceil(longest / spacing_m)))
        i, j = (grid.ravel() for grid in np.meshgrid(np.arange(cuts), np.arange(cuts), indexing="ij"))
        upward, downward = i + j < cuts, i + j < cuts - 1
        u = np.concatenate([i[upward] + 1 / 3, i[downward] + 2 / 3]) / cuts
        v = np.concatenate([j[upward] + 1 / 3, j[downward] + 2 / 3]) / cuts
        points.append(a + u[:, None] * (b - a) + v[:, None] * (c - a))
        weights.append(np.full(len(u), np.linalg.norm(np.cross(b - a, c - a)) / 2 / cuts**2))
    return np.vstack(points), np.concatenate(weights)
