"""Figure 38 as a pipeline: responses -> normalisation -> Kalman fusion -> function space -> ratio."""

from dataclasses import dataclass, field
from typing import Self

import numpy as np
import pandas as pd

from analysis.sweep.runs import Run
from recognition.estimation.arrays import Floats
from recognition.estimation.method import RecordEstimator
from recognition.estimation.noise import noisy_copies
from recognition.paper.fusion import Fusion
from recognition.paper.strategy import Strategy


@dataclass(eq=False)
class FusionPipeline(RecordEstimator):
    """A fusion of plate responses and the strategy on its curve; a method of recognition
    (`recognition.estimation.method`).

    fusion: which responses, and the filter (not fitted yet); strategy: function space and
    judge (not fitted yet). X has the shape (runs, copies, m, n): `prepare` of each run's signals.

    >>> sweep = read_sweep("runs/paper")
    >>> pipeline = FusionPipeline(Fusion("energy"), Strategy(Rule(degree=2), judge="truncated"))
    >>> X = np.stack([pipeline.prepare(run.signals) for run in sweep.runs])
    >>> bool(abs(pipeline.fit(X, sweep.ratios).predict(X) - sweep.ratios).max() < 0.05)
    True
    """

    fusion: Fusion = field(default_factory=Fusion)
    strategy: Strategy = field(default_factory=Strategy)

    def prepare(self, signals: pd.DataFrame, run: Run | None = None) -> Floats:
        """Responses of a record and of its `noisy_copies`, shape (copies, m, n)."""
        return np.stack([self.fusion.prepare(one) for one in noisy_copies(signals)])

    def learn(self, features: Floats, ratios: Floats) -> Self:
        """Fusion and function space, from responses (runs, m, n)."""
        self.fusion.fit(features)
        self.strategy.fit(self.fusion.transform(features), ratios)
        return self

    def transform(self, responses: Floats) -> Floats:
        """Fusion curves QQ, shape (runs, n)."""
        return self.fusion.transform(responses)

    def ratio_of(self, features: Floats) -> float:
        """By responses (m, n). Raises NotRecognised."""
        return self.strategy.recognise(self.transform(features))

    def summary(self) -> str:
        space = self.strategy.space_
        return f"functions at {space.moments.size} of {space.n_moments} moments"
