"""Intervals, and limits of the distribution, around any regressor with scikit-learn's conventions."""

from __future__ import annotations

from inspect import signature
from typing import Any

import numpy as np
from sklearn.base import clone
from sklearn.model_selection import GroupKFold
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import has_fit_parameter

from recognition.estimation.arrays import Floats
from recognition.estimation.calibration import COVERAGE, FOLDS, LEAST_GROUPS, distance_limits, held_out_quantile
from recognition.estimation.errors import RecognitionError


class GroupConformal:
    """An estimator with intervals from the errors that it makes on groups held out of its training.

    Split conformal prediction by cross-validation (Vovk 2015, Ann. Math. Artif. Intell. 74:9), whole groups held out:
    the half width is the (1 + 1/n) COVERAGE quantile of |error| / s, times s, the standard error that the estimator
    gives with `return_std` (1 where it gives none). An estimator with `distances(X)`, shape (runs, k), gets a limit for
    each of the k from the same held-out records; `error_` is the mean of their |error|. An
    estimator whose `fit` takes `groups` or `nuisance` is given them.
    """

    def __init__(self, estimator: Any):
        self.estimator = estimator

    def fit(self, X: Floats, y: Floats, groups: Any = None, nuisance: Floats | None = None) -> GroupConformal:
        """groups (runs,): runs of one group are held out together; each ratio by itself where there are fewer than
        three groups, as in the paper's eleven runs. The intervals then know nothing of other arrangements."""
        X, y = np.asarray(X, dtype=float), np.asarray(y, dtype=float)
        groups = y if groups is None or np.unique(groups).size < LEAST_GROUPS else np.asarray(groups)
        if np.unique(groups).size < LEAST_GROUPS:
            raise RecognitionError(f"{np.unique(groups).size} different ratios; intervals need at least {LEAST_GROUPS}")
        scores, distances, errors = [], [], []
        folds = GroupKFold(min(FOLDS, np.unique(groups).size))
        for train, test in folds.split(X, y, groups):
            known = None if nuisance is None else nuisance[train]
            model = _fitted(self.estimator, X[train], y[train], groups[train], known)
            ratio, error = _with_error(model, X[test])
            scores.append(np.abs(ratio - y[test]) / error)
            errors.append(np.abs(ratio - y[test]))
            if hasattr(model, "distances"):
                distances.append(model.distances(X[test]))
        self.width_ = float(held_out_quantile(np.concatenate(scores), COVERAGE))
        self.error_ = float(np.concatenate(errors).mean())
        self.limits_ = distance_limits(np.vstack(distances)) if distances else np.empty(0)
        self.estimator_ = _fitted(self.estimator, X, y, groups, nuisance)
        return self

    def predict_interval(self, X: Floats, nuisance: Floats | None = None) -> Floats:
        """Ratio, lower and upper end, shape (runs, 3); nuisance where it is known with the records."""
        ratio, error = _with_error(self.estimator_, X, nuisance)
        return np.column_stack([ratio, ratio - self.width_ * error, ratio + self.width_ * error])


def _fitted(estimator: Any, X: Floats, y: Floats, groups: Floats, nuisance: Floats | None) -> Any:
    """A fitted copy, given what its `fit` asks for."""
    given = {"groups": groups} if has_fit_parameter(estimator, "groups") else {}
    if nuisance is not None and has_fit_parameter(estimator, "nuisance"):
        given["nuisance"] = nuisance
    return clone(estimator).fit(X, y, **given)


def _with_error(model: Any, X: Floats, nuisance: Floats | None = None) -> tuple[Floats, Floats]:
    """Predictions and their standard errors; 1 where the model gives none."""
    accepted = signature((model[-1] if isinstance(model, Pipeline) else model).predict).parameters
    known = {"nuisance": nuisance} if nuisance is not None and "nuisance" in accepted else {}
    if "return_std" in accepted:
        ratio, error = model.predict(X, return_std=True, **known)
        return ratio, error
    ratio = np.asarray(model.predict(X, **known))
    return ratio, np.ones(len(ratio))
