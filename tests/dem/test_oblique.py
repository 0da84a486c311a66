"""An unbonded sphere on a rigid plate, obliquely or with a dashpot: what LIGGGHTS' contact does, and what it does not."""

import numpy as np
import pandas as pd
import pytest
from decks import DUMP_NUMBERS, DUMPED, frames, run_engine
from scenes_of_tests import changed, hertz, one_by_one

from dem.deck.render import write_deck
from dem.run.prepare import prepare
from dem.run.run import run_scene

FRICTION, DOWN_m_s, RADIUS_m, DENSITY_kg_m3 = 0.4, 3.0, 0.025, 1380.0
STONE, PLATE = (5.12e9, 0.3), (2.07e11, 0.3)


def kept_by_annuli(along_m_s, rings=200, steps=4000):
    """Sideways speed after the hit over that before, with partial slip (Maw, Barber and Fawcett 1976), by Popov's and
    Hess' one-dimensional foundation, which is exact for Mindlin's contact."""
    modulus = 1 / sum((1 - nu**2) / E for E, nu in (STONE, PLATE))
    shear = 1 / sum((2 - nu) * (1 + nu) / (2 * E) for E, nu in (STONE, PLATE))
    mass = DENSITY_kg_m3 * 4 / 3 * np.pi * RADIUS_m**3
    deepest = (15 * mass * DOWN_m_s**2 / (16 * modulus * np.sqrt(RADIUS_m))) ** 0.4
    reach = 1.02 * np.sqrt(RADIUS_m * deepest)
    x, width, dt = (np.arange(rings) + 0.5) / rings * reach, 2 * reach / rings, 2.94 * deepest / DOWN_m_s / steps
    depth, down, along, surface, stretch = 0.0, DOWN_m_s, along_m_s, along_m_s, np.zeros(rings)
    while depth >= 0:
        pressed = np.maximum(depth - x**2 / RADIUS_m, 0)
        most = FRICTION * modulus / shear * pressed
        stretch = np.clip(stretch + surface * dt, -most, most)
        rubbed = shear * width * stretch.sum() / mass * dt
        along, surface = along - rubbed, surface - 3.5 * rubbed
        down -= modulus * width * pressed.sum() / mass * dt
        depth += down * dt
    return along / along_m_s


@pytest.mark.parametrize(("along", "least", "most"), [(0.25, 0, 0.25), (1.0, 0, 0.25), (6.25, -1e-3, 1e-3)])
def test_a_sphere_that_sticks_keeps_more_of_its_sideways_speed_and_one_that_slides_as_much(tmp_path, along, least, most):
    """`along`: sideways speed over friction and speed of fall."""
    along_m_s = along * FRICTION * DOWN_m_s
    scene = one_by_one(changed("hertz_coal", {"contacts.coal_plate.friction": FRICTION}),
                       velocity_m_s=[[along_m_s, 0.0, -DOWN_m_s]])
    one = prepare(scene, "scene", tmp_path)
    write_deck(tmp_path / "deck", one.scene, one.assembly, one.step, one.modes)
    text, end = (tmp_path / "deck" / "deck.liggghts").read_text(), one.step.steps
    run_engine(tmp_path / "deck", text.replace("\nrun  ", f"\ndump end all custom {end} view.dump id {DUMPED}\n"
                                               f'dump_modify end format "%d{DUMP_NUMBERS}"\nrun  '))
    kept = frames(tmp_path / "deck").v[-1, 0, 0] / along_m_s
    assert least <= kept - kept_by_annuli(along_m_s) <= most


def test_a_dashpot_pulls_a_sphere_at_last_and_its_rebound_and_impulse_are_right(tmp_path):
    found = run_scene(changed("hertz_coal", {"contacts.coal_plate.restitution": 0.5}), "scene", tmp_path / "run")
    force = pd.read_parquet(tmp_path / "run" / "fast.parquet")["force_N"]
    assert found["rebound_speed_m_s"][0] == pytest.approx(0.5 * DOWN_m_s, rel=1e-3)
    assert found["impulse_N_s"] == pytest.approx(1.5 * DOWN_m_s * DENSITY_kg_m3 * 4 / 3 * np.pi * RADIUS_m**3, rel=1e-3)
    assert -0.14 < force.min() / force.max() < -0.1 and force.max() < hertz("coal")["force_N"]
