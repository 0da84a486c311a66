"""The least error against errors that were made, and against closed forms."""

import numpy as np
import pandas as pd
import pytest

from lab.recognition.error_bounds import (
    TRUE_IMPULSE,
    bounds,
    least_error_points,
    true_impulse_errors_points,
)
from recognition import RecognitionError
from recognition.evaluation.dataset import read_dataset
from recognition.physics.arrangement_likelihood import ArrangementEstimate
from recognition.regression.ratio_law import RatioLaw, fit_law
from tests.analysis import synthetic
from tests.recognition.draws import draws, noisy


def straight(slope, variance):
    """One component that goes linearly with the ratio, 0..1."""
    return RatioLaw(np.ones(1), np.zeros(1), np.ones((1, 1)), np.array([[0.0], [1.0]]), np.array([[0.0], [slope]]),
                    np.array([variance]), np.zeros(1), np.ones(1))


def test_least_error_of_a_straight_law_in_closed_form():
    """x = 2 s (b - 1/2) + e: sigma_b = sigma/(2 s), and sqrt(2/pi) of it on average."""
    expected = 100 * np.sqrt(2 / np.pi) * 0.3 / (2 * 5.0)
    assert least_error_points(straight(5.0, 0.09), None, True) == pytest.approx(expected, rel=1e-9)
    noise = 10 ** (-20 / 20)
    both = 100 * np.sqrt(2 / np.pi) * np.hypot(0.3, noise) / (2 * 5.0)
    assert least_error_points(straight(5.0, 0.09), 20.0, True) == pytest.approx(both, rel=1e-9)
    assert least_error_points(straight(5.0, 0.09), None, False) == 0


@pytest.mark.parametrize("db", [None, 20.0])
def test_the_estimate_by_the_law_comes_near_and_does_not_pass_it(db):
    X, y, _ = draws(300, 21)
    Xt, yt, _ = draws(400, 22)
    law = fit_law(X, y)
    found = np.array([law.estimate(x).theta[0] for x in (Xt if db is None else noisy(Xt, db))])
    error = 100 * np.abs(found - yt).mean()
    least = least_error_points(law, db, True)
    assert 0.85 * least < error < 1.3 * least


def test_no_answer_has_a_smaller_absolute_error_than_the_median():
    """Of random probabilities over eleven ratios, against every answer in steps of 0.1 points."""
    rng, ratios = np.random.default_rng(4), np.linspace(0, 1, 11)
    answers = np.linspace(0, 1, 1001)
    for probability in rng.dirichlet(np.full(11, 0.3), 50):
        loss = np.abs(answers[:, None] - ratios) @ probability
        median = ArrangementEstimate(probability, 1.0, 0.0, 0.0, 0.0).median
        assert np.abs(median - ratios) @ probability == pytest.approx(loss.min(), abs=1e-9)


def test_errors_by_the_impulse_are_those_of_its_scatter():
    """J = 4 + 2 b with scatter of 0.1: 5 points of standard deviation."""
    rng = np.random.default_rng(3)
    ratio = rng.uniform(0, 1, 600)
    impulse = 4 + 2 * ratio + 0.1 * rng.standard_normal(600)
    error = true_impulse_errors_points(impulse, ratio, np.arange(600) // 10)
    assert error.std() == pytest.approx(5.0, rel=0.1)
    with pytest.raises(RecognitionError, match="2 groups; needs at least 3"):
        true_impulse_errors_points(impulse, ratio, np.arange(600) // 300)


def test_a_table_of_bounds_says_what_cannot_be_had(tmp_path):
    synthetic.SCENE["plate"]["damping_ratio"] = 0.01
    for group in range(3):
        for k in (0, 3, 7, 10):
            synthetic.write_run(tmp_path / "free" / f"{group:03d}" / f"ratio_{10 * k:03d}", k / 10, 100 * group + k, 0.02)
    found = bounds(read_dataset(tmp_path))
    assert set(found["setting"]) == {"free positions"}
    by_impulse = found[found["channels"] == TRUE_IMPULSE].iloc[0]
    assert by_impulse["least_points"] < 10 or "impulse" in by_impulse["reason"]
    centre = found[(found["channels"] == "centre") & found["noise_db"].isna()].iloc[0]
    assert 0 < centre["least_points"] < 10 and pd.isna(centre["reason"])
