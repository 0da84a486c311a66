"""Data sets of stones that vary: what tells their groups apart, and that methods of known places refuse them."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from analysis import read_run
from plate_fem.modes import plate_modes
from recognition.estimation.errors import RecognitionError
from recognition.evaluation.dataset import read_dataset
from recognition.physics.arrangement_fit import alike
from recognition.physics.arrangement_method import ArrangementLikelihood, PlateRecord
from recognition.physics.force_records import Fall, ForceRecord, fall_of
from tests.analysis.synthetic import write_run
from tests.recognition.test_arrangement_likelihood import LATE, NAMES, SAMPLES, SAMPLE_s, STEP_s, plate, record

SCATTER = {"seed": 3, "arrival_s": [0.0, 0.005]}


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
    with pytest.raises(RecognitionError, match="0 runs whose stones fall at once and on the same places, or all on"):
        alike([empty] * 5)


def test_forces_of_each_stone_are_taken_from_its_arrival_on():
    force_N, places_m = np.arange(12.0).reshape(2, 6), np.zeros((2, 2))
    record = ForceRecord(plate(), None, Fall(places_m, np.array([0.0, 2.2 * STEP_s])), places_m, 3.0, SAMPLE_s, STEP_s,
                         force_N, np.array([True, False]))
    assert record.from_arrival_N.tolist() == [[0, 1, 2, 3, 4, 5], [8, 9, 10, 11, 0, 0]]


def own_draw(count, seed, tmp):
    """Records of three stones on places and with arrivals of their own, step by step on the plate's modes."""
    table, rng, X, ratios = plate(), np.random.default_rng(seed), [], []
    modes = plate_modes(table, tmp, np.empty((0, 2)))
    steps = round((SAMPLES + 2 * LATE) * SAMPLE_s / STEP_s)
    t_s = (np.arange(steps) + 0.5) * STEP_s
    for _ in range(count):
        place = np.column_stack([[-0.08, 0.0, 0.08] + rng.uniform(-0.02, 0.02, 3), rng.uniform(-0.08, 0.08, 3)])
        fall = Fall(place, np.round(rng.uniform(0, 1e-3, 3), 5))
        gangue = rng.permutation(3) < rng.integers(4)
        share = np.clip((t_s[:, None] - fall.arrival_s) / 2.5e-4, 0, 1)
        force = 3000.0 * np.sin(np.pi * share) * np.where(gangue, 1.8, 1.0) * rng.lognormal(0, 0.05, 3)
        values, sd = record(modes, force, 0.01, rng, places_m=place)
        forces = ForceRecord(table, tmp, fall, place, 3.0, SAMPLE_s, STEP_s, force.T, gangue)
        X.append(PlateRecord(values, sd, NAMES, forces, fall))
        ratios.append(gangue.mean())
    return X, np.array(ratios)


def test_where_and_when_stones_fall_is_told_with_each_record(tmp_path):
    X, ratios = own_draw(16, 1, tmp_path)
    others, truth = own_draw(8, 2, tmp_path)
    chosen, own = alike(X)
    assert own and len(chosen) == 16
    method = ArrangementLikelihood(exact_trigger=True).fit(X, ratios, groups=np.arange(16))
    answers = method.answer(others)
    assert np.abs([one.ratio for one in answers] - truth).mean() < 0.02
    assert all(one.low <= ratio <= one.high for one, ratio in zip(answers, truth, strict=True))
    with pytest.raises(RecognitionError, match="does not tell where and when"):
        method.answer([replace(others[0], fall=None)])
    wrong = [replace(x, fall=Fall(-x.fall.place_m, x.fall.arrival_s)) for x in others]
    assert all(one.out_of_distribution for one in method.answer(wrong))
    late = [replace(x, fall=Fall(x.fall.place_m, x.fall.arrival_s[::-1])) for x in others]
    assert sum(bool(one.out_of_distribution) for one in method.answer(late)) >= 6
