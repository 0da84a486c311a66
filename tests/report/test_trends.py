"""Measures of trends, against values found by hand."""

import numpy as np
import pytest

from report.verdicts import falling_steps, fluctuation, overlap, separation, spearman, stratification, travel

RATIOS = np.arange(11) / 10


def test_rank_correlation_by_the_sum_of_squared_ranks():
    values = np.array([1, 3, 2, 5, 4, 6, 8, 7, 9, 11, 10.0])
    d2 = sum((a - b) ** 2 for a, b in zip(range(1, 12), values, strict=True))
    assert spearman(RATIOS, values) == pytest.approx(1 - 6 * d2 / (11 * 120))
    assert falling_steps(RATIOS, values)[0] == (pytest.approx(0.1), pytest.approx(0.2))
    assert spearman(RATIOS, np.ones(11)) == 0.0


def test_stratification_and_overlap_of_known_curves():
    t = np.linspace(0, 1, 50)
    ordered = RATIOS[:, None] * np.cos(7 * t)[None, :]  # the order turns over with the sign: still uncrossed
    assert stratification(RATIOS, ordered) == pytest.approx(1.0)
    assert overlap(ordered) == 0.0
    # Two neighbours changed about everywhere: one of ten pairs out of order; sum of d^2 of ranks is 2.
    crossed = ordered[[0, 1, 2, 4, 3, 5, 6, 7, 8, 9, 10]]
    assert overlap(crossed) == pytest.approx(0.1)
    assert stratification(RATIOS, crossed) == pytest.approx(1 - 6 * 2 / (11 * 120))


def test_travel_counts_peaks():
    t = np.linspace(0, 1, 1001)
    assert travel(np.sin(np.pi * t)) == pytest.approx(1.0, abs=1e-4)
    assert travel(np.sin(3 * np.pi * t) ** 2) == pytest.approx(3.0, abs=1e-3)


def test_separation_and_fluctuation():
    assert separation(np.array([[0.0, 0.0], [1.0, 0.5]])) == pytest.approx(0.75)
    t = np.arange(2000)
    assert fluctuation(np.sin(2 * np.pi * t / 40)) == pytest.approx(2 * np.sin(np.pi / 40), rel=0.01)
