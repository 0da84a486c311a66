"""Data sets of stones that vary: what tells their groups apart, and where and when their stones fell."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from analysis import read_run
from plate_fem.modes import plate_modes
from recognition.estimation.errors import RecognitionError
from recognition.evaluation import read_dataset
from recognition.physics.arrangement_fit import alike
from recognition.physics.arrangement_method import LATEST_FALL_S, ArrangementLikelihood, PlateRecord
from recognition.physics.falls import FallSearch
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
    record = ForceRecord(plate(), Fall(places_m, np.array([0.0, 2.2 * STEP_s])), places_m, 3.0, SAMPLE_s, STEP_s,
                         force_N, np.array([True, False]))
    assert record.from_arrival_N.tolist() == [[0, 1, 2, 3, 4, 5], [8, 9, 10, 11, 0, 0]]


def own_draw(count, seed, tmp, late=0):
    """Records of three stones on places and with arrivals of their own, step by step on the plate's modes. They begin
    `late` steps after the first could arrive."""
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
        values, sd = record(modes, force, 0.01, rng, late, place)
        forces = ForceRecord(table, fall, place, 3.0, SAMPLE_s, STEP_s, force.T, gangue)
        X.append(PlateRecord(values, sd, NAMES, forces, fall))
        ratios.append(gangue.mean())
    return X, np.array(ratios)


@pytest.fixture(scope="module")
def own_falls(tmp_path_factory):
    """A method that learnt from records with falls of their own; other records, and their ratios."""
    tmp = tmp_path_factory.mktemp("modes")
    X, ratios = own_draw(16, 1, tmp)
    chosen, own = alike(X)
    assert own and len(chosen) == 16
    method = ArrangementLikelihood(exact_trigger=True).fit(X, ratios, groups=np.arange(16))
    return method, *own_draw(8, 2, tmp)


def test_where_and_when_stones_fall_is_told_with_each_record(own_falls):
    method, others, truth = own_falls
    answers = method.answer(others)
    assert np.abs([one.ratio for one in answers] - truth).mean() < 0.02
    assert all(one.low <= ratio <= one.high for one, ratio in zip(answers, truth, strict=True))
    wrong = [replace(x, fall=Fall(-x.fall.place_m, x.fall.arrival_s)) for x in others]
    assert all(one.out_of_distribution for one in method.answer(wrong))
    late = [replace(x, fall=Fall(x.fall.place_m, x.fall.arrival_s[::-1])) for x in others]
    assert sum(bool(one.out_of_distribution) for one in method.answer(late)) >= 6


@pytest.mark.slow
def test_where_and_when_stones_fell_is_sought_where_it_is_not_told(own_falls):
    """The records are of the plate's motion in small steps, on another basis than the search has."""
    method, others, truth = own_falls
    search = FallSearch.of(method.model_, LATEST_FALL_S)
    for x in others[:3]:
        found = search.fall(x.signals[:, :method.model_.samples], x.noise, np.arange(len(NAMES)))
        off_m = np.linalg.norm(found.place_m[:, None] - x.fall.place_m, axis=2)
        nearest = off_m.argmin(axis=0)
        assert sorted(nearest) == [0, 1, 2] and off_m.min(axis=0).max() < 5e-3
        assert found.arrival_s[nearest] == pytest.approx(x.fall.arrival_s, abs=2e-5)
    for ratio, answer in zip(truth[3:6], method.answer([replace(x, fall=None) for x in others[3:6]]), strict=True):
        assert answer.ratio == pytest.approx(ratio, abs=0.05) and answer.low <= ratio <= answer.high


@pytest.mark.slow
def test_a_stone_may_have_arrived_before_the_record_begins(own_falls, tmp_path):
    """As it has where the first sample that shows an impact is a little after it."""
    (*_, x), (*_, ratio) = own_draw(8, 2, tmp_path, late=8)
    assert x.fall.arrival_s.min() < 8 * STEP_s
    (answer,) = own_falls[0].answer([replace(x, fall=None)])
    assert answer.ratio == pytest.approx(ratio, abs=0.05) and not answer.out_of_distribution
