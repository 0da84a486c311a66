"""Recognisers for the evaluation, by name: the paper's methods, a straight line, and better ones.

A recogniser is anything with `prepare(signals)` (a record to an array), `fit(X, y, groups, nuisance)` and
`answer(X, nuisance)`; `Recogniser` makes one of any scikit-learn regressor.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, RegressorMixin, TransformerMixin
from sklearn.linear_model import LinearRegression, RidgeCV
from sklearn.pipeline import make_pipeline

from recognition.channels import LIKELIHOOD_CHANNELS, Channels
from recognition.errors import NotRecognised, RecognitionError
from recognition.evaluation.dataset import FAST_TIMES
from recognition.methods import PAPER_METHODS
from recognition.physics.arrangement_likelihood import Stones
from recognition.regression.band_energies import ANSWERING, ENERGIES
from recognition.regression.conformal import GroupConformal
from recognition.regression.gaussian_process import EnergyProcess
from recognition.regression.ratio_likelihood import RatioLikelihood


@dataclass(frozen=True)
class Answers:
    """Of n records: ratio (n,), NaN where there is no answer; low, high (n,), NaN where there is no interval;
    strange (n,) of bool."""

    ratio: np.ndarray
    low: np.ndarray
    high: np.ndarray
    strange: np.ndarray


class PaperMethod(RegressorMixin, BaseEstimator):
    """A method of the paper as it is, by its name in PAPER_METHODS, as an estimator of scikit-learn: no interval, no
    warning, and NaN where it has no answer."""

    fast = learns_from_stones = False

    def __init__(self, name: str):
        self.name = name

    def prepare(self, signals: pd.DataFrame) -> np.ndarray:
        return PAPER_METHODS[self.name]().prepare(signals)

    def fit(self, X, y, groups=None, nuisance=None) -> PaperMethod:
        self.method_ = PAPER_METHODS[self.name]().fit(np.asarray(X), np.asarray(y))
        return self

    def predict(self, X) -> np.ndarray:
        return np.array([self._one(x) for x in X])

    def answer(self, X, nuisance=None) -> Answers:
        none = np.full(len(X), np.nan)
        return Answers(self.predict(X), none, none, np.zeros(len(X), dtype=bool))

    def _one(self, x) -> float:
        try:
            return float(self.method_.predict(x[None])[0])
        except NotRecognised:
            return np.nan


class Recogniser:
    """Any scikit-learn regressor on what `prepare` makes of a record, with intervals by `GroupConformal`.

    with_nuisance: the estimator's `fit` takes the untold conditions as `nuisance`. fast: it takes records at six times the
    sample rate; learns_from_stones: its `fit` takes `lessons` of the runs.
    """

    fast = learns_from_stones = False

    def __init__(self, prepare: Callable[[pd.DataFrame], np.ndarray], estimator, with_nuisance: bool = False):
        self.prepare = prepare
        self.estimator = estimator
        self.with_nuisance = with_nuisance

    def fit(self, X, y, groups=None, nuisance=None) -> Recogniser:
        self.conformal_ = GroupConformal(self.estimator).fit(X, y, groups, nuisance if self.with_nuisance else None)
        return self

    def answer(self, X, nuisance=None) -> Answers:
        told = nuisance if self.with_nuisance else None
        ratio, low, high = self.conformal_.predict_interval(X, told).T
        return Answers(ratio, low, high, self.conformal_.strange(X))


class StoneRecogniser:
    """`recognition.physics.arrangement_likelihood.Stones`; the one condition that may be told with a record is the impact speed."""

    learns_from_stones = True

    def __init__(self, fast: bool):
        self.fast = fast

    def prepare(self, signals: pd.DataFrame) -> np.ndarray:
        return Stones().prepare(signals)

    def fit(self, X, y, groups=None, nuisance=None, lessons=()) -> StoneRecogniser:
        if self.fast:
            lessons = [lesson and replace(lesson, sample_s=lesson.sample_s / FAST_TIMES) for lesson in lessons]
        self.method_ = Stones().fit(X, y, groups, nuisance, lessons)
        return self

    def answer(self, X, nuisance=None) -> Answers:
        speeds = [None] * len(X) if nuisance is None else [float(told[0]) for told in nuisance]
        found = [self.method_.recognise(x, speed) for x, speed in zip(X, speeds, strict=True)]
        ratio, low, high, strange = zip(*((r.ratio, r.low, r.high, r.strange != "") for r in found), strict=True)
        return Answers(np.array(ratio), np.array(low), np.array(high), np.array(strange))


def rms_of_acceleration(signals: pd.DataFrame) -> np.ndarray:
    """Root mean square of the centre of mass' acceleration, shape (1,)."""
    return np.sqrt(np.mean(Channels("centre").prepare(signals)[1:] ** 2, axis=1))


class ChannelScaler(TransformerMixin, BaseEstimator):
    """Channels in shares of their rms over the training, as one row a record."""

    def fit(self, X, y=None) -> ChannelScaler:
        self.scale_ = np.sqrt(np.mean(np.asarray(X) ** 2, axis=(0, 2)))
        return self

    def transform(self, X) -> np.ndarray:
        return (np.asarray(X) / self.scale_[:, None]).reshape(len(X), -1)


def _ridge():
    return make_pipeline(ChannelScaler(), RidgeCV(np.logspace(-2, 6, 17)))


#: name -> an unfitted recogniser. The paper's and the straight line are what others are held against.
RECOGNISERS: dict[str, Callable[[], PaperMethod | Recogniser | StoneRecogniser]] = {
    **{name: partial(PaperMethod, name) for name in PAPER_METHODS},
    "stones": lambda: StoneRecogniser(fast=False),
    "stones_fast": lambda: StoneRecogniser(fast=True),
    "rms_line": lambda: Recogniser(rms_of_acceleration, LinearRegression()),
    "ridge_accelerometers": lambda: Recogniser(Channels("accelerometers").prepare, _ridge()),
    **{name: partial(Recogniser, prepare, EnergyProcess(ANSWERING.get(name)), True) for name, prepare in ENERGIES.items()},
    **{f"likelihood_{kind}": partial(Recogniser, Channels(kind).prepare, RatioLikelihood(), True) for kind in LIKELIHOOD_CHANNELS},
}


def make(name: str) -> PaperMethod | Recogniser | StoneRecogniser:
    """A recogniser by name. RecognitionError for an unknown one."""
    if name not in RECOGNISERS:
        raise RecognitionError(f"method {name!r}; choose among {', '.join(RECOGNISERS)}")
    return RECOGNISERS[name]()
