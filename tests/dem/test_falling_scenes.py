"""The shipped scenes of what falls, each at small size: they run, and their ledger closes."""

import numpy as np
import pandas as pd
import pytest
from scenes_of_tests import SCENES
from scipy.integrate import cumulative_simpson, cumulative_trapezoid

from common.scene.scene import changed_scene, read_scene
from dem.run.run import run_scene
from dem.stones.arrangement import gangue_ratio, stones_of

COARSE = {"stones.agglomerate.subspheres": 24, "stones.agglomerate.contact": "sub_spheres",
          "plate.max_frequency_Hz": 800.0, "time.view_interval_s": None, "plate.sensors": []}
SMALL = {
    "sizes": {"time.duration_s": 0.023},
    "polyhedra": {"time.duration_s": 2e-3, "stones.count": 4, "stones.agglomerate.subspheres": 100},
    "stream": {"time.duration_s": 0.06, "stones.drawn.arrival_s": [0.0, 0.05], "stones.drawn.rate_1_s": 100.0},
    "caving": {"time.duration_s": 0.05, "stones.drawn.arrival_s": [0.0, 0.04], "stones.drawn.rate_kg_s": 50.0,
               "stones.agglomerate.subspheres": 100, "plate.max_frequency_Hz": 300.0},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(SMALL))
def test_a_shipped_scene_runs_at_small_size(tmp_path, name):
    scene = changed_scene(SCENES / f"{name}.toml", COARSE | SMALL[name])
    summary = run_scene(scene, f"{name}.toml", tmp_path / "run")
    stones = pd.read_parquet(tmp_path / "run" / "stones.parquet")
    listed = stones_of(scene, name)
    assert abs(summary["energy"]["closure"]) < 0.01
    assert len(stones) == len(listed) >= (2 if name == "caving" else 4)
    hit = stones["first_contact_s"].notna()
    assert hit.all() or name in ("stream", "caving")  # a stone may be held up in the air by another
    assert (stones["waited_s"][hit] >= 0).all() and (name == "stream" or (stones["waited_s"] == 0).all())
    spins = np.array([any(one.spin_rad_s) or one.shape != "sphere" for one in listed])
    late = (stones["first_contact_s"] - stones["arrival_s"] - stones["waited_s"])[hit & ~spins]
    assert np.all(late.abs() < 2e-3)  # coarse packings reach the plate later than their sphere


@pytest.mark.slow
@pytest.mark.parametrize("damping_ratio", [0.0, 0.9])
def test_a_stream_pushes_the_plate_as_much_as_it_pushes_its_rods(tmp_path, damping_ratio):
    """Forty stones, more than have residual modes of their own, on a plate of few modes."""
    scene = changed_scene(SCENES / "stream.toml", COARSE | {
        "stones.agglomerate": None, "stones.drawn.least_fragment": None, "stones.drawn.rate_1_s": 1000.0,
        "stones.drawn.arrival_s": [0.0, 0.04], "time.duration_s": 0.05,
        "plate.damping_ratio": damping_ratio})
    run = run_scene(scene, "stream", tmp_path / "run")
    impulse, on_rods, *others = (run[key] for key in ("impulse_N_s", "rod_impulse_N_s", "plate_momentum_kg_m_s",
                                                      "rods_momentum_kg_m_s", "damping_impulse_N_s"))
    assert len(stones_of(scene, "stream")) == 40 and len(on_rods) == 4
    assert sum(on_rods) - sum(others) == pytest.approx(impulse, rel=1e-3) and run["momentum_missing"] < 1e-3
    assert abs(sum(others)) > 5e-3 * impulse  # the plate still moves
    stones, left = (pd.read_parquet(tmp_path / "run" / f"{name}.parquet") for name in ("stones", "left"))
    here, g = stones[stones["waited_s"].notna()], scene.time.gravity_m_s2 * np.cos(np.radians(scene.plate.tilt_deg))
    end_s = run["steps"] * run["dt_s"]
    fallen_s = end_s - here["arrival_s"] - here["waited_s"]
    down = here["mass_kg"] @ (g * fallen_s - here["velocity_z_m_s"]) - g * left["mass_kg"] @ (end_s - left["t_s"])
    up = (stones["mass_kg"] * run["rebound_speed_m_s"])[here.index].sum()
    assert down + up == pytest.approx(impulse, rel=1e-9) and here["waited_s"].max() > 1e-3


@pytest.mark.parametrize("damping_ratio", [0.01, 0.9])
def test_a_stone_on_a_rod_pushes_as_much_as_rods_plate_and_damping_have(tmp_path, damping_ratio):
    """At each row; without residual modes of the rods a tenth of the impulse is missing."""
    scene = changed_scene(SCENES / "small.toml", {
        "stones.agglomerate": None, "stones.count": 1, "stones.gangue_ratio": 0.0, "stones.gangue_order": [1],
        "stones.positions_m": [[0.2, 0.2]], "plate.max_frequency_Hz": 4000.0,
        "plate.damping_ratio": damping_ratio, "time.duration_s": 4e-3, "time.view_interval_s": None})
    run = run_scene(scene, "small", tmp_path / "run")
    fast = pd.read_parquet(tmp_path / "run" / "fast.parquet")
    rods_N, dt_s = fast[[f"rod_{k}_N" for k in range(1, 5)]].sum(axis=1), fast["t_s"][1]
    plate = 0.5 * 0.5 * 0.02 * 7830.0 * fast["v_m_s"] + fast["rods_momentum_kg_m_s"] + fast["damping_impulse_N_s"]
    plain, smooth = ((fast["force_N"].cumsum() * dt_s + rule(rods_N, dx=dt_s, initial=0) + plate).abs().max()
                     for rule in (cumulative_trapezoid, cumulative_simpson))
    assert smooth < 0.2 * plain < 2e-4 * run["impulse_N_s"]
    assert run["momentum_missing"] == pytest.approx(smooth / run["impulse_N_s"], rel=1e-6)


BUFFER = {"place_m": [0.0, 0.0], "diameter_m": 0.02, "length_m": 0.1, "youngs_modulus_Pa": 3e6, "density_kg_m3": 1200.0}


@pytest.mark.parametrize("rods, rel", [(None, 1e-9), ([BUFFER], 0.01)], ids=["free", "soft"])
def test_a_plate_that_next_to_nothing_holds_takes_the_whole_impulse(tmp_path, rods, rel):
    """On the buffer it rocks and sways more slowly than modes are told from rigid motion."""
    scene = changed_scene(SCENES / "small.toml", {
        "stones.agglomerate": None, "plate.rods": rods, "plate.max_frequency_Hz": 3000.0, "time.duration_s": 2e-3,
        "time.view_interval_s": None})
    run = run_scene(scene, "small", tmp_path / "run")
    last = pd.read_parquet(tmp_path / "run" / "fast.parquet").iloc[-1]
    assert -0.5 * 0.5 * 0.02 * 7830.0 * last["v_m_s"] == pytest.approx(run["impulse_N_s"], rel=rel)
    assert run.get("momentum_missing", 0.0) < 1e-5
    assert abs(run["energy"]["closure"]) < 1e-4 and run["impulse_N_s"] > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("sample_s, missing", [(1.5e-4, (0.01, 0.03)), (5e-5, (1e-5, 1e-3))])
def test_the_rods_push_of_a_tiny_stone_needs_more_rows_and_says_so(tmp_path, sample_s, missing):
    """Its contact lasts two rows of 5 us."""
    scene = changed_scene(SCENES / "small.toml", {
        "stones.agglomerate": None, "stones.count": 1, "stones.gangue_ratio": 0.0, "stones.gangue_order": [1],
        "stones.positions_m": [[0.2, 0.2]], "stones.radius_m": 1e-3, "plate.max_frequency_Hz": 20e3,
        "time.duration_s": 3e-4, "time.sample_interval_s": sample_s, "time.view_interval_s": None})
    run = run_scene(scene, "small", tmp_path / "run")
    assert missing[0] < run["momentum_missing"] < missing[1]
    assert any("time.sample_interval_s" in line for line in run["warnings"]) == (missing[0] == 0.01)


def test_the_stream_is_what_was_asked_for():
    scene = read_scene(SCENES / "stream.toml")
    stones = stones_of(scene, "stream")
    size = 2 * np.array([one.radius_m for one in stones])
    mass = np.array([np.pi / 6 * d**3 * scene.materials[one.material].density_kg_m3 for d, one in zip(size, stones)])
    assert len(stones) == 100 and 0.02 <= size.min() and size.max() <= 0.06 and scene.plate.tilt_deg == 20.0
    assert max(one.arrival_s for one in stones) <= 2.0
    assert gangue_ratio(scene, stones, mass) == pytest.approx(0.3, abs=0.005)
