"""The likelihood against a naive twin, its standard errors and intervals against many draws, and scikit-learn's use of it."""

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.linear_model import Ridge
from sklearn.model_selection import GroupKFold, cross_val_predict

from recognition import RecognitionError
from recognition.regression.conformal import GroupConformal
from recognition.regression.ratio_likelihood import RatioLikelihood
from recognition.regression.ratio_posterior import basis, monomials
from recognition.regression.saved_likelihood import CalibratedLikelihood
from tests.recognition.draws import draws, law, noisy


def test_the_estimate_is_that_of_generalised_least_squares_over_all_samples():
    """Naive twin: the full covariance of all samples, every ratio of a fine grid. The same up to what lies outside the
    principal components."""
    X, y, _ = draws(80, 1)
    model = RatioLikelihood(components=20).fit(X, y).posterior_
    x = noisy(draws(1, 2)[0], 30)[0]
    row, k = model.scaled(x), len(model.variance)
    off = row - model.mean
    noise2 = (off @ off - np.sum((model.components @ off) ** 2)) / (off.size - k)
    covariance = model.components.T @ np.diag(model.variance) @ model.components + noise2 * np.eye(row.size)
    grid = np.linspace(-0.1, 1.1, 2401)
    rest = off - basis((2 * (grid - model.low) / (model.high - model.low) - 1)[:, None],
                       model.powers) @ model.coefficients @ model.components
    chi2 = np.einsum("gi,gi->g", rest, np.linalg.solve(covariance, rest.T).T)
    assert model.estimate(x).ratio == pytest.approx(grid[chi2.argmin()], abs=6e-4)
    weight = np.exp(-0.5 * (chi2 - chi2.min()))
    spread = np.sqrt(np.average((grid - np.average(grid, weights=weight)) ** 2, weights=weight))
    assert model.estimate(x).standard_error == pytest.approx(spread, rel=0.05)


def test_monomials_of_total_degree():
    assert monomials(2, 2).tolist() == [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]]


@pytest.mark.parametrize("db", [None, 20])
def test_errors_are_as_large_as_the_standard_error_says(db):
    X, y, _ = draws(200, 3)
    Xt, yt, _ = draws(300, 4)
    ratio, error = RatioLikelihood().fit(X, y).predict(Xt if db is None else noisy(Xt, db), return_std=True)
    assert 0.8 < np.std((ratio - yt) / error) < 1.25


def test_an_untold_speed_costs_little_where_it_was_in_the_training():
    X, y, v = draws(200, 6, (2.0, 4.0), scatter=0.005)
    Xt, yt, vt = draws(100, 7, (2.0, 4.0), scatter=0.005)
    blind = RatioLikelihood(degree=2).fit(X, y)
    model = RatioLikelihood(degree=3).fit(X, y, nuisance=v[:, None])
    untold, told = model.predict(Xt), model.predict(Xt, nuisance=vt[:, None])
    error = {name: np.abs(r - yt).mean() for name, r in
             {"blind": blind.predict(Xt), "untold": untold, "told": told}.items()}
    assert error["told"] <= 1.1 * error["untold"] and error["untold"] < 0.75 * error["blind"]
    speed = np.array([e.nuisance[0] for e in model.estimates(Xt)])
    assert np.abs(speed - vt).mean() < 0.1


def test_nothing_is_clipped():
    X, y, _ = draws(100, 8, scatter=0.005)
    assert RatioLikelihood().fit(X, y).predict([law(1.08, 3.0)])[0] == pytest.approx(1.08, abs=0.02)


@pytest.mark.parametrize("estimator", [RatioLikelihood(), None])
def test_intervals_cover_nine_in_ten(estimator):
    flat = estimator is None
    X, y, _ = draws(150, 9)
    Xt, yt, _ = draws(600, 10)
    X, Xt = (np.reshape(a, (len(a), -1)) if flat else a for a in (X, Xt))
    model = GroupConformal(estimator or Ridge(1e-3)).fit(X, y, groups=np.arange(150) // 3)
    ratio, low, high = model.predict_interval(Xt).T
    assert np.array_equal(ratio, model.predict(Xt))
    assert 0.85 < np.mean((low <= yt) & (yt <= high)) < 0.95


def test_scikit_learn_takes_it_as_one_of_its_own():
    X, y, _ = draws(60, 11)
    model = clone(RatioLikelihood(components=7))
    assert model.get_params() == {"components": 7, "degree": 2}
    held_out = cross_val_predict(model, X, y, groups=np.arange(60) // 4, cv=GroupKFold(5))
    assert np.abs(held_out - y).mean() < 0.05


@pytest.mark.parametrize("strange", [
    lambda x: x[:, ::-1], lambda x: np.roll(x, 3, axis=1), lambda x: noisy(x[None], 6)[0], lambda x: x[[1, 0, 2]]])
def test_a_record_unlike_the_training_is_flagged_and_one_like_it_is_not(strange):
    X, y, _ = draws(100, 12)
    method = CalibratedLikelihood("all").fit(X, y)
    like = draws(50, 13)[0]
    assert np.mean([method.recognise(x).strange != "" for x in noisy(like, 20)]) <= 0.04
    assert np.mean([method.recognise(strange(x)).strange != "" for x in like]) > 0.9


def test_the_saved_numbers_give_the_same():
    X, y, v = draws(100, 14, (2.0, 4.0))
    method = CalibratedLikelihood("all").fit(X, y, nuisance=v[:, None])
    again = CalibratedLikelihood.from_dict(method.to_dict())
    assert again.recognise(X[3]) == method.recognise(X[3])
    with pytest.raises(RecognitionError, match="2 channels of 40 samples; the model has 3 of 40"):
        again.recognise(X[3, :2])


def test_too_few_runs_are_refused():
    X, y, v = draws(6, 15, (2.0, 4.0))
    with pytest.raises(RecognitionError, match="6 runs; degree 2 in 2 variables needs 8"):
        RatioLikelihood().fit(X, y, nuisance=v[:, None])
