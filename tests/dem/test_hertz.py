"""One sphere on a rigid plate against the closed form of Hertz (paper, Eqs. 1-9 as corrected)."""

import numpy as np
import pytest
from decks import Body, deck, run_engine, write_files
from scenes_of_tests import SCENES, hertz

from common.scene.scene import changed_scene, read_scene
from dem.run.results import read_forces
from dem.run.run import resume, run_scene


@pytest.mark.parametrize("material, force_N, time_us", [("coal", 4261.6, 233.9), ("gangue", 7646.3, 226.7)])
def test_hertz_peak_force_contact_time_and_rebound(tmp_path, material, force_N, time_us):
    scene = SCENES / f"hertz_{material}.toml"
    summary = run_scene(read_scene(scene), str(scene), tmp_path / "run")
    assert summary["peak_force_N"] == pytest.approx(force_N, rel=1e-3)
    assert summary["rebound_speed_m_s"][0] == pytest.approx(3.0, rel=1e-3)
    assert contact_time(tmp_path / "run", summary, material) * 1e6 == pytest.approx(time_us, rel=1e-3)
    assert summary["impulse_N_s"] == pytest.approx(summary["momentum_change_kg_m_s"], rel=1e-9)
    assert abs(summary["energy"]["closure"]) < 1e-6


def test_a_row_of_forces_has_the_mean_the_largest_and_the_middle_of_the_push(tmp_path):
    """One row for all of a contact without friction: the sphere slides on at its speed, so the middle of the push is
    where it is half-way through Hertz' contact time."""
    radius_m, gap_m, along_m_s, dt, steps = 3e-3, 1e-6, 2.0, 2e-8, 4000
    body = Body(np.array([[0, 0, radius_m + gap_m]]), np.full(1, radius_m), np.zeros((0, 2), int), np.zeros(0))
    write_files(tmp_path, body)
    plate = (f"fix plate all wall/plate agglomerates agglomerates.txt forces forces.bin extent -1 1 -1 1 co_step 1 rows {steps} "
             "contact model hertz primitive type 2 zplane 0.0\n")
    text = deck(dt, steps, steps, lines=plate, velocity=f"velocity all set {along_m_s} 0 -1 units box\n")
    run_engine(tmp_path, text.replace("0.9 0.9 0.9 0.9", "1 1 1 1"))
    mass, modulus = body.mass_kg[0], 1 / ((1 - 0.25**2) / 5e9 + (1 - 0.3**2) / 2e11)
    stiffness = 4 / 3 * modulus * np.sqrt(radius_m)
    depth_m = (1.25 * mass / stiffness) ** 0.4
    push = read_forces(tmp_path / "forces.bin")
    assert push.largest_N == pytest.approx([stiffness * depth_m**1.5], rel=1e-4)
    assert push.mean_N == pytest.approx([2 * mass / (steps * dt)], rel=1e-4)
    assert push.place_m[0, 0] == pytest.approx(along_m_s * (gap_m + 0.5 * 2.943275 * depth_m), rel=1e-3)


def contact_time(directory, summary, material):
    """From the duration of compression above half the greatest depth.

    With z = depth/greatest depth, z' = -v/d sqrt(1 - z^(5/2)): the time above z = 1/2 over the whole contact time is a
    pure number, here from the same quadrature, so that the step of the output does not blur the ends of the contact.
    """
    import pandas as pd

    fast = pd.read_parquet(directory / "fast.parquet")
    depth = (fast["force_N"].to_numpy() / hertz(material)["stiffness"]) ** (2 / 3)
    t = fast["t_s"].to_numpy() - 0.5 * (fast["t_s"][1] - fast["t_s"][0])  # means over the interval before
    level = 0.5 * hertz(material)["depth_m"]
    above = np.flatnonzero(depth > level)
    first, last = above[0], above[-1]
    start = np.interp(level, depth[[first - 1, first]], t[[first - 1, first]])
    end = np.interp(-level, -depth[[last, last + 1]], t[[last, last + 1]])
    share = _time_above(0.5) / _time_above(0.0)
    return (end - start) / share


def _time_above(z):
    """Integral of dz/sqrt(1 - z^(5/2)) from z to 1, by the substitution z = 1 - s^2 that removes the singularity."""
    s, weight = np.polynomial.legendre.leggauss(60)
    top = np.sqrt(1 - z)
    s = 0.5 * top * (s + 1)
    return 0.5 * top * np.sum(weight * 2 * s / np.sqrt(1 - (1 - s**2) ** 2.5))


def test_the_deck_of_a_bare_sphere_holds_only_what_it_needs(tmp_path):
    from dem.__main__ import main

    assert main(["deck", str(SCENES / "hertz_coal.toml"), "--out", str(tmp_path / "d")]) == 0
    deck = (tmp_path / "d" / "deck" / "deck.liggghts").read_text()
    for absent in ("bond/parallel", "gravity", "tangential", "to_plate", "dump", "coefficientFriction"):
        assert absent not in deck
    assert read_scene(SCENES / "hertz_coal.toml").stones.agglomerate is None


def test_a_run_that_ends_in_the_contact_says_so(tmp_path):
    scene = SCENES / "hertz_coal.toml"
    changed = changed_scene(scene, {"time.duration_s": 1.5e-4, "time.view_interval_s": None})
    assert "ends while stone 1 hits" in run_scene(changed, str(scene), tmp_path / "run")["warnings"][0]


def test_paths_may_be_text_and_values_numpys(tmp_path):
    file = SCENES / "hertz_coal.toml"
    scene = changed_scene(file, {"stones.count": np.int64(1), "stones.positions_m": np.zeros((1, 2)),
                                 "time.anti_alias": np.bool_(False)})
    assert (scene.stones.count, scene.stones.positions_m, scene.time.anti_alias) == (1, ((0.0, 0.0),), False)
    summary = run_scene(scene, file, str(tmp_path / "run"))
    assert resume(str(tmp_path / "run")) == summary
