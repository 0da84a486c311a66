"""Static deflections against tables and series."""

import math

import numpy as np
import pytest
from plates import four_rods, plate
from statics import pressure_load, static_response

from plate_fem.elements.mesh import bending_stiffness, shear_stiffness
from plate_fem.solution.model import build_model

THIN = {"thickness_m": 5e-4, "max_frequency_Hz": 150.0}


def deflection(table, points_m):
    """Deflection at points under a unit pressure."""
    model = build_model(table)
    rows = model.system.deflection(np.atleast_2d(points_m)) @ model.expansion
    return rows @ static_response(model, pressure_load(model))


def navier_centre(table, theory, terms=201):
    """Centre of a simply supported plate under unit pressure: Navier's double series."""
    total, (a, b) = 0.0, table.size_m
    shear = shear_stiffness(table) if theory == "mindlin" else math.inf
    for m in range(1, terms, 2):
        for n in range(1, terms, 2):
            k2 = math.pi**2 * ((m / a) ** 2 + (n / b) ** 2)
            flexibility = 1 / (bending_stiffness(table) * k2**2) + 1 / (shear * k2)
            total += 16 / (math.pi**2 * m * n) * (-1) ** ((m + n) // 2 - 1) * flexibility
    return total


@pytest.mark.parametrize("theory", ["kirchhoff", "mindlin"])
@pytest.mark.parametrize("thickness_m", [5e-4, 0.02])
@pytest.mark.parametrize("width_m", [0.5, 0.3])
def test_simply_supported_centre(theory, thickness_m, width_m):
    table = plate(edges="simply_supported", theory=theory, thickness_m=thickness_m, size_m=[0.5, width_m],
                  max_frequency_Hz=2e5 * thickness_m)
    assert deflection(table, [0, 0]) == pytest.approx(navier_centre(table, theory), rel=1e-4)


def test_clamped_centre():
    """0.00126532 q a^4 / D (Taylor and Govindjee 2004, Commun. Numer. Methods Eng. 20:757)."""
    table = plate(edges="clamped", **THIN)
    assert deflection(table, [0, 0]) * bending_stiffness(table) / 0.5**4 == pytest.approx(0.00126532, rel=1e-3)


def test_static_deflection_converges_with_order_four():
    errors = []
    sizes = np.array([1 / 4, 1 / 6, 1 / 8])
    for size in sizes:
        table = plate(edges="simply_supported", mesh_size_m=0.5 * size, **THIN)
        errors.append(abs(deflection(table, [0, 0])[0] / navier_centre(table, "kirchhoff", 801) - 1))
    rate = np.log(np.array(errors[:-1]) / errors[1:]) / np.log(sizes[:-1] / sizes[1:])
    assert np.all((rate > 3.5) & (rate < 4.5))


@pytest.mark.parametrize("theory", ["kirchhoff", "mindlin"])
def test_rods_carry_the_load(theory):
    """Sum of the forces in the rods and its moments balance the load, wherever it stands."""
    model = build_model(plate(rods=four_rods(), theory=theory, max_frequency_Hz=4e3))
    place = np.array([[0.07, -0.11]])
    load = np.column_stack([pressure_load(model), (model.system.deflection(place) @ model.expansion).toarray()[0]])
    force = model.rod_force @ static_response(model, load)
    assert force.sum(axis=0) == pytest.approx([0.25, 1.0], rel=1e-9)  # tension holds the plate down
    assert force[:, 0] == pytest.approx(np.full(4, 0.25 / 4), rel=1e-9)


def test_a_plate_that_nothing_holds_has_no_static_deflection():
    with pytest.raises(RuntimeError, match="not held"):
        deflection(plate(**THIN), [0, 0])
