"""Methods of recognition keep to scikit-learn's conventions, by its own checks and in its own tools."""

import warnings

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.linear_model import LinearRegression
from sklearn.model_selection import GridSearchCV, LeaveOneOut, cross_val_predict, cross_val_score
from sklearn.utils.estimator_checks import check_estimator

from analysis import read_sweep
from lab.recognition.baselines import EstimatorMethod
from recognition import Fusion, FusionPipeline, FusionQ, RecognitionError, Rule, Strategy
from recognition.regression.feature_regression import FeatureRegression, ProcessRegressor
from tests.analysis.synthetic import write_sweep

RATIOS = np.arange(11) / 10
NO_ROOT = "random numbers have a Q that no mixing ratio has: NotRecognised, where other regressors guess"
TWO_VALUES = "the data has two ratios, and a quadratic needs three: RecognitionError"
#: What `FusionQ` does not pass, with the reason; `expected_failed_checks` of `check_estimator`.
NOT_PASSED = {
    "check_dict_unchanged": NO_ROOT,
    "check_dtype_object": NO_ROOT,
    "check_estimators_dtypes": TWO_VALUES,
    "check_estimators_nan_inf": TWO_VALUES,
    "check_estimators_pickle": TWO_VALUES,
    "check_f_contiguous_array_estimator": NO_ROOT,
    "check_fit2d_1feature": TWO_VALUES,
    "check_fit_idempotent": NO_ROOT,
    "check_fit_score_takes_y": NO_ROOT,
    "check_methods_sample_order_invariance": NO_ROOT,
    "check_methods_subset_invariance": NO_ROOT,
    "check_pipeline_consistency": TWO_VALUES,
    "check_regressor_data_not_an_array": NO_ROOT,
    "check_regressors_int": NO_ROOT,
    "check_regressors_train": NO_ROOT,
    "check_supervised_y_2d": NO_ROOT,
}


def rms(signals):
    return np.array([np.sqrt(np.mean(signals["a_m_s2"] ** 2))])


MADE = {
    FusionQ: FusionQ,
    FusionPipeline: lambda: FusionPipeline(Fusion("energy"), Strategy(Rule(degree=2), judge="truncated")),
    ProcessRegressor: lambda: ProcessRegressor(), FeatureRegression: lambda: FeatureRegression("energies_sensors"),
    EstimatorMethod: lambda: EstimatorMethod(rms, LinearRegression()),
}


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    return read_sweep(write_sweep(tmp_path_factory.mktemp("runs") / "paper")).runs


@pytest.mark.parametrize("kind", [k for k in MADE if k is not EstimatorMethod], ids=lambda kind: kind.__name__)
def test_scikit_learns_own_checks(kind):
    """Each passes, or fails as the list says and for the reason that it gives: our own refusal."""
    expected = NOT_PASSED if kind is FusionQ else {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what it leaves out: skipped checks, three dimensions
        results = check_estimator(MADE[kind](), expected_failed_checks=expected, on_fail=None)
    failed = {r["check_name"]: r["exception"] for r in results if r["status"] in ("failed", "xfail")}
    assert set(failed) == set(expected)
    for name, error in failed.items():
        assert isinstance(error, RecognitionError) or name == "check_fit2d_1feature", (name, error)


def test_cross_validation_is_fitting_without_one_run(runs):
    """Against a loop that leaves each run out by hand."""
    method = MADE[FusionPipeline]()
    X = np.stack([method.prepare(run.signals) for run in runs])
    inner = slice(1, -1)  # the law is not asked beyond the ratios that it was fitted to
    found = cross_val_predict(method, X, RATIOS, cv=LeaveOneOut())
    by_hand = [MADE[FusionPipeline]().fit(np.delete(X, k, 0), np.delete(RATIOS, k)).predict(X[k:k + 1])[0]
               for k in range(len(runs))]
    np.testing.assert_array_equal(found, by_hand)
    scores = cross_val_score(method, X, RATIOS, cv=LeaveOneOut(), scoring="neg_mean_absolute_error")
    np.testing.assert_allclose(-scores[inner], np.abs(found - RATIOS)[inner], rtol=1e-12)


def test_a_search_over_parameters(runs):
    method = MADE[FusionPipeline]()
    X = np.stack([method.prepare(run.signals) for run in runs])
    search = GridSearchCV(method, {"strategy__judge": ["mean", "truncated"], "fusion__kind": ["energy"]}, cv=[
        (np.delete(np.arange(11), [3, 7]), np.array([3, 7]))], scoring="neg_mean_absolute_error")
    search.fit(X, RATIOS)
    errors = []
    for judge in ("mean", "truncated"):
        one = FusionPipeline(Fusion("energy"), Strategy(Rule(degree=2), judge=judge))
        one.fit(np.delete(X, [3, 7], 0), np.delete(RATIOS, [3, 7]))
        errors.append(np.abs(one.predict(X[[3, 7]]) - RATIOS[[3, 7]]).mean())
    np.testing.assert_allclose(-search.cv_results_["mean_test_score"], errors, rtol=1e-12)


@pytest.mark.parametrize("kind", MADE, ids=lambda kind: kind.__name__)
def test_a_clone_is_not_fitted_and_learns_the_same(kind, runs):
    method = MADE[kind]()
    if kind is ProcessRegressor:
        X = np.random.default_rng(1).normal(size=(11, 2, 4)) * [[[1.0], [0.0]]] + RATIOS[:, None, None]
    else:
        X = np.stack([method.prepare(run.signals) for run in runs])
    expected = method.fit(X, RATIOS).predict(X)
    copy = clone(method)
    assert not [name for name in vars(copy) if name.endswith("_")]
    np.testing.assert_allclose(copy.fit(X, RATIOS).predict(X), expected, rtol=1e-9)
