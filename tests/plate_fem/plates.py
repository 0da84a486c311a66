"""Plates used by several tests."""

import math

from common.scene.plate import PlateTable
from common.tables import check
from plate_fem.elements.mesh import bending_stiffness

OF_ROD = {"density_kg_m3": 7830.0, "youngs_modulus_Pa": 207e9}
STEEL = {**OF_ROD, "poisson_ratio": 0.3}
TABLE = {
    "size_m": [0.5, 0.5], "thickness_m": 0.02, **STEEL,
    "max_frequency_Hz": 20e3, "damping_ratio": 0.01,
}  # fmt: skip


def plate(**changes):
    """A steel plate of 0.5 x 0.5 x 0.02 m with some keys changed."""
    return check(PlateTable, {**TABLE, **changes}, "test", "plate")


def rod(x_m, y_m, **changes):
    return {"place_m": [x_m, y_m], "diameter_m": 0.02, "length_m": 0.1, **OF_ROD, **changes}


def four_rods(**changes):
    return [rod(a * 0.2, b * 0.2, **changes) for a in (-1, 1) for b in (-1, 1)]


def frequency_factor(plate):
    """Factor from frequency in Hz to omega a^2 sqrt(rho h / D), a the length."""
    mass_per_area = plate.density_kg_m3 * plate.thickness_m
    return 2 * math.pi * plate.size_m[0]**2 * math.sqrt(mass_per_area / bending_stiffness(plate))
