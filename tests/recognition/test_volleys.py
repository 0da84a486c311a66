"""Stones that fall together, found jointly: on a plate known exactly, with stones of the stored histories."""

import numpy as np
import pandas as pd
import pytest

from recognition.evaluation.stone_histories import histories
from recognition.plate.plate_model import PlateModel
from recognition.stream.bank import LAGS
from recognition.stream.compressed import SAMPLES
from recognition.stream.law_file import load_forces
from recognition.stream.prior import StonePrior
from recognition.stream.recognise import RATE_Hz, recognise_stream
from recognition.stream.signatures import LEAD, Channels
from recognition.stream.simulated import stone_rows, stream_of
from recognition.stream.stones import missed_of

CHANNELS = Channels((0, 1, 2, 3))
COUNTS = (2, 3, 5)
WITHIN_S = 1e-4


@pytest.fixture(scope="module")
def heard():
    """Volleys of two, three and five stones within 0.1 ms, a quarter of a second apart, and what was made of them."""
    rng = np.random.default_rng(1)
    plate = PlateModel.from_scene("scenes/single.toml", 12000.0)
    pool = [h for h in histories("tried") if abs(h.radius_m - 0.025) < 1e-4]
    volley = np.repeat(np.arange(len(COUNTS)), COUNTS)
    place_m = np.array([[-0.15, -0.1], [0.1, 0.12], [0.0, 0.1], [-0.12, -0.12], [0.15, -0.05], [0.02, 0.0], [-0.1, 0.1],
                        [0.1, 0.1], [-0.1, -0.1], [0.12, -0.12]])
    gangue = np.array([1, 0, 0, 1, 1, 0, 1, 0, 1, 0], bool)
    which = np.array([rng.choice([k for k, h in enumerate(pool) if h.gangue == g]) for g in gangue])
    arrival_s = 0.05 + 0.15 * volley + rng.uniform(0, WITHIN_S, len(volley))
    order = np.argsort(arrival_s)
    truth = stone_rows(pool, which[order], arrival_s[order], place_m[order])
    stream = stream_of(plate, CHANNELS, pool, truth, RATE_Hz, 20.0, rng)
    prior = StonePrior(load_forces(), (0.025, 0.025), (2.0, 4.0))
    return truth.assign(volley=volley), recognise_stream(plate, CHANNELS, prior, stream.values, together=True)


@pytest.mark.parametrize("number", range(len(COUNTS)))
def test_stones_of_a_volley(heard, number):
    """All are found where they fell, with their impulses and materials."""
    truth, found = heard[0][heard[0]["volley"] == number], heard[1].stones
    stones = found[(found["t_s"] - truth["t_s"].mean()).abs() < 5e-3]
    assert len(stones) == len(truth)
    apart = np.hypot(*(stones[axis].to_numpy()[None] - truth[axis].to_numpy()[:, None] for axis in ("x_m", "y_m")))
    same = stones.iloc[apart.argmin(axis=1)]
    assert apart.min(axis=1).max() < 0.02
    assert ((same["gangue"] > 0.5).to_numpy() == truth["gangue"].to_numpy()).all()
    assert same["impulse_N_s"].to_numpy() == pytest.approx(truth["impulse_N_s"].to_numpy(), rel=0.2)


def test_a_volley_needs_the_joint_search(heard):
    """The listener leaves the volley of five, and what is then found explains the record."""
    assert heard[1].volleys.windows
    assert (heard[1].stones["together"] > 1).any()
    assert heard[1].refused == ""


def test_compressed_signature_is_the_whole_one_projected(heard):
    """Against the bank's signature in samples."""
    window = heard[1].volleys.windows[0]
    stone = np.array([2.5, np.log(45e-6), 0.0525, -0.0775, -0.4, np.log(0.7)])
    first, whole = window.bank.whole(stone + (window.first + LEAD) * np.eye(6)[0])
    values = np.zeros((window.bank.channels, SAMPLES))
    begin = first - window.first
    values[:, begin:begin + LAGS] = whole.reshape(LAGS, -1).T
    expected = window.compressed.project(values)
    assert np.linalg.norm(window.compressed.signature(stone)[0] - expected) < 0.02 * np.linalg.norm(expected)


def test_derivatives_of_a_compressed_signature(heard):
    compressed = heard[1].volleys.windows[0].compressed
    stone = np.array([2.52, np.log(44e-6), 0.0531, -0.0771, 0.3, np.log(0.7)])
    rows = compressed.signature(stone)
    for k, step in enumerate([1e-2, 1e-3, 1e-4, 1e-4, 0.5, 1e-2]):
        up, down = (compressed.signature(stone + sign * step * np.eye(6)[k])[0] for sign in (1, -1))
        slope = (up - down) / (2 * step)
        assert np.abs(slope - rows[1 + k]).max() < 0.02 * np.abs(slope).max()


def test_stones_found_jointly_are_not_missed():
    """Two stones at once are heard as one only where they are heard one by one."""
    stones = pd.DataFrame({"t_s": 1e-5 * np.arange(10), "together": 10})
    assert missed_of(stones) == 0.0
    assert missed_of(stones.assign(together=1)) == 5.0
