"""What the noise of a record's sensors adds to an interval, against records whose noise is known."""

import numpy as np
import pandas as pd
import pytest

from recognition.estimation.answer import answers_within
from recognition.estimation.errors import NotRecognised
from recognition.estimation.noise import COPIES, noise_of, noisy_copies

T = np.arange(2000) / 6667
SMOOTH = pd.DataFrame({"t_s": T, "a": np.sin(300 * T), "b": 5 * np.cos(100 * T)})


def test_copies_have_the_noise_of_the_record_once_more_and_are_the_same_again():
    rng = np.random.default_rng(1)
    noisy = SMOOTH.assign(a=SMOOTH["a"] + 0.05 * rng.standard_normal(T.size))
    record, *copies = noisy_copies(noisy)
    assert record is noisy and len(copies) == COPIES
    added = np.array([(one - noisy)[["a", "b"]].std() for one in copies])
    assert added[:, 0] == pytest.approx(0.05, rel=0.15) and np.all(added[:, 1] < 1e-3)
    pd.testing.assert_frame_equal(copies[3], noisy_copies(noisy)[4])
    assert copies[0]["t_s"].equals(noisy["t_s"]) and not copies[0]["a"].equals(copies[1]["a"])
    assert noise_of(noisy[["a"]].to_numpy().T) == pytest.approx([0.05], rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, 0.1, 0.3])
def test_an_interval_by_the_power_of_a_signal_holds_whatever_the_noise(noise):
    """Noise raises the mean square, always: the ratio, which is it over that of a ratio of 1, is off by a bias."""
    rng, held = np.random.default_rng(2), []
    for _ in range(100):
        ratio = rng.uniform(0.2, 1)
        sine = np.sin(2 * np.pi * 15 * np.arange(T.size) / T.size)
        signal = pd.DataFrame({"t_s": T, "a": np.sqrt(2 * ratio) * sine + noise * rng.standard_normal(T.size)})
        x = np.array([[np.mean(one["a"] ** 2)] for one in noisy_copies(signal)])
        (answer,) = answers_within(0.002, lambda f: float(f[0]), [x])
        held.append(answer.low <= ratio <= answer.high)
        assert answer.high - answer.low < 0.01 + 6 * noise**2 + 0.2 * noise
    assert np.mean(held) >= 0.9


def test_where_more_noise_leaves_no_answer_the_interval_is_all():
    def root(x):
        if x[0] > 1:
            raise NotRecognised("no root")
        return float(x[0])

    given = [np.array([[0.5], [2.0], [2.0]]), np.array([[2.0], [0.5]]), np.array([[0.5]])]
    wide, none, alone = answers_within(0.1, root, given)
    assert wide.high - wide.ratio > 1.6 and none.reason == "no answer: no root" and alone.high == pytest.approx(0.6)
