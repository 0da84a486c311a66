"""Stones on a tilted rigid plate, against the closed forms of sliding and rolling, and the energy ledger."""

import numpy as np
import pandas as pd
import pytest
from scenes_of_tests import SCENES

from common.scene.scene import changed_scene
from dem.run.run import run_scene
from dem.stones.arrangement import stones_of

G = 9.8
RADIUS_m, DURATION_s = 0.01, 0.06


def down_the_slope(tmp_path, tilt_deg, friction, **changes):
    """Final velocity along x of a sphere set down at rest, over the time since it lies, and the run's energies."""
    base = changed_scene(SCENES / "hertz_coal.toml", {})
    soft = base.materials["coal"].model_dump() | {"youngs_modulus_Pa": 5e6}  # few steps
    scene = changed_scene(SCENES / "hertz_coal.toml", {
        "materials.coal": soft, "plate.tilt_deg": tilt_deg, "plate.size_m": [1.0, 0.5], "time.gravity_m_s2": G,
        "stones.radius_m": RADIUS_m, "stones.speed_m_s": 0.0, "stones.gap_m": 1e-7, "time.duration_s": DURATION_s,
        "contacts.coal_plate": {"restitution": 0.1, "friction": friction}, "time.time_step_s": 1e-6,
        "stones.agglomerate": None} | changes)
    summary = run_scene(scene, "scene", tmp_path / f"run{tilt_deg}_{friction}")
    return summary, pd.read_parquet(tmp_path / f"run{tilt_deg}_{friction}" / "energy.parquet")


@pytest.mark.parametrize("tilt_deg, friction, share", [(20.0, 0.0, 1.0), (20.0, 0.5, 5 / 7), (40.0, 0.1, None)])
def test_a_sphere_slides_or_rolls_down_as_fast_as_the_closed_form_says(tmp_path, tilt_deg, friction, share):
    """Without friction a = g sin; rolling needs friction of 2/7 tan a and has a = 5/7 g sin a; below that it slides with
    a = g (sin a - mu cos a) and spins up by 5/2 mu g cos a / R."""
    angle = np.radians(tilt_deg)
    if share is None:
        acceleration = G * (np.sin(angle) - friction * np.cos(angle))
        spin_up = 2.5 * friction * G * np.cos(angle) / RADIUS_m
    else:
        acceleration = share * G * np.sin(angle)
        spin_up = acceleration / RADIUS_m if friction else 0.0
    summary, energy = down_the_slope(tmp_path, tilt_deg, friction)
    mass = 1380.0 * 4 / 3 * np.pi * RADIUS_m**3
    t = energy["t_s"].to_numpy()
    expected_J = mass * (0.5 * acceleration**2 + 0.2 * RADIUS_m**2 * spin_up**2) * t**2
    late = t > 0.3 * DURATION_s
    assert energy["kinetic_J"].to_numpy()[late] == pytest.approx(expected_J[late], rel=0.02)
    fallen_J = mass * G * np.sin(angle) * acceleration * t[late] ** 2 / 2
    lost_J = -energy["potential_J"].to_numpy()[late]  # besides what it sinks into the contact, once
    assert lost_J - lost_J[0] == pytest.approx(fallen_J - fallen_J[0], rel=0.02, abs=0.01 * fallen_J[-1])
    assert abs(summary["energy"]["closure"]) < 0.005


def test_a_tilt_is_the_same_as_a_turned_frame():
    """A stone that falls straight down on a tilted plate comes with the same velocity components and gravity."""
    scene = changed_scene(SCENES / "hertz_coal.toml", {"plate.tilt_deg": 30.0, "time.gravity_m_s2": G})
    assert scene.gravity_vector_m_s2 == pytest.approx((G / 2, 0.0, -G * np.sqrt(3) / 2))

    assert stones_of(scene, "scene")[0].velocity_m_s == pytest.approx((1.5, 0.0, -1.5 * np.sqrt(3)))


@pytest.mark.slow
def test_bonded_stones_bounce_down_a_tilted_plate(tmp_path):
    """In free flight and in the arrays: the ledger closes, and what leaves the plate moves towards +x."""
    changes = {"plate": {"size_m": [0.5, 0.5], "density_kg_m3": 7830.0,
                         "youngs_modulus_Pa": 2.07e11, "poisson_ratio": 0.3, "tilt_deg": 25.0},
               "time.duration_s": 0.05, "stones.speed_m_s": 1.0, "stones.agglomerate.unbreakable": True, "time.view_interval_s": None}
    scene = changed_scene(SCENES / "small.toml", changes)
    summary = run_scene(scene, "scene", tmp_path / "run")
    brute = run_scene(changed_scene(SCENES / "small.toml", changes | {"time.free_flight_tolerance": 0.0}), "scene",
                      tmp_path / "brute")
    assert abs(summary["energy"]["closure"]) < 0.01
    assert summary["energy"]["potential_J"] == pytest.approx(brute["energy"]["potential_J"], rel=0.02)
