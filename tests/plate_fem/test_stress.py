"""Bending stress against Navier's series, and against what the stress must do at a free edge."""

import math

import numpy as np
import pytest
from plates import four_rods, plate
from statics import pressure_load, static_response

from common.input_error import InputError
from plate_fem.elements.mesh import bending_stiffness
from plate_fem.modes import plate_modes, surface_stress_rows
from plate_fem.solution.model import build_model
from plate_fem.stress import StressPeak, surface_stress, von_mises


def navier_stress(table, points_m, terms=301):
    """Top surface stress (k, 3) of a simply supported plate under a unit pressure downward."""
    (a, b), nu = table.size_m, table.poisson_ratio
    m = np.arange(1, terms, 2) * math.pi
    result = []
    for x, y in points_m:
        x, y = x + a / 2, y + b / 2
        mx, ny = m / a, m / b
        k2 = mx[:, None] ** 2 + ny**2
        w = 16 / (np.outer(m, m) * bending_stiffness(table) * k2**2)  # pi^2 of the load cancels m n pi^2
        shape = np.outer(np.sin(mx * x), np.sin(ny * y))
        kx = np.sum(-w * mx[:, None] ** 2 * shape)
        ky = np.sum(-w * ny**2 * shape)
        kxy = np.sum(2 * w * np.outer(mx * np.cos(mx * x), ny * np.cos(ny * y)))
        scale = table.youngs_modulus_Pa * table.thickness_m / 2 / (1 - nu**2)
        # deflection is downward: the top is compressed in the middle, where kx < 0
        result.append([scale * (kx + nu * ky), scale * (ky + nu * kx), scale * (1 - nu) / 2 * kxy])
    return np.array(result)


def static_stress(table, points_m):
    model = build_model(table)
    u = model.expansion @ static_response(model, -pressure_load(model))
    return np.column_stack([rows @ u for rows in surface_stress_rows(model.system, np.asarray(points_m, float))])


@pytest.mark.parametrize("theory", ["kirchhoff", "mindlin"])
def test_uniform_load_on_a_simply_supported_plate(theory):
    table = plate(edges="simply_supported", theory=theory, thickness_m=0.01, size_m=[0.5, 0.4], mesh_size_m=0.02,
                  max_frequency_Hz=5e3)
    points = np.array([[0, 0], [0.1, 0.06], [-0.15, 0.1], [0.2, -0.16]])
    expected, found = navier_stress(table, points), static_stress(table, points)
    assert np.sign(expected[0, 0]) == -1
    assert found == pytest.approx(expected, rel=2e-3, abs=2e-3 * abs(expected).max())


@pytest.mark.parametrize(("theory", "lowest"), [("kirchhoff", 1.8), ("mindlin", 1.8)])
def test_stress_converges(theory, lowest):
    errors, sizes = [], np.array([1 / 6, 1 / 8, 1 / 12])
    for size in sizes:
        table = plate(edges="simply_supported", theory=theory, thickness_m=0.01, mesh_size_m=0.5 * size,
                      max_frequency_Hz=1e3)
        found, expected = static_stress(table, [[0, 0]]), navier_stress(table, [[0, 0]])
        errors.append(abs(found - expected).max() / abs(expected).max())
    rate = np.log(np.array(errors[:-1]) / errors[1:]) / np.log(sizes[:-1] / sizes[1:])
    assert np.all(rate > lowest)


def test_stress_of_a_mirrored_plate_is_mirrored():
    """About the discs of rods too, where curvature jumps."""
    modes = plate_modes(plate(rods=four_rods(), size_m=[0.5, 0.42], max_frequency_Hz=1500.0))
    nodes = modes.surface_stress.reshape(len(modes.lines_x_m), len(modes.lines_y_m), 3, -1).astype(float)
    for axis in (0, 1):
        assert abs(nodes) == pytest.approx(abs(np.flip(nodes, axis)), abs=1e-6 * abs(nodes).max())


def test_stress_of_a_motion_is_that_of_its_modes_and_vanishes_across_free_edges():
    modes = plate_modes(plate(rods=four_rods(), thickness_m=0.01, max_frequency_Hz=2500.0, theory="mindlin"))
    rng = np.random.default_rng(1)
    amplitude = rng.normal(size=len(modes.frequency_Hz)) / modes.frequency_Hz
    stress = surface_stress(modes, amplitude)
    edge = np.isclose(modes.node_m[:, 0], 0.25) & (abs(modes.node_m[:, 1]) < 0.24)
    assert abs(stress[edge, 0]).max() < 0.03 * von_mises(stress).max()
    assert surface_stress(modes, 2 * amplitude) == pytest.approx(2 * stress)


@pytest.mark.slow
@pytest.mark.parametrize("patch", [StressPeak.PATCH, 50])
def test_peak_of_a_motion_is_the_largest_of_all_its_instants_and_places(monkeypatch, patch):
    """By the principal stresses, which Mohr's circle gives."""
    monkeypatch.setattr(StressPeak, "PATCH", patch)
    table = plate(rods=four_rods(), thickness_m=0.01, max_frequency_Hz=1500.0, theory="mindlin")
    modes, rods = plate_modes(table), table.rods
    assert len(modes.node_m) > 2 * 50
    t = np.linspace(0, 0.02, 50)
    amplitude = np.sin(np.outer(t, 2 * math.pi * modes.frequency_Hz)) / modes.frequency_Hz**2
    amplitude[:, modes.frequency_Hz == 0] = 0
    peak = StressPeak(modes, rods)
    for part in (slice(0, 20), slice(20, 50)):
        peak.add(t[part], amplitude[part])
    exact = np.einsum("kcm,tm->tkc", modes.surface_stress.astype(float), amplitude)
    stress = np.moveaxis(surface_stress(modes, amplitude.T), 2, 0)
    assert stress == pytest.approx(exact, abs=1e-6 * abs(exact).max())
    sx, sy, txy = np.moveaxis(stress, -1, 0)
    middle, radius = (sx + sy) / 2, np.hypot((sx - sy) / 2, txy)
    high, low = middle + radius, middle - radius
    naive = np.sqrt(((high - low) ** 2 + high**2 + low**2) / 2)
    near = np.zeros(len(modes.node_m), bool)
    for one in rods:
        near |= np.linalg.norm(modes.node_m - [one.x_m, one.y_m], axis=1) < one.diameter_m
    for at_rods in (False, True):
        found, here = peak.result(at_rods), np.where(near == at_rods, naive, 0)
        k, node = np.unravel_index(here.argmax(), here.shape)
        assert found["von_mises_Pa"] == pytest.approx(here.max(), rel=1e-9)
        assert (found["t_s"], found["x_m"], found["y_m"]) == (t[k], *modes.node_m[node])


def test_von_mises():
    assert von_mises([100.0, 0.0, 0.0]) == pytest.approx(100.0)
    assert von_mises([100.0, 100.0, 0.0]) == pytest.approx(100.0)
    assert von_mises([[0.0, 0.0, 10.0], [50.0, -50.0, 0.0]]) == pytest.approx([10 * math.sqrt(3), 50 * math.sqrt(3)])


def test_what_is_not_finite_or_of_another_shape_is_refused():
    modes = plate_modes(plate(max_frequency_Hz=600.0))
    for amplitude in (np.full(len(modes.frequency_Hz), np.nan), np.ones(len(modes.frequency_Hz) + 1), 1.0):
        with pytest.raises(InputError, match="amplitude: .*must be finite, one of each of"):
            surface_stress(modes, amplitude)
    for stress in ([1e6, np.nan, 0.0], [1e6, 0.0], 1e6):
        with pytest.raises(InputError, match="stress: .*must be finite, with columns sx, sy, txy"):
            von_mises(stress)
