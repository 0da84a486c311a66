"""Natural frequencies against published tables and closed forms, with rates of convergence."""

import math

import numpy as np
import pytest
from plates import frequency_factor, plate
from scipy.optimize import brentq

from plate_fem.elements.mesh import bending_stiffness, bending_wavenumber, kirchhoff_error, shear_factor
from plate_fem.modes import plate_modes

# omega a^2 sqrt(rho h / D) of a square plate, nu 0.3, from a converged Ritz series
TABLE = {
    "free": [13.468, 19.596, 24.270, 34.801, 34.801],
    "simply_supported": [19.739, 49.348, 49.348, 78.957],
    "clamped": [35.985, 73.394, 73.394, 108.217],
}
THIN = {"thickness_m": 5e-4, "max_frequency_Hz": 150.0}  # thickness / side 1e-3


def factors(table):
    modes = plate_modes(table)
    elastic = modes.frequency_Hz[modes.frequency_Hz > 0]
    return elastic * frequency_factor(table)


@pytest.mark.parametrize("theory", ["kirchhoff", "mindlin"])
@pytest.mark.parametrize("edges", TABLE)
def test_square_plate_within_a_tenth_of_a_percent(edges, theory):
    """The shear-flexible plate too, at a thickness where any locking would show by orders of magnitude."""
    expected = np.array(TABLE[edges])
    found = factors(plate(**THIN, edges=edges, theory=theory))[: len(expected)]
    assert found == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("edges", ["free", "simply_supported", "clamped"])
def test_shear_flexible_plate_goes_over_into_the_thin_one(edges):
    """No locking: on one coarse mesh its frequencies tend to Kirchhoff's from below, like thickness squared."""
    excess = []
    for ratio in (1e-2, 1e-3, 1e-4):
        table = plate(thickness_m=0.5 * ratio, edges=edges, mesh_size_m=0.5 / 6, max_frequency_Hz=2e5 * ratio)
        thin, shear = (factors(table.model_copy(update={"theory": t}))[:4] for t in ("kirchhoff", "mindlin"))
        excess.append(abs(thin / shear - 1).max())
        assert np.all(thin / shear - 1 > -1e-7)
    assert excess[0] < 5e-3
    assert excess[1] < 1e-4
    assert excess[2] < 2e-6


def rate(values, exact, sizes):
    errors = abs(np.array(values) / exact - 1)
    return np.log(errors[:-1] / errors[1:]) / np.log(np.array(sizes[:-1]) / np.array(sizes[1:]))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("theory", "thickness_m", "lowest", "highest"),
    [("kirchhoff", 0.02, 3.95, 4.05), ("mindlin", 5e-4, 3.95, 4.05), ("mindlin", 0.02, 3.95, 4.05)],
)
def test_simply_supported_frequencies_converge(theory, thickness_m, lowest, highest):
    """Cubics and an energy of second derivatives: order 2 (3 + 1 - 2) = 4."""
    sizes = [1 / 20, 1 / 28, 1 / 40]
    table = plate(edges="simply_supported", theory=theory, thickness_m=thickness_m, max_frequency_Hz=1e5 * thickness_m)
    exact = navier(table, 2, 2, theory)
    tables = [table.model_copy(update={"mesh_size_m": s / 2}) for s in sizes]
    values = [find(plate_modes(t).frequency_Hz, exact) for t in tables]
    assert np.all((rate(values, exact, sizes) > lowest) & (rate(values, exact, sizes) < highest))


def find(frequencies, wanted):
    return frequencies[abs(frequencies - wanted).argmin()]


def navier(table, m, n, theory):
    """Exact frequency (Hz) of a simply supported plate: lower root of the 2 x 2 problem in (w, rotation)."""
    k2 = (m * math.pi / table.size_m[0]) ** 2 + (n * math.pi / table.size_m[1]) ** 2
    mass, stiffness = table.density_kg_m3 * table.thickness_m, bending_stiffness(table)
    if theory == "kirchhoff":
        return k2 * math.sqrt(stiffness / mass) / (2 * math.pi)
    nu, t = table.poisson_ratio, table.thickness_m
    shear = shear_factor(nu) * table.youngs_modulus_Pa / (2 * (1 + nu)) * t
    rotary = mass * t**2 / 12
    # (stiffness k2 + shear - rotary W) (shear k2 - mass W) = shear^2 k2
    b = rotary * shear * k2 + mass * (stiffness * k2 + shear)
    c = stiffness * shear * k2**2
    omega_squared = 2 * c / (b + math.sqrt(b * b - 4 * rotary * mass * c))
    return math.sqrt(omega_squared) / (2 * math.pi)


@pytest.mark.parametrize("theory", ["kirchhoff", "mindlin"])
@pytest.mark.parametrize("size_m", [(0.5, 0.5), (0.6, 0.35)])
def test_all_modes_of_a_simply_supported_plate_up_to_the_limit(theory, size_m):
    """At the default mesh every mode kept, the highest included, is within 0.1 % of Navier's solution."""
    table = plate(size_m=size_m, edges="simply_supported", theory=theory, max_frequency_Hz=12e3)
    exact = np.sort([navier(table, m, n, theory) for m in range(1, 40) for n in range(1, 40)])
    exact = exact[exact <= table.max_frequency_Hz]
    assert plate_modes(table).frequency_Hz == pytest.approx(exact, rel=1e-3)


def test_free_plate_has_three_rigid_body_modes():
    modes = plate_modes(plate(**THIN))
    assert np.array_equal(modes.frequency_Hz[:4] == 0, [True, True, True, False])
    # their shapes are planes: no curvature, no stress
    assert abs(modes.surface_stress[..., :3]).max() < 1e-6 * abs(modes.surface_stress[..., 3]).max()


def test_modes_are_orthonormal_and_complete_in_mass():
    """The mass that the rigid-body modes see of a free plate is its mass: sum of (M mean_shape)^2 = M."""
    modes = plate_modes(plate(max_frequency_Hz=5e3))
    assert modes.mass_kg == pytest.approx(7830 * 0.5 * 0.5 * 0.02)
    assert modes.mass_kg * np.sum(modes.mean_shape**2) == pytest.approx(1.0, rel=1e-10)
    assert abs(modes.mean_shape[3:]).max() < 1e-10  # elastic modes keep the centre of mass


def test_theory_follows_the_criterion():
    thick, thin = plate(max_frequency_Hz=20e3), plate(thickness_m=0.002, max_frequency_Hz=200.0)
    assert kirchhoff_error(thick) > 0.005 > kirchhoff_error(thin)
    assert plate_modes(plate(max_frequency_Hz=3e3)).theory == "mindlin"
    assert plate_modes(thin).theory == "kirchhoff"


def test_criterion_is_the_difference_of_the_two_theories():
    table = plate(edges="simply_supported", max_frequency_Hz=700.0)
    exact = navier(table, 1, 1, "kirchhoff") / navier(table, 1, 1, "mindlin") - 1
    at_mode = table.model_copy(update={"max_frequency_Hz": navier(table, 1, 1, "kirchhoff")})
    assert kirchhoff_error(at_mode) == pytest.approx(exact, rel=0.01)


@pytest.mark.parametrize("poisson_ratio", [0.1, 0.3, 0.45])
def test_bending_waves_of_a_thick_plate_are_those_of_an_elastic_layer(poisson_ratio):
    """Of Rayleigh and Lamb's equation, at six thicknesses a wavelength."""
    table = plate(poisson_ratio=poisson_ratio, theory="mindlin")
    t, E, rho = table.thickness_m, table.youngs_modulus_Pa, table.density_kg_m3
    shear = E / (2 * (1 + poisson_ratio))
    k, half = 2 * np.pi / (6 * t), t / 2
    across_2, along_2 = shear / rho, shear / rho * 2 * (1 - poisson_ratio) / (1 - 2 * poisson_ratio)

    def layer(omega):
        a, b = np.sqrt(k**2 - omega**2 / along_2), np.sqrt(k**2 - omega**2 / across_2)
        return 4 * k**2 * a * b * np.tanh(b * half) - (k**2 + b**2) ** 2 * np.tanh(a * half)

    thin = np.sqrt(bending_stiffness(table) / (rho * t)) * k**2
    omega = brentq(layer, 0.3 * thin, min(0.999 * thin, 0.999 * k * np.sqrt(across_2)))
    assert bending_wavenumber(table, omega / (2 * np.pi), "mindlin") == pytest.approx(k, rel=1e-3)
