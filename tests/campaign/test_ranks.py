"""A run on two MPI ranks is the run on one, plate and all."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from common.scene.scene import changed_scene
from dem.run.run import run_scene

SMALL = Path(__file__).resolve().parents[2] / "scenes" / "small.toml"


@pytest.mark.slow
@pytest.mark.parametrize(("contact", "subspheres"), [("sub_spheres", 40), ("smooth", 200)])
def test_two_ranks_give_the_signals_of_one(tmp_path, contact, subspheres):
    signals, info = {}, {}
    for ranks in (1, 2):
        scene = changed_scene(SMALL, {
            "ranks": ranks, "time.free_flight_tolerance": 0.0, "time.duration_s": 9e-4, "time.view_interval_s": None,
            "stones.agglomerate.contact": contact, "stones.agglomerate.subspheres": subspheres,
            "stones.agglomerate.unbreakable": True, "plate.max_frequency_Hz": 2000.0})
        info[ranks] = run_scene(scene, "small.toml", tmp_path / f"{ranks}")
        signals[ranks] = pd.read_parquet(tmp_path / f"{ranks}" / "fast.parquet")
    assert info[1]["n_particles"] == info[2]["n_particles"] == 2 * subspheres
    assert info[1]["peak_force_N"] > 1000
    for name in ("force_N", "force_01_N", "force_02_N", "u_m", "a_m_s2"):
        one, two = (signals[ranks][name].to_numpy() for ranks in (1, 2))
        assert np.abs(two - one).max() <= 1e-6 * np.abs(one).max(), name
    assert info[2]["energy"]["closure"] == pytest.approx(info[1]["energy"]["closure"], abs=1e-6)
