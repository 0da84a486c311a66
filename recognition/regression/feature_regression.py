"""Regressions on features of a record as methods of recognition, with conformal intervals around any regressor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from inspect import signature
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import clone
from sklearn.model_selection import GroupKFold
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import has_fit_parameter

from analysis.signals.features import FEATURES, sensor_features
from analysis.signals.records import RecordError
from analysis.sweep.runs import Run
from recognition.estimation.answer import Answer
from recognition.estimation.arrays import Floats
from recognition.estimation.calibration import (
    COVERAGE,
    FOLDS,
    LEAST_GROUPS,
    distance_limits,
    held_out_quantile,
    reason_out_of_distribution,
)
from recognition.estimation.channels import channels_of
from recognition.estimation.errors import RecognitionError
from recognition.estimation.method import Groups, RecordEstimator
from recognition.regression.gaussian_process import ProcessModel, ProcessRegressor
from recognition.regression.ratio_law import DISTANCES


@dataclass
class FeatureRegression(RecordEstimator):
    """A Gaussian process on one of FEATURES, of samples or sensors, taken of all accelerometers, with intervals by
    `GroupConformal`; X has the shape (runs, 2, p).

    >>> FeatureRegression("energies_sensors").prepare(read_run("runs/paper/ratio_030").signals).shape
    (2, 8)
    """

    features: str
    model_: ProcessModel = field(init=False, repr=False)
    width_: float = field(init=False, repr=False)
    error_: float = field(init=False, repr=False)
    limits_: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        allowed = [name for name, formula in FEATURES.items() if formula.takes != "imfs"]
        if self.features not in allowed:
            raise RecognitionError(f"features {self.features!r}; choose among {', '.join(allowed)}")

    def prepare(self, signals: pd.DataFrame, run: Run | None = None) -> Floats:
        """Features and their standard errors by the noise of the sensors, which is none, shape (2, p)."""
        try:
            found = sensor_features(self.features, channels_of(signals, "accelerometers"))
        except RecordError as reason:
            raise RecognitionError(str(reason)) from None
        return np.stack([found, np.zeros_like(found)])

    def fit(self, X: Sequence[Floats] | Floats, y: Floats, *, groups: Groups | None = None,
            nuisance: pd.DataFrame | None = None) -> FeatureRegression:
        """nuisance: of the law of the features (`ProcessRegressor.fit`). Raises RecognitionError."""
        conformal = GroupConformal(ProcessRegressor())
        conformal.fit(np.asarray(X), y, groups, None if nuisance is None else nuisance.to_numpy(dtype=float))
        self.model_, self.width_, self.limits_ = conformal.estimator_.model_, conformal.width_, conformal.limits_
        self.error_ = conformal.error_
        return self

    def predict(self, X: Sequence[Floats] | Floats) -> Floats:
        """Mixing ratio of each record, shape (runs,), not clipped."""
        return np.array([answer.ratio for answer in self.answer(X)])

    def answer(self, X: Sequence[Floats] | Floats) -> list[Answer]:
        """RecognitionError for another number of features."""
        for x in X:
            if x[0].shape != self.model_.mean.shape:
                raise RecognitionError(f"{x[0].size} features; the model has {self.model_.mean.size}")
        return [self._answer(x, *self.model_.ratio(x)) for x in X]

    def _answer(self, x: Floats, ratio: float, error: float) -> Answer:
        reason = reason_out_of_distribution(DISTANCES, self.model_.distances(x), self.limits_)
        return Answer(float(ratio), float(ratio - self.width_ * error), float(ratio + self.width_ * error), reason)

    def summary(self) -> str:
        width_points = 100 * self.width_ * self.model_.standard_error
        return f"{self.model_.mean.size} features, interval of {width_points:.1f} points"


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

    def predict_interval(self, X: Floats) -> Floats:
        """Ratio, lower and upper end, shape (runs, 3)."""
        ratio, error = _with_error(self.estimator_, X)
        return np.column_stack([ratio, ratio - self.width_ * error, ratio + self.width_ * error])


def _fitted(estimator: Any, X: Floats, y: Floats, groups: Floats, nuisance: Floats | None) -> Any:
    """A fitted copy, given what its `fit` asks for."""
    given = {"groups": groups} if has_fit_parameter(estimator, "groups") else {}
    if nuisance is not None and has_fit_parameter(estimator, "nuisance"):
        given["nuisance"] = nuisance
    return clone(estimator).fit(X, y, **given)


def _with_error(model: Any, X: Floats) -> tuple[Floats, Floats]:
    """Predictions and their standard errors; 1 where the model gives none."""
    if "return_std" in signature((model[-1] if isinstance(model, Pipeline) else model).predict).parameters:
        ratio, error = model.predict(X, return_std=True)
        return ratio, error
    ratio = np.asarray(model.predict(X))
    return ratio, np.ones(len(ratio))
