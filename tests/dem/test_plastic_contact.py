"""A plate that yields under the stone, through the engine: Thornton's contact, its indentation, and the energy it takes."""

import re

import numpy as np
import pytest
from decks import run_engine
from scenes_of_tests import changed, hertz

from dem.deck.render import write_deck
from dem.run.prepare import prepare
from dem.run.results import read_forces
from dem.run.run import run_scene
from tests.plate_fem.plasticity import PlasticContact

YIELD_STRESS_Pa = 345e6
RADIUS_m = 0.025
HERTZ = hertz("gangue")
LAW = PlasticContact(RADIUS_m, HERTZ["modulus_Pa"], 1.6 * YIELD_STRESS_Pa)


def thornton(speed):
    """Restitution on a rigid plate (Thornton 1997, Eq. 40)."""
    yield_speed = ((np.pi / (2 * LAW.modulus_Pa)) ** 2
                   * np.sqrt(8 * np.pi * RADIUS_m**3 / (15 * HERTZ["mass_kg"])) * LAW.yield_pressure_Pa**2.5)
    q = yield_speed / speed
    return np.sqrt(6 * np.sqrt(3) / 5) * np.sqrt(1 - q**2 / 6) * (q / (q + 2 * np.sqrt(1.2 - 0.2 * q**2))) ** 0.25


@pytest.mark.parametrize("speed", [2.2, 3.0, 20.0])
def test_restitution_is_thorntons_and_the_ledger_has_the_energy(tmp_path, speed):
    scene = changed("hertz_gangue", {"plate.yield_stress_Pa": YIELD_STRESS_Pa, "stones.speed_m_s": speed,
                                     "time.duration_s": 6e-4})
    summary = run_scene(scene, "plastic", tmp_path / "run")
    energy = summary["energy"]
    assert summary["rebound_speed_m_s"][0] / speed == pytest.approx(thornton(speed), rel=1e-4)
    assert energy["plastic_J"] / energy["impact_J"] == pytest.approx(1 - thornton(speed) ** 2, abs=1e-5)
    assert abs(energy["contacts_unexplained_J"]) < 1e-5 * energy["impact_J"]
    assert "contacts yield under stones [1]" in summary["yield"]["verdict"]
    assert summary["yield"]["contact_pressure_Pa"] == pytest.approx([1.6 * YIELD_STRESS_Pa])


def test_a_plate_that_stays_elastic_is_told_so_and_pays_nothing(tmp_path):
    """1 m/s is below the yield speed of 2.1 m/s: the deck is that of a scene without a yield stress."""
    scenes = [changed("hertz_gangue", {"stones.speed_m_s": 1.0, "plate.yield_stress_Pa": stress})
              for stress in (YIELD_STRESS_Pa, 1e12)]
    texts = []
    for k, scene in enumerate(scenes):
        model = prepare(scene, "elastic", None)
        write_deck(tmp_path / str(k), scene, model.assembly, model.step, None)
        texts.append((tmp_path / str(k) / "deck.liggghts").read_text())
    assert texts[0] == texts[1] and "yield_pressure" not in texts[0]
    summary = run_scene(scenes[0], "elastic", tmp_path / "run")
    expected = HERTZ["modulus_Pa"] * 2 / np.pi * np.sqrt(HERTZ["depth_m"] / RADIUS_m) * (1 / 3) ** 0.4
    assert summary["yield"]["contact_pressure_Pa"] == pytest.approx([expected], rel=1e-3)
    assert "contacts stay elastic" in summary["yield"]["verdict"]
    assert summary["energy"]["plastic_J"] == 0


def bounces(directory, gravity, sideways, duration, edit=lambda text: text):
    """The engine with a sphere that falls again and again: step and push of each recorded co-step, and dt."""
    scene = changed("hertz_gangue", {"plate.yield_stress_Pa": YIELD_STRESS_Pa, "stones.speed_m_s": 6.0,
                                     "time.gravity_m_s2": gravity, "time.duration_s": duration})
    model = prepare(scene, "bounces", None)
    write_deck(directory, scene, model.assembly, model.step, None)
    text = (directory / "deck.liggghts").read_text()
    assert text.count("set 0 0 -6.0") == 1
    text = re.sub(r"rows \d+", "rows 1", text)
    text = re.sub("fix monitor.*\n", "", text)  # which knows of no sideways speed
    run_engine(directory, edit(text.replace("set 0 0 -6.0", f"set {sideways} 0 -6.0")))
    pushes = read_forces(directory / "forces.bin")
    return pushes.step, pushes.mean_N, model.step.dt_s


@pytest.mark.parametrize("sideways, same_dent", [(0.0, True), (4.0, False)])
def test_the_dent_is_met_again_where_it_is(tmp_path, sideways, same_dent):
    """A sphere bounces twice. In its own indentation the second impact is elastic; beside it the plate is as new."""
    gravity, duration = 5000.0, 4.5e-3
    steps, force, dt = bounces(tmp_path / "deck", gravity, sideways, duration)
    largest = 0.0

    def push(depth, largest):
        return LAW.loading_N(depth) if depth > largest else LAW.unloading_N(depth, largest)

    depth, speed, piece = -2e-5, 6.0, 5e-8  # leapfrog
    acceleration, expected = gravity, []
    for _ in range(round(duration / piece)):
        speed += 0.5 * piece * acceleration
        depth += piece * speed
        force_now = max(0.0, push(depth, largest))
        largest = max(largest, depth) if same_dent or depth > 0 else 0.0
        acceleration = gravity - force_now / HERTZ["mass_kg"]
        speed += 0.5 * piece * acceleration
        expected.append(force_now)
    at = np.arange(1, len(expected) + 1) * piece
    found = np.zeros(int(steps[-1]) + 1)
    found[steps] = force
    times = np.arange(len(found)) * dt - 0.5 * dt
    second = at > 1.5e-3
    for part in (~second, second):
        peak = max(np.array(expected)[part])
        inside = (times > at[part][0]) & (times < at[part][-1])
        assert found[inside].max() == pytest.approx(peak, rel=1e-3)
    error = np.interp(times, at, expected) - found
    assert np.linalg.norm(error) < 5e-3 * np.linalg.norm(found)


def test_far_from_yield_the_contact_is_the_stock_one_to_the_last_bit(tmp_path):
    def unreachable(text):
        return text.replace("yield_pressure 552000000.0", "yield_pressure 1e12")

    def stock(text):
        return text.replace("yield_pressure 552000000.0", "")

    forces = [bounces(tmp_path / edit.__name__, 9.8, 0.0, 3e-4, edit)[1] for edit in (unreachable, stock)]
    assert len(forces[0]) > 100 and np.array_equal(*forces)


def test_a_bonded_stone_on_a_plate_that_yields_closes(tmp_path):
    """Dashpots and friction off and bonds that hold: contact work is elastic, plastic, or an error."""
    scene = changed("single", {
        "stones.gangue_ratio": 1.0, "stones.agglomerate": {"subspheres": 60, "contact": "sub_spheres", "unbreakable": True},
        "time.duration_s": 1.5e-3, "time.view_interval_s": None, "plate.yield_stress_Pa": YIELD_STRESS_Pa,
        "plate.max_frequency_Hz": 1000.0, "plate.theory": "kirchhoff",
        "contacts": {k: {"restitution": 1.0, "friction": 0.0}
                     for k in ("coal_plate", "gangue_plate", "coal_coal", "coal_gangue", "gangue_gangue")}})
    summary = run_scene(scene, "bonded", tmp_path / "run")
    energy = summary["energy"]
    assert energy["plastic_J"] > 0.01 * energy["impact_J"]
    assert abs(energy["contacts_unexplained_J"]) < 1e-3 * energy["impact_J"]
    assert abs(energy["closure"]) < 1e-3
    assert summary["yield"]["bending"]["von_mises_Pa"] > 1e6


@pytest.mark.parametrize("contact", ["sub_spheres", "smooth"])
def test_friction_on_a_plate_that_yields_closes(tmp_path, contact):
    """A stone that comes sideways: a tangential spring's stiffness goes with the force, not with the depth."""
    scene = changed("single", {
        "stones.count": None, "stones.gangue_ratio": None, "stones.gangue_order": None, "stones.positions_m": None,
        "stones.radius_m": None, "stones.speed_m_s": None,
        "stones.each": [{"material": "coal", "radius_m": 0.025, "place_m": [0.1, 0.0], "velocity_m_s": [0.5, 0.0, -2.0]}],
        "stones.agglomerate": {"subspheres": 8 if contact == "sub_spheres" else 200, "contact": contact, "unbreakable": True},
        "time.duration_s": 6e-4, "time.view_interval_s": None, "assumptions": [], "plate": {
            "size_m": [0.5, 0.5], "density_kg_m3": 7830.0, "youngs_modulus_Pa": 2.07e11, "poisson_ratio": 0.3,
            "yield_stress_Pa": 7.5e7}})
    energy = run_scene(scene, "sideways", tmp_path / "run")["energy"]
    assert energy["plastic_J"] > 0.1 * energy["impact_J"]
    assert abs(energy["closure"]) < 5e-4
