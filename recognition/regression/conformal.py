"""Intervals and a warning for strange records around any regressor with scikit-learn's conventions."""

from __future__ import annotations

from inspect import signature

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin, clone
from sklearn.model_selection import GroupKFold
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import has_fit_parameter

from recognition.errors import RecognitionError

#: A record is strange where it is stranger by this factor than this share of the held-out training records, and than the 1
#: that an estimator scales its `strangeness` to. Not than all of them: a record from the end of a range, held out, is strange.
STRANGE_FACTOR, USUAL_SHARE = 1.5, 0.95
LEAST_GROUPS = 3


class GroupConformal(RegressorMixin, BaseEstimator):
    """An estimator with intervals from the errors that it makes on groups held out of its training.

    Split conformal prediction by cross-validation (Vovk 2015, Ann. Math. Artif. Intell. 74:9), whole groups held out:
    the half width is the (1 + 1/n) coverage quantile of |error| / s, times s, the standard error that the estimator
    gives with `return_std` (1 where it gives none). An estimator with `strangeness(X)`, shape (runs, k), gets a limit
    for each of the k from the same held-out records.
    """

    def __init__(self, estimator, coverage: float = 0.9, folds: int = 5):
        self.estimator = estimator
        self.coverage = coverage
        self.folds = folds

    def fit(self, X, y, groups=None, nuisance=None) -> GroupConformal:
        """groups (runs,): runs of one group are held out together; each ratio by itself where there are fewer than three
        groups, as in the paper's eleven runs. The intervals then know nothing of other arrangements."""
        X, y = np.asarray(X, dtype=float), np.asarray(y, dtype=float)
        groups = y if groups is None or np.unique(groups).size < LEAST_GROUPS else np.asarray(groups)
        if np.unique(groups).size < LEAST_GROUPS:
            raise RecognitionError(f"{np.unique(groups).size} different ratios; intervals need at least {LEAST_GROUPS}")
        scores, strange = [], []
        folds = GroupKFold(min(self.folds, np.unique(groups).size))
        for train, test in folds.split(X, y, groups):
            model = fitted(self.estimator, X[train], y[train], groups[train], None if nuisance is None else nuisance[train])
            ratio, error = with_error(model, X[test])
            scores.append(np.abs(ratio - y[test]) / error)
            if hasattr(model, "strangeness"):
                strange.append(model.strangeness(X[test]))
        self.width_ = float(conformal_quantile(np.concatenate(scores), self.coverage))
        self.limit_ = (STRANGE_FACTOR * np.maximum(1.0, conformal_quantile(np.vstack(strange), USUAL_SHARE))
                       if strange else None)
        self.estimator_ = fitted(self.estimator, X, y, groups, nuisance)
        return self

    def predict(self, X) -> np.ndarray:
        return self.estimator_.predict(X)

    def predict_interval(self, X, nuisance=None) -> np.ndarray:
        """Ratio, lower and upper end, shape (runs, 3); nuisance where it is told with the records."""
        ratio, error = with_error(self.estimator_, X, nuisance)
        return np.column_stack([ratio, ratio - self.width_ * error, ratio + self.width_ * error])

    def strange(self, X) -> np.ndarray:
        """Which records are unlike the training, shape (runs,); none where the estimator cannot say."""
        if self.limit_ is None:
            return np.zeros(len(X), dtype=bool)
        return np.any(self.estimator_.strangeness(X) > self.limit_, axis=1)


def conformal_quantile(values: np.ndarray, share: float) -> np.ndarray:
    """The least of `values` (n, ...) that a further one does not pass with probability `share`; the largest if n is too
    small for that."""
    rank = int(np.ceil(share * (len(values) + 1)))
    return np.sort(values, axis=0)[min(rank, len(values)) - 1]


def fitted(estimator, X, y, groups, nuisance=None):
    """A fitted copy, told what its `fit` asks for."""
    told = {"groups": groups} if has_fit_parameter(estimator, "groups") else {}
    if nuisance is not None:
        told["nuisance"] = nuisance
    return clone(estimator).fit(X, y, **told)


def with_error(model, X, nuisance=None) -> tuple[np.ndarray, np.ndarray]:
    """Predictions and their standard errors; 1 where the model gives none."""
    last = model[-1] if isinstance(model, Pipeline) else model
    told = {} if nuisance is None else {"nuisance": nuisance}
    if "return_std" in signature(last.predict).parameters:
        return model.predict(X, return_std=True, **told)
    ratio = np.asarray(model.predict(X))
    return ratio, np.ones(len(ratio))
