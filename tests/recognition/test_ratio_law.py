"""The law of records against a naive twin; intervals against many draws; records out of distribution."""

import numpy as np
import pytest
from sklearn.model_selection import KFold

from recognition import RecognitionError
from recognition.estimation.calibration import distance_limits
from recognition.models import decode, encode
from recognition.regression.feature_regression import FeatureRegression
from recognition.regression.ratio_law import RatioLaw, basis, fit_law, held_out_residual, monomials
from tests.recognition.draws import draws, law, noisy


def ratios(fitted, X):
    return np.array([fitted.estimate(x).theta[0] for x in X])


def test_the_estimate_is_that_of_generalised_least_squares_over_all_samples():
    """Naive twin: the full covariance of all samples, every ratio of a fine grid. The same up to what lies outside the
    principal components."""
    X, y, _ = draws(80, 1)
    model = fit_law(X, y, components=20)
    x = noisy(draws(1, 2)[0], 30)[0]
    row, k = model.scaled(x), len(model.variance)
    off = row - model.mean
    noise2 = (off @ off - np.sum((model.components @ off) ** 2)) / (off.size - k)
    covariance = model.components.T @ np.diag(model.variance) @ model.components + noise2 * np.eye(row.size)
    grid = np.linspace(-0.1, 1.1, 2401)
    residual = off - basis((2 * (grid - model.low) / (model.high - model.low) - 1)[:, None],
                           model.powers) @ model.coefficients @ model.components
    chi2 = np.einsum("gi,gi->g", residual, np.linalg.solve(covariance, residual.T).T)
    assert model.estimate(x).theta[0] == pytest.approx(grid[chi2.argmin()], abs=6e-4)


def test_monomials_of_total_degree():
    assert monomials(2, 2).tolist() == [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]]


def test_an_unknown_speed_costs_little_where_it_was_in_the_training():
    X, y, v = draws(200, 6, (2.0, 4.0), scatter=0.005)
    Xt, yt, vt = draws(100, 7, (2.0, 4.0), scatter=0.005)
    without, model = fit_law(X, y), fit_law(X, y, v[:, None], degree=3)
    found = np.array([model.estimate(x).theta for x in Xt])
    assert np.abs(found[:, 0] - yt).mean() < 0.75 * np.abs(ratios(without, Xt) - yt).mean()
    assert np.abs(found[:, 1] - vt).mean() < 0.1


def test_nothing_is_clipped():
    X, y, _ = draws(100, 8, scatter=0.005)
    assert ratios(fit_law(X, y), [law(1.08, 3.0)])[0] == pytest.approx(1.08, abs=0.02)


def test_intervals_cover_nine_in_ten():
    """Of the rms of each channel, without noise."""
    X, y, _ = draws(150, 9)
    Xt, yt, _ = draws(600, 10)
    X, Xt = (np.sqrt(np.mean(a**2, axis=2))[:, None] for a in (X, Xt))
    found = FeatureRegression("rms").fit(X, y, groups=np.arange(150) // 3).answer(Xt)
    assert 0.85 < np.mean([one.low <= ratio <= one.high for one, ratio in zip(found, yt, strict=True)]) < 0.95


@pytest.mark.parametrize("changed", [
    lambda x: x[:, ::-1], lambda x: np.roll(x, 3, axis=1), lambda x: noisy(x[None], 6)[0], lambda x: x[[1, 0, 2]]])
def test_a_record_unlike_the_training_is_out_of_distribution_and_one_like_it_is_not(changed):
    X, y, _ = draws(100, 12)
    held_out = [fit_law(X[train], y[train]).estimate(X[k]).distances
                for train, test in KFold(5).split(X) for k in test]
    model, limits = fit_law(X, y), distance_limits(np.array(held_out))
    like = draws(50, 13)[0]
    assert np.mean([np.any(model.estimate(x).distances > limits) for x in noisy(like, 20)]) <= 0.04
    assert np.mean([np.any(model.estimate(changed(x)).distances > limits) for x in like]) > 0.9


def test_the_saved_numbers_give_the_same():
    X, y, v = draws(100, 14, (2.0, 4.0))
    model = fit_law(X, y, v[:, None])
    assert np.array_equal(decode(encode(model), RatioLaw).estimate(X[3]).theta, model.estimate(X[3]).theta)


def test_too_few_runs_are_refused():
    X, y, v = draws(6, 15, (2.0, 4.0))
    with pytest.raises(RecognitionError, match="6 runs; degree 2 in 2 variables needs 8"):
        fit_law(X, y, v[:, None])


def test_residual_of_a_run_is_by_the_law_of_the_others():
    """A constant law of six runs that are held out one by one: what is left is off the mean of the other five."""
    rows = np.random.default_rng(3).standard_normal((6, 4))
    found = held_out_residual(rows, np.ones((6, 1)), np.arange(6))
    assert found == pytest.approx(np.array([row - np.delete(rows, k, axis=0).mean(axis=0) for k, row in enumerate(rows)]))
