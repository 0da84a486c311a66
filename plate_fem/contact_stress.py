"""Stress under Hertz contacts, added to the bending stress at the top surface of the plate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from plate_fem.modes import PlateModes
from plate_fem.stress import surface_stress

YIELD_PRESSURE = 1.6  # peak pressure at first yield of a Hertz contact, over the yield stress (Johnson 1985, 6.1)
PATCH_RINGS, PATCH_SECTORS, PATCH_REACH = 8, 24, 4.0  # of the mesh about a contact


@dataclass(frozen=True)
class HertzContact:
    """A sphere of radius `radius_m` pressed on the plate at (x_m, y_m).

    `modulus_Pa` is the contact modulus E* of both bodies (common/hertz.py).
    """

    x_m: float
    y_m: float
    force_N: float
    radius_m: float
    modulus_Pa: float

    @property
    def contact_radius_m(self) -> float:
        """a = (3 F R / 4 E*)^(1/3)."""
        return (0.75 * self.force_N * self.radius_m / self.modulus_Pa) ** (1 / 3)

    @property
    def peak_pressure_Pa(self) -> float:
        """p0 = 3 F / (2 pi a^2)."""
        return 1.5 * self.force_N / (math.pi * self.contact_radius_m**2) if self.force_N > 0 else 0.0


def contact_surface_stress(contact: HertzContact, points_m: np.ndarray, poisson_ratio: float) -> np.ndarray:
    """Return the stress (k, 4) of a contact at points (k, 2) of the surface, for the Poisson ratio of the plate.

    Columns are sx, sy, txy, sz in Pa, compression negative (Johnson 1985, Contact Mechanics, Eqs. 3.43 and 3.44).
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


def von_mises_3d(stress: np.ndarray) -> np.ndarray:
    """Return the von Mises stress (...,) of stress (..., 4) with columns sx, sy, txy, sz."""
    sx, sy, txy, sz = np.moveaxis(np.asarray(stress), -1, 0)
    return np.sqrt(0.5 * ((sx - sy) ** 2 + (sy - sz) ** 2 + (sz - sx) ** 2) + 3 * txy**2)


def total_stress(
    modes: PlateModes, amplitude: np.ndarray, contacts: Sequence[HertzContact], points_m: np.ndarray,
    poisson_ratio: float,
) -> np.ndarray:
    """Return the stress (k, 4) at points (k, 2) of the top surface: bending plus the field of every contact.

    Amplitudes have shape (n,); columns are those of `contact_surface_stress`.
    """
    nodal = surface_stress(modes, amplitude).reshape(len(modes.lines_x_m), len(modes.lines_y_m), 3)
    bending = RegularGridInterpolator((modes.lines_x_m, modes.lines_y_m), nodal)(points_m)
    total = np.column_stack([bending, np.zeros(len(bending))])
    for contact in contacts:
        total += contact_surface_stress(contact, points_m, poisson_ratio)
    return total


def contact_patch(contact: HertzContact) -> tuple[np.ndarray, np.ndarray]:
    """Return points (k, 2) and cells (c, 4) of a mesh of the surface about a contact, out to PATCH_REACH contact radii.

    Half of the rings of cells lie within the contact, where the pressure is.
    """
    a, inside, sectors = contact.contact_radius_m, PATCH_RINGS // 2, PATCH_SECTORS
    beyond = np.geomspace(1, PATCH_REACH, PATCH_RINGS - inside + 1)[1:]
    radius = a * np.append(np.linspace(0, 1, inside + 1)[1:], beyond)
    angle = 2 * np.pi * np.arange(sectors) / sectors
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.vstack([[[0.0, 0.0]], (radius[:, None, None] * circle).reshape(-1, 2)])
    inner, after = np.arange(sectors), np.roll(np.arange(sectors), -1)
    cells = [np.column_stack([0 * inner, 1 + inner, 1 + after, 0 * inner])]  # triangles with a corner twice
    for ring in range(PATCH_RINGS - 1):
        first, second = 1 + ring * sectors, 1 + (ring + 1) * sectors
        cells.append(np.column_stack([first + inner, second + inner, second + after, first + after]))
    return points + (contact.x_m, contact.y_m), np.vstack(cells)
