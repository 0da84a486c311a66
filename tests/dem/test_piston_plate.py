"""A stone on a plate with one motion, free of springs: two bodies, whose collision is known."""

import re

import numpy as np
import pytest
from scenes_of_tests import changed, hertz
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from test_smooth_contact import RADIUS_m, stone

import dem.deck.render
import dem.run.participants
import dem.run.results
from common.files.cache import user_cache
from dem.coupling.pipes import PlatePipes
from dem.deck.contact import damping_ratio
from dem.run.prepare import prepare
from dem.run.run import run_prepared
from plate_fem.impact import plate_mobility_1_kg
from plate_fem.modes import PlateModes

PLATE_kg, SLOW_Hz = 0.2, 0.1
PLATE = changed("single", {}).plate.model_copy(update={"max_frequency_Hz": 2000.0})


def plate_that_moves(by_y_1_m=0.0, length_m=0.5, width_m=0.5, rests_at_m=0.0):
    """One mode of a plate that hangs free: all of it moves up alike, or, `by_y_1_m` times y, rocks about a line along x
    that rests at y = `rests_at_m`."""
    x, y = (side * np.linspace(-0.5, 0.5, 5) for side in (length_m, width_m))
    nodal = np.zeros((4, 25, 1))
    nodal[0, :, 0] = (np.tile((y - rests_at_m) * by_y_1_m, 5) if by_y_1_m else 1) / np.sqrt(PLATE_kg)
    nodal[2] = by_y_1_m / np.sqrt(PLATE_kg)
    return PlateModes(
        frequency_Hz=np.array([SLOW_Hz]), damping_ratio=np.zeros(1), lines_x_m=x, lines_y_m=y, nodal=nodal,
        mean_shape=nodal[0].mean(axis=0), rod_force=np.zeros((0, 1)), surface_stress=np.zeros((25, 3, 1)),
        mass_kg=PLATE_kg, theory="mindlin", n_residual=0)


def run_on(modes, directory, scene):
    model = prepare(scene, "piston", user_cache())
    model.modes = modes
    return run_prepared(model, directory)


def test_all_stones_push_a_plate_that_hangs_free():
    """Pushed with 1 N by each of three stones it accelerates by 3 N over its mass."""
    assert plate_mobility_1_kg(plate_that_moves(), np.array([[0.1, 0.0], [-0.2, 0.1], [0.0, 0.0]])) == pytest.approx(3 / PLATE_kg)


def test_the_dashpot_of_a_smooth_stone_feels_how_fast_the_plate_gives_way(tmp_path):
    """Beside a naive integration of two masses with Hertz' spring and the stone's dashpot between them."""
    restitution, speed = 0.3, 3.0
    found = run_on(plate_that_moves(), tmp_path / "run", stone(
        200, speed_m_s=speed, restitution=restitution, plate=PLATE.model_dump(mode="json"),
        **{"time.duration_s": 6e-4, "time.sample_interval_s": 6e-5}))
    k, m = hertz("coal")["stiffness"], hertz("coal")["mass_kg"]

    def rates(_, y):
        d = max(y[0], 0)
        spring, dashpot = k * d**1.5, 2 * np.sqrt(5 / 6) * damping_ratio(restitution) * np.sqrt(1.5 * k * np.sqrt(d) * m)
        push = spring + max(dashpot * (y[1] + y[2]), -spring)
        return [y[1] + y[2], -push / m, -push / PLATE_kg]
    y = solve_ivp(rates, (0, 6e-4), [0, speed, 0], rtol=1e-9, atol=1e-12, max_step=1e-6).y[:, -1]
    assert found["rebound_speed_m_s"][0] == pytest.approx(-y[1], abs=0.005 * speed)
    assert found["energy"]["plate_work_J"] == pytest.approx(0.5 * PLATE_kg * y[2] ** 2, rel=0.005)


def test_a_plate_that_is_not_square_moves_under_the_stone_as_its_shape_says(tmp_path):
    """It rocks, elastically struck at y: the plate weighs M/(c y)^2 there."""
    y_m, per_m, speed, length_m, width_m = 0.08, 10.0, 3.0, 0.5, 0.22
    scene = changed("elastic_plate", {"stones.positions_m": [[0.1, y_m]], "time.gravity_m_s2": None,
                                      "plate.size_m": [length_m, width_m], "plate.sensors": None,
                                      "plate.rods": None, "plate.max_frequency_Hz": 2000.0, "time.duration_s": 6e-4, "time.sample_interval_s": 6e-5})
    found = run_on(plate_that_moves(per_m, length_m, width_m), tmp_path / "run", scene)
    m, there = hertz("gangue")["mass_kg"], PLATE_kg / (per_m * y_m) ** 2
    assert found["rebound_speed_m_s"][0] == pytest.approx(speed * (there - m) / (there + m), rel=0.005)
    assert found["energy"]["plate_work_J"] == pytest.approx(2 * there * (m * speed / (m + there)) ** 2, rel=0.005)


def test_what_reaches_over_the_edge_pushes_the_edge(tmp_path):
    """The plate rocks about its edge, beyond which a stone falls by 1 mm: it is as if it were held, and reflects the stone
    about the line from the edge to its centre."""
    velocity, width_m, beside_m, gap_m = np.array([0, 1.0, -3.0]), 0.22, 1e-3, 3.6e-3
    volley = dict.fromkeys(("count", "positions_m", "radius_m", "speed_m_s", "gangue_ratio", "gangue_order",
                            "coal", "gangue"))
    one = {"material": "gangue", "radius_m": RADIUS_m, "place_m": [0.1, 0.11 + beside_m - gap_m / 3],
           "velocity_m_s": velocity.tolist()}
    scene = changed("elastic_plate", {
        **{f"stones.{key}": value for key, value in volley.items()}, "stones.each": [one], "stones.seed": 1, "stones.gap_m": gap_m,
        "contacts.gangue_plate.friction": 0.0, "time.gravity_m_s2": None, "plate.size_m": [0.5, width_m], "plate.sensors": None,
        "plate.rods": None, "plate.max_frequency_Hz": 2000.0, "time.duration_s": 1.8e-3, "time.sample_interval_s": 6e-5})
    found = run_on(plate_that_moves(1000.0, 0.5, width_m, 0.11), tmp_path / "run", scene)
    away = np.array([0, beside_m / RADIUS_m, np.sqrt(1 - (beside_m / RADIUS_m) ** 2)])
    assert found["rebound_speed_m_s"][0] == pytest.approx((velocity - 2 * velocity @ away * away)[2], rel=0.01)
    assert found["energy"]["plate_work_J"] < 1e-6 * found["energy"]["impact_J"]


def test_between_messages_the_plate_moves_with_its_acceleration(tmp_path, monkeypatch):
    """A plate that rises by a t^2/2, answered every 13 us, strikes a sphere at rest. Seen from the plate it falls by the gap g
    and its approach d: 2/5 K d^(5/2) = m a (g + d) at the deepest."""
    rise_m_s2, gap_m = 4e4, 6e-5
    monkeypatch.setattr("dem.deck.time_step.FAST_Hz", 75e3)
    scene = changed("elastic_plate", {
        "stones.speed_m_s": 1e-6, "stones.gap_m": gap_m, "time.gravity_m_s2": None, "plate.sensors": None, "plate.rods": None, "plate.max_frequency_Hz": 2000.0,
        "time.time_step_s": 1e-7, "time.co_step": 400, "time.duration_s": 4e-4, "time.sample_interval_s": 4e-4,
            "time.view_interval_s": None})
    model = prepare(scene, "piston", user_cache())
    model.modes = plate_that_moves()

    class Rising(PlatePipes):
        def answer(self, step, reach_m, amplitude, rate):
            t, one = (step + model.step.co_step) * model.step.dt_s, np.sqrt([PLATE_kg])
            super().answer(step, 1e-3, one * rise_m_s2 * t**2 / 2, one * rise_m_s2 * t)

    render = dem.deck.render.render
    monkeypatch.setattr(dem.deck.render, "render", lambda *given: re.sub(r"fix monitor .*\n", "", render(*given)))
    monkeypatch.setattr(dem.run.participants, "PlatePipes", Rising)
    monkeypatch.setattr(dem.run.participants, "PlateMonitor", lambda *given: lambda *seen: None)
    monkeypatch.setattr(dem.run.results, "check_closure", lambda energy: None)  # what lifts the plate is in no ledger
    found = run_prepared(model, tmp_path / "run")
    law = hertz("gangue")
    k, weight = law["stiffness"], law["mass_kg"] * rise_m_s2
    deepest = brentq(lambda d: 0.4 * k * d**2.5 - weight * (gap_m + d), 1e-5, 1e-2, xtol=1e-12)
    pressure = 2 * law["modulus_Pa"] / np.pi * np.sqrt(deepest / RADIUS_m)
    assert model.step.co_step * model.step.dt_s > 1e-5
    assert found["yield"]["contact_pressure_Pa"][0] == pytest.approx(pressure, rel=1e-5)
