"""What the laboratory compares with the methods of a model: the impulse, which takes the mean velocity of the plate, and a
straight line; and an oracle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import comb
from scipy.stats import multivariate_normal
from sklearn.linear_model import LinearRegression

from analysis.sweep.runs import Run
from lab.recognition.impulse import impulse
from recognition.estimation.answer import Answer
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError
from recognition.estimation.method import Groups, MethodEntry, RatioEstimator, Registry
from recognition.estimation.window import channels_of
from recognition.methods import METHODS
from recognition.physics.arrangement_likelihood import ArrangementEstimate
from recognition.regression.feature_regression import FeatureRegression, GroupConformal


@dataclass
class EstimatorMethod(RatioEstimator):
    """Any regressor of scikit-learn on what `features` makes of a record, an array of the same shape for each, with
    intervals by `GroupConformal`. It is not saved in model files."""

    features: Callable[[pd.DataFrame], Floats]
    estimator: Any
    conformal_: GroupConformal = field(init=False, repr=False)

    def prepare(self, signals: pd.DataFrame, run: Run | None = None) -> Floats:
        """Features of one record."""
        return self.features(signals)

    def fit(self, X: Sequence[Floats] | Floats, y: Floats, *, groups: Groups | None = None,
            nuisance: pd.DataFrame | None = None) -> EstimatorMethod:
        """Raises RecognitionError."""
        self.conformal_ = GroupConformal(self.estimator).fit(np.asarray(X), y, groups, None if nuisance is None else nuisance.to_numpy(dtype=float))
        return self

    def predict(self, X: Sequence[Floats] | Floats) -> Floats:
        """Mixing ratio of each record, shape (runs,)."""
        return np.array([answer.ratio for answer in self.answer(X)])

    def answer(self, X: Sequence[Floats] | Floats) -> list[Answer]:
        """Answers to records; none is called out of distribution."""
        rows = self.conformal_.predict_interval(np.asarray(X))
        return [Answer(float(ratio), float(low), float(high)) for ratio, low, high in rows]

    def summary(self) -> str:
        return f"interval of {100 * self.conformal_.width_:.1f} points"


@dataclass
class Oracle:
    """Each stone's true impulse and peak force, which no sensor shows: normal laws of their logarithms for coal and
    gangue, and Bayes' rule over the ratios, all equally likely."""

    means_: list[Floats] = field(init=False, repr=False)
    covariances_: list[Floats] = field(init=False, repr=False)

    def prepare(self, signals: pd.DataFrame, run: Run | None = None) -> pd.DataFrame:
        """What stones.parquet has. RecognitionError without it."""
        if run is None or run.stones is None:
            raise RecognitionError("no column 'impulse_Ns' in stones.parquet, which the run does not have")
        return run.stones[["kind", "impulse_Ns", "peak_force_N"]]

    def fit(self, X: Sequence[pd.DataFrame], y: Floats, *, groups: Groups | None = None,
            nuisance: pd.DataFrame | None = None) -> Oracle:
        """From stones of known kind."""
        every = pd.concat(X)
        logs = [np.log(every.loc[every["kind"] == kind, ["impulse_Ns", "peak_force_N"]]) for kind in ("coal", "gangue")]
        self.means_ = [one.mean().to_numpy() for one in logs]
        self.covariances_ = [np.cov(one.T) for one in logs]
        return self

    def answer(self, X: Sequence[pd.DataFrame]) -> list[Answer]:
        """Answers to runs."""
        return [self._answer(np.log(x[["impulse_Ns", "peak_force_N"]].to_numpy())) for x in X]

    def _answer(self, logs: Floats) -> Answer:
        coal, gangue = (multivariate_normal(mean, covariance).logpdf(logs)
                        for mean, covariance in zip(self.means_, self.covariances_, strict=True))
        ways = np.ones(1)  # sums over arrangements of the product of likelihoods, by the number of gangue
        for odds in np.exp(np.clip(gangue - coal, -30, 30)):
            ways = np.append(ways, 0.0) + odds * np.append(0.0, ways)
        probability = ways / comb(len(logs), np.arange(len(logs) + 1))
        found = ArrangementEstimate(probability / probability.sum(), 1.0, 0.0, 0.0, 0.0)
        return Answer(found.ratio, *found.interval)

    def summary(self) -> str:
        return "knows the truth of every stone"


def rms_of_acceleration(signals: pd.DataFrame) -> Floats:
    """Root mean square of the centre of mass' acceleration, shape (1,)."""
    return np.asarray(np.sqrt(np.mean(channels_of(signals, "centre")[1:] ** 2, axis=1)))


class ImpulseRegression(FeatureRegression):
    """A Gaussian process on the stones' impulse and its standard error, shape (2, 1), which take other channels."""

    def __init__(self) -> None:
        super().__init__("rms")

    def prepare(self, signals: pd.DataFrame, run: Run | None = None) -> Floats:
        found = impulse(signals)
        return np.array([[found.impulse_N_s], [found.standard_error_N_s]])


def _line() -> EstimatorMethod:
    return EstimatorMethod(rms_of_acceleration, LinearRegression())


BASELINES: Registry = {
    "impulse": MethodEntry("impulse from plate and rods", ImpulseRegression),
    "rms_line": MethodEntry("RMS and a straight line", _line),
    "oracle": MethodEntry("true impulse and peak of each stone", Oracle, told=True),
}
EVALUATED: Registry = {**METHODS, **BASELINES}
