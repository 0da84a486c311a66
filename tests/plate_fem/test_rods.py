"""Rods and point supports against closed forms and against finer meshes."""

import math

import numpy as np
import pytest
from plates import STEEL, four_rods, plate, rod
from scipy.optimize import brentq

from plate_fem.mesh import default_mesh_size
from plate_fem.modes import plate_modes

# A plate so stiff that it only moves as a rigid body on its rods, within the frequencies of interest.
STIFF = {"youngs_modulus_Pa": 2e17, "theory": "mindlin", "mesh_size_m": 0.125}


def bar_stiffness(omega, length_m=0.1, diameter_m=0.02):
    """Dynamic stiffness at the top of a clamped bar, inertia included: E A (omega/c) cot(omega l / c)."""
    E, rho = STEEL["youngs_modulus_Pa"], STEEL["density_kg_m3"]
    k = omega * math.sqrt(rho / E)
    return E * math.pi * diameter_m**2 / 4 * k / math.tan(k * length_m)


def beam_stiffness(omega, length_m=0.1, diameter_m=0.02):
    """Dynamic moment per rotation at the pinned top of a clamped Euler-Bernoulli beam."""
    E, rho = STEEL["youngs_modulus_Pa"], STEEL["density_kg_m3"]
    bending = E * math.pi * diameter_m**4 / 64
    b = (rho * math.pi * diameter_m**2 / 4 * omega**2 / bending) ** 0.25
    x = b * length_m
    return bending * b * (math.sin(x) * math.cosh(x) - math.cos(x) * math.sinh(x)) / (1 - math.cos(x) * math.cosh(x))


def test_beam_stiffness_of_this_test_is_4EIl_at_rest():
    bending = 207e9 * math.pi * 0.02**4 / 64
    assert beam_stiffness(1.0) == pytest.approx(4 * bending / 0.1, rel=1e-6)


def test_rigid_plate_on_its_rods():
    """All modes up to 12 kHz: bounce, two tilts, and the rods' own bending with and without tilt."""
    mass = 7830 * 0.25 * 0.02
    inertia = mass * (0.5**2 + 0.02**2) / 12
    bounce = brentq(lambda w: 4 * bar_stiffness(w) - mass * w**2, 1e3, 7e4)

    def tilting(w):
        return 4 * (0.2**2 * bar_stiffness(w) + beam_stiffness(w)) - inertia * w**2

    clamped = 4.730041**2 / 0.1**2 * math.sqrt(207e9 * 0.02**2 / 16 / 7830)  # beams clamped at both ends
    tilts = [brentq(tilting, 1e3, 0.6 * clamped), brentq(tilting, 1.000001 * clamped, 1.01 * clamped)]
    expected = np.sort([bounce, *np.repeat(tilts, 2), *np.repeat(clamped, 6)]) / (2 * math.pi)
    modes = plate_modes(plate(rods=four_rods(), **STIFF, max_frequency_Hz=12e3))
    assert modes.frequency_Hz == pytest.approx(expected, rel=2e-4)


@pytest.mark.parametrize(
    ("theory", "rods"),
    [
        ("kirchhoff", four_rods()),
        ("mindlin", [rod(0.13, -0.06)]),
        pytest.param("mindlin", four_rods(), marks=pytest.mark.validate),
    ],
)
def test_frequencies_on_rods_converge_with_the_mesh(theory, rods):
    """Tied over their discs, rods have a converged answer; a rod tied to one node drifts for ever."""
    table = plate(rods=rods, theory=theory, max_frequency_Hz=2e3)
    default = default_mesh_size(table)
    modes = [
        plate_modes(table.model_copy(update={"mesh_size_m": s * default})).frequency_Hz[:10] for s in (2.0, 1.0, 0.75)
    ]
    coarse, medium = (modes[i] / modes[2] - 1 for i in (0, 1))
    assert np.all(coarse > -1e-7)  # conforming elements converge from above
    assert np.all(medium > -1e-7)
    assert medium.max() < 1e-3  # what the default mesh is made for
    assert medium.max() < coarse.max() / 2
