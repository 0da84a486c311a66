"""Regressions on features of a record as methods of recognition."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from analysis.signals.features import FEATURES, sensor_features
from analysis.signals.records import RecordError
from analysis.sweep.runs import Run
from recognition.estimation.answer import Answer
from recognition.estimation.arrays import Floats
from recognition.estimation.calibration import reason_out_of_distribution
from recognition.estimation.channels import channels_of
from recognition.estimation.errors import RecognitionError
from recognition.estimation.estimator import RecordEstimator
from recognition.estimation.method import Groups
from recognition.regression.conformal import GroupConformal
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
        self._estimator: ProcessRegressor | None = None  # only in the program that has fitted it

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
        conformal.fit(np.asarray(X), y, groups, _numbers(nuisance))
        self._estimator = conformal.estimator_
        self.model_, self.width_, self.limits_ = conformal.estimator_.model_, conformal.width_, conformal.limits_
        self.error_ = conformal.error_
        return self

    def predict(self, X: Sequence[Floats] | Floats) -> Floats:
        """Mixing ratio of each record, shape (runs,), not clipped."""
        return np.array([answer.ratio for answer in self.answer(X)])

    def answer(self, X: Sequence[Floats] | Floats, *, nuisance: pd.DataFrame | None = None) -> list[Answer]:
        """RecognitionError for known conditions with a model from a file, which holds the process of unknown ones
        only."""
        for x in X:
            if x[0].shape != self.model_.mean.shape:
                raise RecognitionError(f"{x[0].size} features; the model has {self.model_.mean.size}")
        if nuisance is None:
            found = [self.model_.ratio(x) for x in X]
        elif self._estimator is None:
            raise RecognitionError("conditions known with a record; a model from a file cannot use them")
        else:
            found = list(zip(*self._estimator.predict(np.asarray(X), True, _numbers(nuisance)), strict=True))
        return [self._answer(x, *one) for x, one in zip(X, found, strict=True)]

    def _answer(self, x: Floats, ratio: float, error: float) -> Answer:
        reason = reason_out_of_distribution(DISTANCES, self.model_.distances(x), self.limits_)
        return Answer(float(ratio), float(ratio - self.width_ * error), float(ratio + self.width_ * error), reason)

    def summary(self) -> str:
        width_points = 100 * self.width_ * self.model_.standard_error
        return f"{self.model_.mean.size} features, interval of {width_points:.1f} points"


def _numbers(nuisance: pd.DataFrame | None) -> Floats | None:
    return None if nuisance is None else nuisance.to_numpy(dtype=float)
