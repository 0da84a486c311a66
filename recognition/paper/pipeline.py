"""Figure 38 as a pipeline: responses -> normalisation -> Kalman fusion -> function space -> ratio."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from sklearn.base import clone

from analysis.sweep.runs import Run
from recognition.estimation.answer import Answer, answers_within
from recognition.estimation.arrays import Floats
from recognition.estimation.calibration import held_out_width
from recognition.estimation.method import Groups, RecordEstimator
from recognition.paper.fusion import Fusion
from recognition.paper.strategy import Candidate, Rule, Strategy


def as_published() -> Strategy:
    """The strategy as the paper gives it: degree by R^2 >= 0.99, a mean over whatever points are usable."""
    return Strategy(Rule(min_r2=0.99), least_share=0.0, judge="mean")


def modified() -> Strategy:
    """Every degree 2, since R^2 > 0.99 lets straight lines through a bent law; every moment counts."""
    return Strategy(Rule(degree=2), least_share=0.5, judge="truncated")


@dataclass
class FusionPipeline(RecordEstimator):
    """A fusion of plate responses and the strategy on its curve; a method of recognition
    (`recognition.estimation.method`).

    fusion: which responses, and the filter (not fitted yet); strategy: function space and
    judge (not fitted yet). X has the shape (runs, m, n): `prepare` of each run's signals.

    >>> sweep = read_sweep("runs/paper")
    >>> pipeline = FusionPipeline(Fusion("energy"), Strategy(Rule(degree=2), judge="truncated"))
    >>> X = np.stack([pipeline.prepare(run.signals) for run in sweep.runs])
    >>> bool(abs(pipeline.fit(X, sweep.ratios).predict(X) - sweep.ratios).max() < 0.05)
    True
    """

    fusion: Fusion = field(default_factory=Fusion)
    strategy: Strategy = field(default_factory=Strategy)
    width_: float = field(init=False, repr=False)

    def prepare(self, signals: pd.DataFrame, run: Run | None = None) -> Floats:
        """Responses of one record, shape (m, n)."""
        return self.fusion.prepare(signals)

    def fit(self, X: Sequence[Floats] | Floats, y: Floats, *, groups: Groups | None = None,
            nuisance: pd.DataFrame | None = None) -> FusionPipeline:
        """X: responses (runs, m, n), y: ratios (runs,). Groups tell the width of the intervals, conditions play no
        part."""
        responses, ratios = np.asarray(X), np.asarray(y)
        self.width_ = held_out_width(clone(self), responses, ratios, groups)
        return self.learn(responses, ratios)

    def learn(self, responses: Floats, ratios: Floats) -> FusionPipeline:
        """Fusion and function space alone."""
        self.fusion.fit(responses)
        self.strategy.fit(self.fusion.transform(responses), ratios)
        return self

    def transform(self, responses: Floats) -> Floats:
        """Fusion curves QQ, shape (runs, n)."""
        return self.fusion.transform(responses)

    def predict(self, responses: Floats) -> Floats:
        """Mixing ratio of each run, shape (runs,). Raises NotRecognised."""
        return self.strategy.predict(self.transform(responses))

    def recognise(self, responses: Floats) -> Candidate:
        """Of one run, shape (m, n), with how well it is supported. Raises NotRecognised."""
        return self.strategy.recognise(self.transform(responses))

    def answer(self, X: Sequence[Floats] | Floats) -> list[Answer]:
        """Ratios, with intervals by the errors on what was held out of the training."""
        return answers_within(self.width_, lambda x: self.recognise(x).ratio, X)

    def summary(self) -> str:
        space = self.strategy.space_
        return f"functions at {space.moments.size} of {space.n_moments} moments"
