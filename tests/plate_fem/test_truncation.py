"""Modes left out: their compliance as residual modes, and the energy that goes without them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from impact import impact
from plates import four_rods, plate, rod
from scipy.integrate import cumulative_trapezoid, quad
from scipy.special import j1
from statics import static_response

from plate_fem.elements.mesh import bending_stiffness, bending_wavenumber, choose_theory, shear_stiffness
from plate_fem.elements.rods import disc_quadrature, load_rows
from plate_fem.impact import energy_left_out
from plate_fem.modes import NOWHERE, modes_for_loads, plate_modes
from plate_fem.motion import ModalMotion
from plate_fem.solution.model import LOAD_RADIUS, build_model

HELD = {"edges": "clamped", "max_frequency_Hz": 4e3}
POINTS = np.array([[0.1, 0.0], [-0.03, 0.08]])


def load_shape(modes, table, point):
    if modes.theory == "kirchhoff":
        return modes.shape_at([point])[0]
    points, weights = disc_quadrature(*point, LOAD_RADIUS * table.thickness_m)
    return weights @ modes.shape_at(points)


@pytest.mark.parametrize("theory", ["kirchhoff", "mindlin"])
def test_kept_and_residual_modes_give_the_exact_static_response_to_the_loads(theory):
    table = plate(**HELD, theory=theory)
    modes = plate_modes(table, residual_points_m=POINTS)
    model = build_model(table)
    loads = (load_rows(model.system, POINTS, LOAD_RADIUS * table.thickness_m) @ model.expansion).T.toarray()
    places = np.array([[0.1, 0.0], [0.0, 0.0], [0.2, 0.2], [-0.1, -0.21]])
    exact = model.system.deflection(places) @ model.expansion @ static_response(model, loads)
    force = np.array([load_shape(modes, table, point) for point in POINTS])
    compliance = 1 / (2 * np.pi * modes.frequency_Hz) ** 2
    found = modes.shape_at(places) @ (compliance[:, None] * force.T)
    assert modes.n_residual == 2
    assert found == pytest.approx(exact, rel=1e-6, abs=1e-6 * abs(exact).max())
    kept = modes.shape_at(places)[:, :-2] @ (compliance[:-2, None] * force.T[:-2])
    assert abs(kept - exact).max() > 1e-2 * abs(exact).max()  # without them it is not


@pytest.mark.slow
@pytest.mark.parametrize("theory, rods", [
    ("kirchhoff", [*four_rods()[:3], rod(-0.1, 0.15, diameter_m=0.03)]), ("mindlin", four_rods(diameter_m=0.08))])
def test_rods_bear_their_share_of_a_steady_force_anywhere(theory, rods):
    """Against a static solution of the whole model, and the sum against the force itself."""
    table = plate(rods=rods, max_frequency_Hz=2500.0, theory=theory)
    model = build_model(table)
    places = np.random.default_rng(3).uniform(-0.24, 0.24, (40, 2))
    exact = model.rod_force @ static_response(model, (model.system.deflection(places) @ model.expansion).T.toarray())
    assert exact.sum(axis=0) == pytest.approx(1.0, rel=1e-6)

    def found(residual_points_m):
        modes = plate_modes(table, residual_points_m=residual_points_m)
        assert modes.n_residual == (0 if residual_points_m is None else 4)
        return modes.rod_force @ (modes.shape_at(places) / (2 * np.pi * modes.frequency_Hz) ** 2).T

    assert abs(found(NOWHERE) - exact).max() < 2e-4
    assert abs(found(None) - exact).max() > 0.05 and abs(found(None).sum(axis=0) - 1).max() > 0.02


def test_a_pulse_is_what_light_rods_got_and_the_plate_has_at_any_time():
    table = plate(rods=four_rods(density_kg_m3=1.0), max_frequency_Hz=2500.0, damping_ratio=0.0, theory="kirchhoff")
    step_s, steps = 2e-6, 1500
    pulse = np.where(np.arange(steps) < 100, np.sin(np.pi * (np.arange(steps) + 0.5) / 100), 0.0)
    given = np.append(0, np.cumsum(pulse)) * step_s

    def missing(modes):
        motion, shape = ModalMotion(modes, step_s), modes.shape_at([[0.2, -0.13]])[0]
        amplitude, rate = np.zeros((2, steps + 1, len(shape)))
        for k in range(steps):
            motion.advance(shape * pulse[k])
            amplitude[k + 1], rate[k + 1] = motion.amplitude, motion.rate
        of_rods = cumulative_trapezoid((amplitude @ modes.rod_force.T).sum(axis=1), dx=step_s, initial=0)
        return abs(given - of_rods - modes.mass_kg * rate @ modes.mean_shape).max() / given[-1]

    assert missing(plate_modes(table, residual_points_m=NOWHERE)) < 1e-4
    assert missing(plate_modes(table)) > 0.01


def test_many_loads_have_the_rods_residual_modes_and_few_their_own():
    table = plate(rods=four_rods(), max_frequency_Hz=800.0, theory="kirchhoff")
    places = np.random.default_rng(4).uniform(-0.2, 0.2, (33, 2))
    assert modes_for_loads(table, None, places).n_residual == 4
    few, points = modes_for_loads(table, None, places[:3]), plate_modes(table, residual_points_m=places[:3])
    assert np.array_equal(few.frequency_Hz, points.frequency_Hz) and np.array_equal(few.nodal, points.nodal)


def test_residual_modes_leave_the_others_alone_and_have_low_frequencies():
    """So that a co-step which follows the kept modes follows these too."""
    table = plate(**HELD)
    without, with_them = plate_modes(table), plate_modes(table, residual_points_m=POINTS)
    assert with_them.frequency_Hz[:-2] == pytest.approx(without.frequency_Hz, rel=1e-12)
    assert np.all(with_them.frequency_Hz[-2:] > table.max_frequency_Hz)
    assert np.all(with_them.frequency_Hz[-2:] < 3 * table.max_frequency_Hz)


def test_residual_modes_of_a_free_plate_and_of_a_point_given_twice():
    table = plate(max_frequency_Hz=2500.0)
    modes = plate_modes(table, residual_points_m=[[0.1, 0.0], [0.1, 0.0]])
    assert modes.n_residual == 1
    assert abs(modes.mean_shape[-1]) < 1e-6 * abs(modes.shape[:, -1]).max()  # the rigid-body modes have that


def layer_compliance(table, cut_off):
    """Compliance (m/N) of an elastic layer loaded at its top, beyond that of the half-space, above k = cut_off."""
    t, nu = table.thickness_m, table.poisson_ratio

    def integrand(x):
        s, c = math.sinh(x), math.cosh(x)
        return 2 * (1 - nu**2) / table.youngs_modulus_Pa * ((s * c + x) / (s * s - x * x) - 1)

    return quad(integrand, cut_off * t, 30)[0] / t / (2 * math.pi)


@pytest.mark.parametrize("cut_off", [0.4, 0.6, 0.9, 1.27, 1.6])
def test_load_radius_gives_the_compliance_of_an_elastic_layer(cut_off):
    """What the docstring of residual.py claims, by integrals over the wavenumber of an infinite plate.

    One residual mode from a load on a disc has, at the disc's centre, compliance c1^2 / c2, where c1 is the
    deflection of the centre and c2 that of the disc's mean, both above the cut-off.
    """
    table, t = plate(), 0.02
    radius = LOAD_RADIUS * t

    def mindlin(power):
        def integrand(k):
            disc = 2 * j1(k * radius) / (k * radius)
            return (1 / (bending_stiffness(table) * k**3) + 1 / (shear_stiffness(table) * k)) * disc**power

        return quad(integrand, cut_off / t, 100 / t, limit=2000)[0] / (2 * math.pi)

    assert mindlin(1) ** 2 / mindlin(2) == pytest.approx(layer_compliance(table, cut_off / t), rel=0.17)


def test_residual_compliance_of_a_plate():
    """Averaged over places, since the modes near the limit differ from place to place."""
    table = plate(max_frequency_Hz=12e3, edges="simply_supported")
    places = np.array([[x, y] for x in (-0.15, -0.05, 0.02, 0.12) for y in (-0.1, 0.03, 0.14)])
    modes = plate_modes(table, residual_points_m=places)
    flexibility = modes.shape_at(places)[:, -modes.n_residual :] ** 2
    found = np.sum(flexibility / (2 * np.pi * modes.frequency_Hz[-modes.n_residual :]) ** 2, axis=1).mean()
    assert found == pytest.approx(layer_compliance(table, bending_wavenumber(table, 12e3, "mindlin")), rel=0.2)
    k = bending_wavenumber(table, 12e3, choose_theory(table))
    # far from edges the modes left out add 1 / (4 pi D k^2)
    assert found == pytest.approx(1 / (4 * math.pi * bending_stiffness(table) * k**2), rel=0.3)


def test_karas_plate():
    """Steel ball R 10 mm at 1 m/s on a simply supported plate 200 x 200 x 8 mm (Karas 1939): 1378.3 N, 73.4 us.

    Without the residual mode 85 modes give a force 1 % too high.
    """
    steel = {"youngs_modulus_Pa": 206.8e9, "poisson_ratio": 0.28, "density_kg_m3": 7833.0}
    table = plate(size_m=[0.2, 0.2], thickness_m=0.008, **steel, edges="simply_supported",
                  theory="kirchhoff", max_frequency_Hz=60e3)  # fmt: skip
    place, mass = np.array([[0.0, 0.0]]), 4 / 3 * math.pi * 0.01**3 * 7833
    stiffness = 4 / 3 * 206.8e9 / (2 * (1 - 0.28**2)) * 0.01**0.5
    modes = plate_modes(table, residual_points_m=place)
    peak, rebound, contact_time, _ = impact(modes, place, mass, stiffness, 1.0, 2e-4)
    assert peak == pytest.approx(1378.3, rel=2e-3)
    assert contact_time == pytest.approx(73.4e-6, rel=2e-3)
    assert rebound == pytest.approx(0.664, rel=2e-3)
    without = impact(plate_modes(table), place, mass, stiffness, 1.0, 2e-4)[0]
    assert without > 1378.3 * 1.01


@pytest.mark.slow
def test_energy_left_out_is_what_an_impact_leaves_out():
    """Ball on a plate, its modes cut at 1.5 and 2 kHz, against all that matter: coal of the paper, 234 us."""
    table = plate(rods=four_rods(), max_frequency_Hz=12e3, theory="kirchhoff")
    modes = plate_modes(table)

    def energy(limit_Hz, place):
        kept = modes.frequency_Hz <= limit_Hz
        cut = replace(modes, frequency_Hz=modes.frequency_Hz[kept], nodal=modes.nodal[..., kept])
        return impact(cut, np.array([place]), 0.0903, 1.1575e9, 0.3, 5e-4)[3]

    places = [(x, y) for x in (0.04, 0.12, 0.2) for y in (0.04, 0.12, 0.2) if y <= x]
    whole = sum(energy(12e3, place) for place in places)
    contact_time = 2.943275 * (1.25 * 0.0903 * 0.3**2 / 1.1575e9) ** 0.4 / 0.3
    for limit in (1.5e3, 2e3):
        kept = sum(energy(limit, place) for place in places)
        assert 1 - kept / whole == pytest.approx(energy_left_out(limit, contact_time), rel=0.35)


def test_modes_need_a_cut_off():
    with pytest.raises(ValueError, match="max_frequency_Hz"):
        plate_modes(plate(max_frequency_Hz=None))
