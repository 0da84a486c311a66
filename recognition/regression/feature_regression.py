"""Regressions on features of a record as methods of recognition: a Gaussian process from the features to the ratio, and
the law of these features (`ratio_law`), which tells records out of distribution.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
import pandas as pd
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

from analysis.signals.features import FEATURES, sensor_features
from analysis.sweep.runs import Run
from common.input_error import raised_as
from recognition.estimation.answer import Answer
from recognition.estimation.arrays import Floats, finite, training
from recognition.estimation.calibration import (
    COVERAGE,
    distance_limits,
    held_out,
    held_out_quantile,
    reason_out_of_distribution,
)
from recognition.estimation.errors import RecognitionError
from recognition.estimation.method import Groups, RecordEstimator
from recognition.estimation.noise import noisy_copies
from recognition.estimation.window import channels_of
from recognition.regression.ratio_law import DISTANCES, RatioLaw, fit_law
from recognition.sensors.channel_check import samples_before_impact


@dataclass(eq=False)
class FeatureRegression(RecordEstimator):
    """A Gaussian process on one of FEATURES of all accelerometers from the impact on. X: (runs, copies, p).

    >>> FeatureRegression("energies_sensors").prepare(read_run("runs/paper/ratio_030").signals).shape
    (9, 8)
    """

    features: str
    model_: "ProcessModel" = field(init=False, repr=False)
    error_: float = field(init=False, repr=False)
    limits_: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        allowed = [name for name, formula in FEATURES.items() if formula.takes != "imfs"]
        if self.features not in allowed:
            raise RecognitionError(f"features {self.features!r}; choose among {', '.join(allowed)}")

    def prepare(self, signals: pd.DataFrame, run: Run | None = None) -> Floats:
        """Features of the record and of its `noisy_copies`, shape (copies, p)."""
        early = samples_before_impact(channels_of(signals))
        every = [channels_of(one) for one in noisy_copies(signals.iloc[early:])]
        with raised_as(RecognitionError):
            return np.stack([sensor_features(self.features, one) for one in every])

    def fit(self, X: Sequence[Floats] | Floats, y: Floats, *, groups: Groups | None = None,
            nuisance: pd.DataFrame | None = None) -> Self:
        """Intervals and limits of the distances are by what is held out. Raises RecognitionError."""
        every, y = training(X, y, 3)
        features = every[:, 0]
        conditions = None if nuisance is None else nuisance.to_numpy(dtype=float)
        keys = None if groups is None else np.asarray(groups)

        def model(which: Any) -> "ProcessModel":
            of = [None if values is None else values[which] for values in (conditions, keys)]
            return fit_process(features[which], y[which], *of)

        errors, distances = [], []
        for train, test in held_out(y, groups):
            known = model(train)
            errors += [abs(known.ratio(x) - ratio) for x, ratio in zip(features[test], y[test], strict=True)]
            distances += [known.distances(x) for x in features[test]]
        self.model_, self.width_ = model(slice(None)), float(held_out_quantile(np.array(errors), COVERAGE))
        self.error_, self.limits_ = float(np.mean(errors)), distance_limits(np.array(distances))
        return self

    def ratio_of(self, features: Floats) -> float:
        return self.model_.ratio(features)

    def answer(self, X: Sequence[Floats] | Floats) -> list[Answer]:
        """RecognitionError for another number of features."""
        X = finite("X", X, 3)
        far = [reason_out_of_distribution(DISTANCES, self.model_.distances(x[0]), self.limits_) for x in X]
        return [replace(answer, out_of_distribution=reason) for answer, reason in
                zip(super().answer(X), far, strict=True)]

    def summary(self) -> str:
        return f"{self.model_.mean.size} features, interval of {100 * self.width_:.1f} points"


@dataclass(frozen=True)
class ProcessModel:
    """A fitted Gaussian process with Matern's kernel (nu 5/2), and the law of its features.

    mean, scale (p,): of the features; points (n, m), weights (n,): of the process, in the first m standardised
    features; constant, length: of its kernel; offset, size: mean and standard deviation of the ratio in training; law:
    of the standardised features, taken as one channel.
    """

    mean: Floats
    scale: Floats
    points: Floats
    weights: Floats
    constant: float
    length: float
    offset: float
    size: float
    law: RatioLaw

    def ratio(self, features: Floats) -> float:
        """Of the features (p,) of a record."""
        m = self.points.shape[1]
        away = self.points - self.standardised(features)[:m]
        r = np.sqrt(5) * np.linalg.norm(away, axis=1) / self.length
        smooth = self.constant * np.exp(-r) * self.weights
        return float(self.offset + self.size * (smooth @ (1 + r + r**2 / 3)))

    def distances(self, features: Floats) -> Floats:
        """Distances of features (p,) from the training, shape (3,), see `LawEstimate.distances`."""
        return self.law.estimate(self.standardised(features)[None]).distances

    def standardised(self, features: Floats) -> Floats:
        """Features (p,) of a record. RecognitionError for another number of them."""
        if features.shape != self.mean.shape:
            raise RecognitionError(f"{features.size} features; the model has {self.mean.size}")
        return (features - self.mean) / self.scale


def _process(z: Floats, y: Floats) -> GaussianProcessRegressor:
    # The bounds keep the search from the answer that all is noise, which is always there.
    kernel = ConstantKernel(1.0, (1e-2, 1e3)) * Matern(10.0, (0.3, 1e3), nu=2.5) + WhiteKernel(0.1, (1e-6, 1.0))
    with warnings.catch_warnings():
        # A scale of the kernel at its bound is an answer too: a straight line, or no noise.
        warnings.simplefilter("ignore", ConvergenceWarning)
        return GaussianProcessRegressor(kernel, normalize_y=True, random_state=0).fit(z, y)


def fit_process(features: Floats, y: Floats, conditions: Floats | None = None,
                groups: Floats | None = None) -> ProcessModel:
    """Of features (runs, p) of records of ratio y (runs,); conditions, groups: as in `fit_law`. RecognitionError."""
    mean, scale = features.mean(axis=0), features.std(axis=0)
    if not scale.all():
        raise RecognitionError(f"feature {int(scale.argmin())} has the same value in all {len(y)} training records")
    z = (features - mean) / scale
    process = _process(z, y)
    smooth = process.kernel_.k1
    law = fit_law(z[:, None, :], y, conditions, groups, components=z.shape[1])
    return ProcessModel(mean, scale, z, process.alpha_, float(smooth.k1.constant_value), float(smooth.k2.length_scale),
                        float(y.mean()), float(y.std()), law)
