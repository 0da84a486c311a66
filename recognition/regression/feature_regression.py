"""Regressions on features of a record as methods of recognition: a Gaussian process from the features to the ratio, the
law of these features (`ratio_law`), and conformal intervals around any regressor.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from inspect import signature
from typing import Any

import numpy as np
import pandas as pd
from scipy.linalg import cho_solve
from sklearn.base import clone
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel
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
from recognition.estimation.errors import RecognitionError
from recognition.estimation.method import Groups, RecordEstimator
from recognition.estimation.window import channels_of
from recognition.regression.ratio_law import DISTANCES, RatioLaw, fit_law


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


@dataclass(frozen=True)
class ProcessModel:
    """A fitted Gaussian process with Matern's kernel (nu 5/2), and the law of its features.

    mean, scale (p,): of the features; points (n, m), weights (n,): of the process, in the first m standardised
    features; constant, length: of its kernel; scatter: mean square error of a training record left out, in units of
    size; offset, size: mean and standard deviation of the ratio in training; law: of the standardised features, taken
    as one channel.
    """

    mean: Floats
    scale: Floats
    points: Floats
    weights: Floats
    constant: float
    length: float
    scatter: float
    offset: float
    size: float
    law: RatioLaw

    @property
    def standard_error(self) -> float:
        """Of the ratio of a record without noise."""
        return float(self.size * np.sqrt(self.scatter))

    def ratio(self, record: Floats) -> tuple[float, float]:
        """Of one record, features and their errors (2, p): ratio, and its standard error from the scatter of the
        training and, through the slope of the process, the errors of the features."""
        m = self.points.shape[1]
        away = self.points - ((record[0] - self.mean) / self.scale)[:m]
        r = np.sqrt(5) * np.linalg.norm(away, axis=1) / self.length
        smooth = self.constant * np.exp(-r) * self.weights
        slope = 5 / (3 * self.length**2) * (smooth * (1 + r)) @ away
        error = slope * (record[1] / self.scale)[:m]
        return (float(self.offset + self.size * (smooth @ (1 + r + r**2 / 3))),
                float(np.hypot(self.standard_error, self.size * np.linalg.norm(error))))

    def distances(self, record: Floats) -> Floats:
        """Distances of features and errors (2, p) from the training, shape (3,), see `LawEstimate.distances`."""
        return self.law.estimate(((record[0] - self.mean) / self.scale)[None]).distances


def _scatter(process: GaussianProcessRegressor) -> float:
    """Mean square error at each training record when it is left out: alpha_i/(K^-1)_ii (Rasmussen and Williams 2006,
    5.12). The noise of the kernel may be none where few records happen to lie on a smooth curve."""
    inverse = cho_solve((process.L_, True), np.eye(len(process.L_)))
    return float(np.mean((process.alpha_ / np.diag(inverse)) ** 2))


def _process(z: Floats, y: Floats) -> GaussianProcessRegressor:
    # The bounds keep the search from the answer that all is noise, which is always there.
    kernel = ConstantKernel(1.0, (1e-2, 1e3)) * Matern(10.0, (0.3, 1e3), nu=2.5) + WhiteKernel(0.1, (1e-6, 1.0))
    with warnings.catch_warnings():
        # A scale of the kernel at its bound is an answer too: a straight line, or no noise.
        warnings.simplefilter("ignore", ConvergenceWarning)
        return GaussianProcessRegressor(kernel, normalize_y=True, random_state=0).fit(z, y)


class ProcessRegressor(RecordEstimator):
    """scikit-learn estimator: Gaussian process on standardised features, and a law of the features with their scatter,
    which tells records out of distribution.

    X has the shape (runs, 2, p): features, and their standard errors by the noise of the sensors.
    """

    def fit(self, X: Floats, y: Floats, nuisance: Floats | None = None,
            groups: Floats | None = None) -> ProcessRegressor:
        """y (runs,): ratios; nuisance, groups: of the law, as in `fit_law`, which raises RecognitionError."""
        X, y = np.asarray(X, dtype=float), np.asarray(y, dtype=float)
        mean, scale = X[:, 0].mean(axis=0), X[:, 0].std(axis=0)
        z = (X[:, 0] - mean) / scale
        self.process_ = process = _process(z, y)
        smooth = process.kernel_.k1
        law = fit_law(z[:, None, :], y, nuisance, groups, components=z.shape[1])
        self.model_ = ProcessModel(
            mean, scale, z, process.alpha_, float(smooth.k1.constant_value), float(smooth.k2.length_scale),
            _scatter(process), float(y.mean()), float(y.std()), law)
        return self

    def predict(self, X: Floats, return_std: bool = False) -> Any:
        """Ratios (runs,), not clipped, and their standard errors where asked for."""
        ratio, error = np.array([self.model_.ratio(x) for x in np.asarray(X, dtype=float)]).T
        return (ratio, error) if return_std else ratio

    def distances(self, X: Floats) -> Floats:
        """`ProcessModel.distances` of each record, shape (runs, 3)."""
        return np.array([self.model_.distances(x) for x in np.asarray(X, dtype=float)])
