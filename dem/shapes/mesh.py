"""Closed surfaces of triangles that need not be convex: what is inside, how far the surface is, and what is refused.
They are containers for packings.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

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
    normal = np.cross(b - a, c - a)
    foot = point - (_dot(point - a, normal) / np.maximum(_dot(normal, normal), TINY))[:, None] * normal
    on_sides = [_on_side(point, p, q) for p, q in ((a, b), (b, c), (c, a))]
    away = np.stack([((point - at) ** 2).sum(axis=1) for at in on_sides])
    best = np.stack(on_sides)[away.argmin(axis=0), np.arange(len(point))]
    inside = np.all([_dot(np.cross(q - p, foot - p), normal) >= 0 for p, q in ((a, b), (b, c), (c, a))], axis=0)
    return np.where(inside[:, None], foot, best)


def _on_side(point: np.ndarray, p: np.ndarray, q: np.ndarray) -> np.ndarray:
    share = np.clip(_dot(point - p, q - p) / np.maximum(_dot(q - p, q - p), TINY), 0, 1)
    return p + share[:, None] * (q - p)


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
    return (a * b).sum(axis=-1)


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
        """(3,) half of the extent of a box about the origin that holds it."""
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
        least = np.sqrt(((x[:, None] - center) ** 2).sum(axis=2)) - radius
        nearest = np.sort(least + 2 * radius, axis=1)[:, 0]  # no triangle is nearest that begins beyond this
        point, t = np.nonzero(least <= np.maximum(nearest, COUNTED * unit)[:, None])
        off = x[point] - nearest_points(x[point], *(self._corner[self._triangle[t, k]] for k in range(3)))
        distance = np.sqrt((off**2).sum(axis=1))
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

    def in_units(self, length_m: float) -> MeshContainer:
        """The same in units of `length_m`."""
        corners = tuple(map(tuple, (self._corner / length_m).tolist()))
        return MeshContainer(corners, self.triangles, self.volume_m3 / length_m**3)
