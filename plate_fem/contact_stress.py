"""Stress under contacts, added to the bending stress at the top of the plate; where it is high, and yield."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from plate_fem.stress import surface_stress

YIELD_PRESSURE = 1.6  # peak pressure at first yield of a Hertz contact, times the yield stress (Johnson 1985, 6.1)


@dataclass(frozen=True)
class HertzContact:
    """A sphere pressed on the plate at (x_m, y_m).

    radius_m: of the sphere. modulus_Pa: E* with 1/E* = sum of (1 - nu^2)/E of both bodies.
    """

    x_m: float
    y_m: float
    force_N: float
    radius_m: float
    modulus_Pa: float

    @property
    def contact_radius_m(self):
        """a = (3 F R / 4 E*)^(1/3)."""
        return (0.75 * self.force_N * self.radius_m / self.modulus_Pa) ** (1 / 3)

    @property
    def peak_pressure_Pa(self):
        """p0 = 3 F / (2 pi a^2)."""
        return 1.5 * self.force_N / (math.pi * self.contact_radius_m**2) if self.force_N > 0 else 0.0

    def yields(self, yield_stress_Pa):
        """Whether material of this yield stress has begun to flow below the surface."""
        return self.peak_pressure_Pa > YIELD_PRESSURE * yield_stress_Pa


def contact_surface_stress(contact, points_m, poisson_ratio):
    """Stress (k, 4) at the surface under a HertzContact: columns sx, sy, txy, sz (Pa, compression negative).

    points_m: (k, 2). poisson_ratio: of the plate. Johnson 1985, Contact Mechanics, Eqs. 3.43 and 3.44.
    """
    offset = np.atleast_2d(points_m) - (contact.x_m, contact.y_m)
    if contact.force_N <= 0:
        return np.zeros((len(offset), 4))
    a, p0 = contact.contact_radius_m, contact.peak_pressure_Pa
    offset[:, 0] += np.where(np.hypot(*offset.T) < 1e-9 * a, 1e-9 * a, 0.0)  # a direction for the centre
    distance = np.hypot(*offset.T)
    c, s = (offset / distance[:, None]).T
    x = (distance / a) ** 2
    inner = np.minimum(x, 1 - 1e-15)
    spread = -(1 - 2 * poisson_ratio) / 3 * np.expm1(1.5 * np.log1p(-inner)) / x  # (1 - (1 - x)^(3/2)) / x
    root = np.sqrt(np.clip(1 - x, 0, None))
    radial, hoop, normal = p0 * (spread - root), p0 * (-spread - 2 * poisson_ratio * root), -p0 * root
    sx, sy = radial * c**2 + hoop * s**2, radial * s**2 + hoop * c**2
    return np.column_stack([sx, sy, (radial - hoop) * c * s, normal])


def von_mises_3d(stress):
    """Von Mises stress (...,) of (..., 4) with columns sx, sy, txy, sz."""
    sx, sy, txy, sz = np.moveaxis(np.asarray(stress), -1, 0)
    return np.sqrt(0.5 * ((sx - sy) ** 2 + (sy - sz) ** 2 + (sz - sx) ** 2) + 3 * txy**2)


def total_stress(modes, amplitude, contacts, points_m, poisson_ratio):
    """Stress (k, 4) at the top surface: bending of the plate plus every contact's own field."""
    nodal = surface_stress(modes, amplitude).reshape(len(modes.lines_x_m), len(modes.lines_y_m), 3)
    bending = RegularGridInterpolator((modes.lines_x_m, modes.lines_y_m), nodal)(points_m)
    total = np.column_stack([bending, np.zeros(len(bending))])
    for contact in contacts:
        total += contact_surface_stress(contact, points_m, poisson_ratio)
    return total


def contact_patch(contact, rings=8, sectors=24, reach=4.0):
    """Mesh of the surface about a contact: points (k, 2) and cells (c, 4), out to `reach` contact radii.

    Half of the rings lie within the contact, where the pressure is.
    """
    a = contact.contact_radius_m
    radius = a * np.append(np.linspace(0, 1, rings // 2 + 1)[1:], np.geomspace(1, reach, rings - rings // 2 + 1)[1:])
    angle = 2 * np.pi * np.arange(sectors) / sectors
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.vstack([[[0.0, 0.0]], (radius[:, None, None] * circle).reshape(-1, 2)])
    inner, after = np.arange(sectors), np.roll(np.arange(sectors), -1)
    cells = [np.column_stack([0 * inner, 1 + inner, 1 + after, 0 * inner])]  # triangles with a corner twice
    for ring in range(rings - 1):
        first, second = 1 + ring * sectors, 1 + (ring + 1) * sectors
        cells.append(np.column_stack([first + inner, second + inner, second + after, first + after]))
    return points + (contact.x_m, contact.y_m), np.vstack(cells)


def high_stress_area(modes, amplitude, contacts, threshold_Pa, poisson_ratio, spacing_m=5e-4):
    """Area (m^2) of the top surface where von Mises stress exceeds the threshold.

    Counted on squares of about spacing_m, strip by strip; contacts narrower than a few squares need a
    smaller spacing.
    """
    lengths = [lines[-1] - lines[0] for lines in (modes.lines_x_m, modes.lines_y_m)]
    counts = [math.ceil(length / spacing_m) for length in lengths]
    x, y = (
        lines[0] + (np.arange(n) + 0.5) / n * length
        for lines, n, length in zip((modes.lines_x_m, modes.lines_y_m), counts, lengths)
    )
    high = 0
    for strip in np.array_split(x, max(1, len(x) // 50)):
        points = np.stack(np.meshgrid(strip, y, indexing="ij"), axis=-1).reshape(-1, 2)
        stress = total_stress(modes, amplitude, contacts, points, poisson_ratio)
        high += int((von_mises_3d(stress) > threshold_Pa).sum())
    return high * lengths[0] * lengths[1] / (counts[0] * counts[1])
