"""Point supports anywhere on the plate."""

import math

import numpy as np
import pytest
from plates import SUPPORTS_AT_CORNERS, frequency_factor, plate
from scipy.optimize import brentq

from plate_fem.elements.mesh import bending_stiffness
from plate_fem.modes import plate_modes

THIN = {"thickness_m": 1e-3, "max_frequency_Hz": 200.0}
PLACE = {"x_m": 0.06, "y_m": -0.113}


def held_at(table, place, low_Hz, high_Hz):
    """Frequency (Hz) of a simply supported plate held at one more point.

    The point moves under a unit harmonic force there like the sum over Navier's modes of
    shape^2 / (omega_mn^2 - omega^2); held still, that sum is zero. The modes far above enter by their
    static part, which converges fast.
    """
    a, mass = table.length_m, table.density_kg_m3 * table.thickness_m
    number = np.arange(1, 400)
    shape = [np.sin(number * math.pi * (place[k] / a + 0.5)) ** 2 for k in ("x_m", "y_m")]
    square = np.outer(*shape) * 4 / (mass * a * a)
    k2 = (math.pi / a) ** 2 * (number[:, None] ** 2 + number**2)
    omega_squared = bending_stiffness(table) / mass * k2**2
    return brentq(lambda f: np.sum(square / (omega_squared - (2 * math.pi * f) ** 2)), low_Hz, high_Hz)


def test_point_support_off_the_mesh_and_off_the_axes():
    table = plate(edges="simply_supported", theory="kirchhoff", point_supports=[PLACE], **THIN)
    free = np.array([2, 5, 5, 8]) * math.pi**2 / frequency_factor(table)
    found = plate_modes(table).frequency_Hz
    # one frequency between each two of the plate without the support; the pair keeps one of its own
    first = held_at(table, PLACE, 1.0001 * free[0], 0.9999 * free[1])
    third = held_at(table, PLACE, 1.0001 * free[1], 0.9999 * free[3])
    assert found[:3] == pytest.approx([first, free[1], third], rel=1e-3)


def test_support_of_a_shear_flexible_plate_tends_to_a_point():
    """Its width is the thickness: on thinner plates the answer is the table's, and the mesh does not matter."""
    table = plate(point_supports=SUPPORTS_AT_CORNERS, theory="mindlin", **THIN)
    tables = [table.model_copy(update={"mesh_size_m": s}) for s in (0.06, 0.03, 0.02)]
    first = [plate_modes(t).frequency_Hz[:3] * frequency_factor(table) for t in tables]
    assert first[2] == pytest.approx(np.array([7.1109, 15.7702, 15.7702]), rel=4e-3)
    assert first[1] == pytest.approx(first[2], rel=1e-3)


def test_supports_beside_and_on_each_other_are_kept_apart():
    close = [{"x_m": 0.1, "y_m": 0.0}, {"x_m": 0.1, "y_m": 0.004}, {"x_m": -0.1, "y_m": 0.0}]
    modes = plate_modes(plate(point_supports=close, max_frequency_Hz=3e3, theory="kirchhoff"))
    places = [[p["x_m"], p["y_m"]] for p in close]
    assert abs(modes.shape_at(places)).max() < 1e-9 * abs(modes.shape).max()
    assert modes.frequency_Hz[0] > 0


def test_support_on_a_held_edge_changes_nothing():
    held = plate(edges="clamped", point_supports=[{"x_m": 0.25, "y_m": 0.1}], **THIN)
    free = held.model_copy(update={"point_supports": ()})
    assert plate_modes(held).frequency_Hz == pytest.approx(plate_modes(free).frequency_Hz, rel=1e-5)
