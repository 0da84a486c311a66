"""Data sets of stones that vary: what tells their groups apart, and that methods of known places refuse them."""

import json

import numpy as np
import pandas as pd
import pytest

from analysis import read_run
from recognition.estimation.errors import RecognitionError
from recognition.evaluation.dataset import read_dataset
from recognition.physics.arrangement_fit import alike
from recognition.physics.arrangement_method import PlateRecord
from recognition.physics.force_records import fall_of
from tests.analysis.synthetic import write_run

SCATTER = {"seed": 3, "arrival_s": {"uniform": [0.0, 0.005]}}


def write_drawn(directory, ratio, group, speed_m_s, scene):
    """A run of drawn stones: speeds and places are in stones.parquet alone."""
    run = write_run(directory / "natural" / f"{group:03d}" / f"ratio_{round(100 * ratio):03d}", ratio, seed=group)
    info = json.loads((run / "run.json").read_text())
    stones = {key: value for key, value in info["scene"]["stones"].items() if key != "speed_m_s"} | {
        "gangue_order": [], "seed": 100 + group}
    plate = info["scene"]["plate"] | {"damping_ratio": 0.01}
    (run / "run.json").write_text(json.dumps(info | {"scene": info["scene"] | {"stones": stones, "plate": plate} | scene}))
    down = -speed_m_s * np.ones(10)
    pd.DataFrame({"velocity_x_m_s": 0 * down, "velocity_y_m_s": 0 * down, "velocity_z_m_s": down,
                  "place_x_m": np.arange(10.0), "place_y_m": 0.0,
                  "arrival_s": 0.001 if "scatter" in scene else 0.0}).to_parquet(run / "stones.parquet")
    return run


def test_drawn_stones_have_their_mean_speed_and_each_group_is_its_own(tmp_path):
    for group in range(3):
        for ratio in (0.2, 0.6):
            write_drawn(tmp_path, ratio, group, 2.0 + group, {})
    data = read_dataset(tmp_path)
    assert not data.passed_over and data.table["speed_m_s"].tolist() == [2.0, 2.0, 3.0, 3.0, 4.0, 4.0]
    assert data.table["kin"].nunique() == 3 and data.table.groupby("group")["kin"].nunique().max() == 1


def test_stones_that_arrive_as_scattered_do_not_fall_at_once(tmp_path):
    at_once, scattered = (read_run(write_drawn(tmp_path, 0.2, group, 3.0, scene))
                          for group, scene in enumerate(({}, {"scatter": SCATTER})))
    assert fall_of(at_once).at_once and fall_of(scattered).arrival_s == pytest.approx(0.001)
    empty = PlateRecord(np.zeros((1, 4)), np.ones(1), ("a",), None)
    with pytest.raises(RecognitionError, match="0 runs with forces of as many stones"):
        alike([empty] * 5)
