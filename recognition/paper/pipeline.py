"""Figure 38 as a pipeline: responses -> normalisation -> Kalman fusion -> function space -> ratio."""

from __future__ import annotations

import numpy as np
import pandas as pd

from recognition.paper.fusion import Fusion
from recognition.paper.strategy import Answer, Strategy


class FusionPipeline:
    """A fusion of plate responses and the strategy on its curve.

    fusion: which responses, and the filter (not fitted yet); strategy: function space and
    judge (not fitted yet). X has the shape (runs, m, n): `prepare` of each run's signals.
    """

    def __init__(self, fusion: Fusion | None = None, strategy: Strategy | None = None):
        self.fusion = fusion or Fusion()
        self.strategy = strategy or Strategy()

    def prepare(self, signals: pd.DataFrame) -> np.ndarray:
        return self.fusion.prepare(signals)

    def fit(self, responses: np.ndarray, ratios: np.ndarray) -> FusionPipeline:
        self.fusion.fit(responses)
        self.strategy.fit(self.fusion.transform(responses), ratios)
        return self

    def transform(self, responses: np.ndarray) -> np.ndarray:
        """Fusion curves QQ, shape (runs, n)."""
        return self.fusion.transform(responses)

    def predict(self, responses: np.ndarray) -> np.ndarray:
        """Mixing ratio of each run, shape (runs,). Raises NotRecognised."""
        return self.strategy.predict(self.transform(responses))

    def recognise(self, responses: np.ndarray) -> Answer:
        """Of one run, shape (m, n), with how well it is supported."""
        return self.strategy.recognise(self.transform(responses))

    def to_dict(self) -> dict:
        return {"fusion": self.fusion.to_dict(), "strategy": self.strategy.to_dict()}

    @classmethod
    def from_dict(cls, data: dict) -> FusionPipeline:
        return cls(Fusion.from_dict(data["fusion"]), Strategy.from_dict(data["strategy"]))
