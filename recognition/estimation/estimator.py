"""Methods as estimators of scikit-learn: `clone`, `cross_val_score`, `GridSearchCV` and pipelines take them.

They pass `sklearn.utils.estimator_checks.check_estimator`, `FusionQ` but for the checks in NOT_PASSED. For X of three
dimensions scikit-learn checks little more than that a copy can be made. `EstimatorMethod` takes the X of the regressor
that it is given, whose checks count. `ArrangementLikelihood` is no estimator: its records are objects.
"""

from __future__ import annotations

from typing import Any

from sklearn.base import BaseEstimator, RegressorMixin

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


class RatioEstimator(RegressorMixin, BaseEstimator):
    """A method whose X is an array of numbers and whose `predict` gives mixing ratios; `score` is R^2.

    Its parameters are those of its constructor, which stores them as they are given.
    """

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.regressor_tags.poor_score = True  # a law of impacts fits no made-up data
        return tags


class RecordEstimator(RatioEstimator):
    """One whose X has three dimensions: runs, rows of a record, columns."""

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array, tags.input_tags.three_d_array = False, True
        return tags
