"""Methods of recognition keep to scikit-learn's conventions, by its own checks and in its own tools."""

import warnings
from functools import cache

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.linear_model import LinearRegression
from sklearn.model_selection import GridSearchCV, LeaveOneOut, cross_val_predict, cross_val_score
from sklearn.utils.estimator_checks import check_estimator

from analysis import RecordError, read_sweep
from lab.recognition.baselines import EstimatorMethod
from recognition import Fusion, FusionPipeline, FusionQ, Model, RecognitionError, Rule, Strategy
from recognition.regression.feature_regression import FeatureRegression
from tests.analysis.synthetic import write_sweep

RATIOS = np.arange(11) / 10


def rms(signals):
    return np.array([np.sqrt(np.mean(signals["a_m_s2"] ** 2))])


MADE = {
    FusionQ: FusionQ,
    FusionPipeline: lambda: FusionPipeline(Fusion("energy"), Strategy(Rule(degree=2), judge="truncated")),
    FeatureRegression: lambda: FeatureRegression("energies_sensors"),
    EstimatorMethod: lambda: EstimatorMethod(rms, LinearRegression()),
}


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    return read_sweep(write_sweep(tmp_path_factory.mktemp("runs") / "paper")).runs


@pytest.fixture(scope="module")
def features(runs):
    """What a method takes of each run, by its kind."""
    return cache(lambda kind: np.stack([MADE[kind]().prepare(run.signals) for run in runs]))


@pytest.mark.parametrize("kind", [k for k in MADE if k is not EstimatorMethod], ids=lambda kind: kind.__name__)
def test_scikit_learns_own_checks(kind):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what it leaves out: three dimensions
        check_estimator(MADE[kind]())


@pytest.mark.parametrize("use", [
    lambda: FusionQ().predict(np.ones((2, 1, 8))), lambda: FusionPipeline().answer(np.ones((2, 1, 3, 9))),
    lambda: FeatureRegression("rms").answer(np.ones((2, 1, 4))), lambda: Fusion().transform(np.ones((3, 9))),
    lambda: Strategy().predict(np.ones(9)), lambda: FusionQ().summary()])
def test_what_was_not_fitted_says_so(use):
    with pytest.raises(NotFittedError, match="is not fitted yet; call fit first"):
        use()
    assert Fusion() != Fusion() and not hasattr(FusionQ(), "nothing")


@pytest.mark.filterwarnings("ignore:An input array is constant")
@pytest.mark.parametrize("kind", [FusionQ, FeatureRegression], ids=lambda kind: kind.__name__)
def test_another_number_of_features_and_one_that_never_changes_are_refused(kind):
    X = np.random.default_rng(1).normal(0, 0.01, (11, 1, 8)) + RATIOS[:, None, None]
    method = MADE[kind]().fit(X, RATIOS)
    for use in (method.predict, method.answer):
        with pytest.raises(RecognitionError, match="3 features; the model has 8"):
            use(X[:2, :, :3])
    X[:, :, 2] = 7.0
    with pytest.raises(RecognitionError, match="2 has the same value in all"):
        MADE[kind]().fit(X, RATIOS)


def test_what_is_no_table_of_signals_with_times_is_refused(runs):
    with pytest.raises(RecognitionError, match="no column 't_s'"):
        FusionQ().prepare(runs[0].signals[["a_m_s2"]])
    for signals in (runs[0], runs[0].signals.to_numpy()):
        with pytest.raises(RecordError, match="must be a table with t_s and signals"):
            Model.recognise(object.__new__(Model), signals)


@pytest.mark.slow
def test_cross_validation_is_fitting_without_one_run(features):
    """Against a loop that leaves each run out by hand."""
    method, X = MADE[FusionPipeline](), features(FusionPipeline)
    inner = slice(1, -1)  # the law is not asked beyond the ratios that it was fitted to
    found = cross_val_predict(method, X, RATIOS, cv=LeaveOneOut())
    by_hand = [MADE[FusionPipeline]().fit(np.delete(X, k, 0), np.delete(RATIOS, k)).predict(X[k:k + 1])[0]
               for k in range(len(RATIOS))]
    np.testing.assert_array_equal(found, by_hand)
    scores = cross_val_score(method, X, RATIOS, cv=LeaveOneOut(), scoring="neg_mean_absolute_error")
    np.testing.assert_allclose(-scores[inner], np.abs(found - RATIOS)[inner], rtol=1e-12)


def test_a_search_over_parameters(features):
    method, X = MADE[FusionPipeline](), features(FusionPipeline)
    search = GridSearchCV(method, {"strategy__judge": ["mean", "truncated"], "fusion__kind": ["energy"]}, cv=[
        (np.delete(np.arange(11), [3, 7]), np.array([3, 7]))], scoring="neg_mean_absolute_error")
    search.fit(X, RATIOS)
    errors = []
    for judge in ("mean", "truncated"):
        one = FusionPipeline(Fusion("energy"), Strategy(Rule(degree=2), judge=judge))
        one.fit(np.delete(X, [3, 7], 0), np.delete(RATIOS, [3, 7]))
        errors.append(np.abs(one.predict(X[[3, 7]]) - RATIOS[[3, 7]]).mean())
    np.testing.assert_allclose(-search.cv_results_["mean_test_score"], errors, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("kind", MADE, ids=lambda kind: kind.__name__)
def test_a_clone_is_not_fitted_and_learns_the_same(kind, features):
    method, X = MADE[kind](), features(kind)
    expected = method.fit(X, RATIOS).predict(X)
    copy = clone(method)
    assert not [name for name in vars(copy) if name.endswith("_")]
    np.testing.assert_allclose(copy.fit(X, RATIOS).predict(X), expected, rtol=1e-9)


@pytest.mark.parametrize("kind", [k for k in MADE if k is not EstimatorMethod], ids=lambda kind: kind.__name__)
def test_what_is_not_finite_or_of_another_length_is_refused(kind):
    """In features and ratios, in training, prediction and answer."""
    shape = (11, 1, 3, 20) if kind is FusionPipeline else (11, 1, 8)
    X = np.random.default_rng(1).normal(0, 0.01, shape) + RATIOS.reshape(-1, *[1] * (len(shape) - 1))
    method, spoilt = MADE[kind]().fit(X, RATIOS), np.where(X == X.max(), np.nan, X)
    for use in (lambda: MADE[kind]().fit(spoilt, RATIOS), lambda: MADE[kind]().fit(X, np.where(RATIOS > 0.9, np.nan, RATIOS)),
                lambda: method.predict(spoilt), lambda: method.answer(spoilt)):
        with pytest.raises(RecognitionError, match="every value must be finite"):
            use()
    for use in (lambda: MADE[kind]().fit(X, RATIOS[:4]), lambda: MADE[kind]().fit(X[:0], RATIOS[:0]),
                lambda: MADE[kind]().fit(X[:, 0, ..., 0].reshape(11, -1), RATIOS)):
        with pytest.raises(RecognitionError, match="shape"):
            use()
