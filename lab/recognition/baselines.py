"""What the laboratory compares with the methods of a model: the likelihood of arrangements where nobody tells it where stones
fall; the impulse, which takes the mean velocity of the plate, and a straight line; and two oracles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
import pandas as pd
from scipy.special import comb
from scipy.stats import multivariate_normal
from sklearn.base import clone
from sklearn.linear_model import LinearRegression

from analysis.sweep.runs import Run
from lab.recognition.impulse import impulse_N_s, signals_of
from recognition.estimation.answer import Answer
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError
from recognition.estimation.method import Groups, MethodEntry, RecordEstimator, Registry
from recognition.estimation.noise import noisy_copies
from recognition.methods import METHODS
from recognition.physics.arrangement_likelihood import ArrangementEstimate
from recognition.physics.arrangement_method import ArrangementLikelihood
from recognition.regression.feature_regression import FeatureRegression

DRAWS = 4000


@dataclass
class EstimatorMethod(RecordEstimator):
    """Any regressor of scikit-learn on what `features` makes of a record, an array of the same shape for each. It is not
    saved in model files."""

    features: Callable[[pd.DataFrame], Floats]
    estimator: Any
    estimator_: Any = field(init=False, repr=False)

    def prepare(self, signals: pd.DataFrame, run: Run | None = None) -> Floats:
        """Features of the record and of its noisy copies."""
        return np.stack([self.features(one) for one in noisy_copies(signals)])

    def learn(self, features: Floats, ratios: Floats) -> Self:
        self.estimator_ = clone(self.estimator).fit(features, ratios)
        return self

    def ratio_of(self, features: Floats) -> float:
        return float(self.estimator_.predict(features[None])[0])

    def summary(self) -> str:
        return f"interval of {100 * self.width_:.1f} points"


@dataclass
class Oracle:
    """Each stone's true impulse and peak force, which no sensor shows: normal laws of their logarithms for coal and
    gangue, and Bayes' rule over the ratios, all equally likely."""

    means_: list[Floats] = field(init=False, repr=False)
    covariances_: list[Floats] = field(init=False, repr=False)

    def prepare(self, signals: pd.DataFrame, run: Run | None = None) -> pd.DataFrame:
        """What stones.parquet has. RecognitionError without it."""
        if run is None or run.stones is None:
            raise RecognitionError("no column 'impulse_N_s' in stones.parquet, which the run does not have")
        return run.stones[["kind", "impulse_N_s", "peak_force_N"]]

    def fit(self, X: Sequence[pd.DataFrame], y: Floats, *, groups: Groups | None = None,
            nuisance: pd.DataFrame | None = None) -> Oracle:
        """From stones of known kind."""
        every = pd.concat(X)
        logs = [np.log(every.loc[every["kind"] == kind, ["impulse_N_s", "peak_force_N"]]) for kind in ("coal", "gangue")]
        self.means_ = [one.mean().to_numpy() for one in logs]
        self.covariances_ = [np.cov(one.T) for one in logs]
        return self

    def answer(self, X: Sequence[pd.DataFrame]) -> list[Answer]:
        """Answers to runs."""
        return [self._answer(np.log(x[["impulse_N_s", "peak_force_N"]].to_numpy())) for x in X]

    def _answer(self, logs: Floats) -> Answer:
        """Sums over arrangements of the product of likelihoods, by the number of gangue."""
        coal, gangue = (multivariate_normal(mean, covariance).logpdf(logs)
                        for mean, covariance in zip(self.means_, self.covariances_, strict=True))
        ways = np.ones(1)
        for odds in np.exp(np.clip(gangue - coal, -30, 30)):
            ways = np.append(ways, 0.0) + odds * np.append(0.0, ways)
            ways /= ways.max()
        return answer_of(ways / comb(len(logs), np.arange(len(logs) + 1)))

    def summary(self) -> str:
        return "knows the truth of every stone"


@dataclass
class OracleOfSum:
    """The true impulse and peak force of all stones together, which is what a plate tells of stones that it cannot tell
    apart: normal laws of their logarithms for each number of gangue, by DRAWS of as many stones of the training."""

    stones_: list[Floats] = field(init=False, repr=False)
    prepare = Oracle.prepare

    def fit(self, X: Sequence[pd.DataFrame], y: Floats, *, groups: Groups | None = None,
            nuisance: pd.DataFrame | None = None) -> OracleOfSum:
        """From stones of known kind."""
        every = pd.concat(X)
        self.stones_ = [every.loc[every["kind"] == kind, ["impulse_N_s", "peak_force_N"]].to_numpy()
                        for kind in ("coal", "gangue")]
        return self

    def answer(self, X: Sequence[pd.DataFrame]) -> list[Answer]:
        """Answers to runs of one number of stones."""
        rng, count = np.random.default_rng(0), len(X[0])
        coal, gangue = (np.cumsum(rng.choice(of, (DRAWS, count)), axis=1) for of in self.stones_)
        both = [np.pad(of, ((0, 0), (1, 0), (0, 0))) for of in (coal, gangue)]  # of the first 0, 1, 2 ... stones
        drawn = [np.log(both[0][:, count - k] + both[1][:, k]) for k in range(count + 1)]
        laws = [multivariate_normal(one.mean(axis=0), np.cov(one.T)) for one in drawn]
        answers = []
        for x in X:
            log = np.array([law.logpdf(np.log(x[["impulse_N_s", "peak_force_N"]].to_numpy().sum(axis=0))) for law in laws])
            answers.append(answer_of(np.exp(log - log.max())))
        return answers

    def summary(self) -> str:
        return "knows the truth of all stones together"


def answer_of(weight: Floats) -> Answer:
    """By what the numbers of gangue 0, 1, 2 ... weigh."""
    found = ArrangementEstimate(weight / weight.sum(), 1.0, 0.0, 0.0, 0.0)
    return Answer(found.ratio, *found.interval)


def rms_of_acceleration(signals: pd.DataFrame) -> Floats:
    """Root mean square of the centre of mass' acceleration, shape (1,)."""
    return np.asarray(np.sqrt(np.mean(signals_of(signals, ["a_m_s2"]) ** 2, axis=1)))


class ImpulseRegression(FeatureRegression):
    """A Gaussian process on the stones' impulse, which takes other channels."""

    def __init__(self) -> None:
        super().__init__("rms")

    def prepare(self, signals: pd.DataFrame, run: Run | None = None) -> Floats:
        return np.array([[impulse_N_s(one)] for one in noisy_copies(signals)])


def _line() -> EstimatorMethod:
    return EstimatorMethod(rms_of_acceleration, LinearRegression())


BASELINES: Registry = {
    "likelihood_sought": MethodEntry("arrangements on places that are sought", ArrangementLikelihood, seeks_impact=True),
    "impulse": MethodEntry("impulse from plate and rods", ImpulseRegression),
    "rms_line": MethodEntry("RMS and a straight line", _line),
    "oracle_of_sum": MethodEntry("true impulse and peak of all stones", OracleOfSum, told=True),
    "oracle": MethodEntry("true impulse and peak of each stone", Oracle, told=True),
}
EVALUATED: Registry = {**METHODS, **BASELINES}
