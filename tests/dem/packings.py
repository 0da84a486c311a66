"""Packings and measures of packings that only tests need."""

from dataclasses import dataclass

import numpy as np

from dem.stones.packing import pack


@dataclass(frozen=True)
class BoxContainer:
    """Edges `length_m` (3,) along x, y, z, about the origin."""

    length_m: tuple[float, float, float]

    @property
    def volume_m3(self):
        return float(np.prod(self.length_m))

    @property
    def half_size_m(self):
        return np.array(self.length_m) / 2

    def walls(self, x):
        half = self.half_size_m
        return [(np.hstack([half + x, half - x]), np.vstack([np.eye(3), -np.eye(3)]))]

    def in_units(self, length_m):
        return BoxContainer(tuple(edge / length_m for edge in self.length_m))


def pack_box(length_m, count, seed):
    """As `pack_sphere`, in a box with edges along x, y, z about the origin."""
    return pack(BoxContainer(tuple(float(edge) for edge in length_m)), count, seed)


def solid_fraction(packing):
    """Volume of the sub-spheres over that of the container, its loose boundary layer included."""
    return float(4 / 3 * np.pi * (packing.radius_m**3).sum() / packing.container.volume_m3)


def plate_depth_m(packing, direction):
    """How far below the container's sphere a flat plate facing `direction` (k, 3) first touches: (k,)."""
    return packing.container.radius_m - (direction @ packing.center_m.T + packing.radius_m).max(axis=1)
