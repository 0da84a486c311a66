"""Methods as estimators of scikit-learn: `clone`, `cross_val_score`, `GridSearchCV` and pipelines take them.

They pass `sklearn.utils.estimator_checks.check_estimator`, `FusionQ` but for the checks that
tests/recognition/test_scikit_learn.py lists. For X of three dimensions scikit-learn checks little more than that a copy
can be made. `ArrangementLikelihood` is no estimator: its records are objects.
"""

from __future__ import annotations

from typing import Any

from sklearn.base import BaseEstimator, RegressorMixin


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
