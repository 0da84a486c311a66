"""A container bounded by triangles, for packings of stones that are not convex."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dem.shapes.mesh import nearest_points, winding_number

SLOTS = 8      # nearest triangles that count as walls of a point, each by itself: corners are pressed from all sides
COUNTED = 1.7  # so many mean radii of sub-spheres away a triangle still counts; the nearest one always does
UNSURE = 0.5   # as near to the surface a centre may have come out of it


@dataclass(frozen=True)
class MeshContainer:
    """A solid about the origin: its corners (c, 3) and triangles (t, 3), outward, as tuples; and its volume."""

    corners: tuple[tuple[float, float, float], ...]
    triangles: tuple[tuple[int, int, int], ...]
    volume_m3: float
    pressed_axes = ()

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
