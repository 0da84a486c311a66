"""The likelihood of all moments as a method of a saved model: numbers only, numpy alone to recognise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from recognition.channels import Channels
from recognition.errors import RecognitionError
from recognition.regression.ratio_posterior import RatioPosterior, why_strange


@dataclass(frozen=True)
class Recognition:
    """ratio, not clipped, with a 90 % interval; strange: why the record is outside the calibration, "" if it is not."""

    ratio: float
    low: float
    high: float
    strange: str


class CalibratedLikelihood:
    """`RatioLikelihood` with intervals by `GroupConformal`, of one set of channels."""

    def __init__(self, kind: str):
        self.channels = Channels(kind)

    def prepare(self, signals: pd.DataFrame) -> np.ndarray:
        """Shape (channels, samples)."""
        return self.channels.prepare(signals)

    def fit(self, X, y, groups=None, nuisance=None) -> CalibratedLikelihood:
        """X (runs, channels, samples); needs scikit-learn. Raises RecognitionError."""
        from recognition.regression.conformal import (
            GroupConformal,  # late: records are recognised without scikit-learn
        )
        from recognition.regression.ratio_likelihood import RatioLikelihood

        conformal = GroupConformal(RatioLikelihood()).fit(X, y, groups, nuisance)
        self.posterior_, self.width_ = conformal.estimator_.posterior_, conformal.width_
        self.limit_ = np.asarray(conformal.limit_)
        return self

    def predict(self, X) -> np.ndarray:
        """Mixing ratio of each record, shape (runs,); not clipped."""
        return np.array([self.recognise(x).ratio for x in X])

    def recognise(self, x: np.ndarray) -> Recognition:
        """Of one record, shape (channels, samples)."""
        shape = (self.posterior_.scale.size, self.posterior_.mean.size // self.posterior_.scale.size)
        if x.shape != shape:
            raise RecognitionError(f"{x.shape[0]} channels of {x.shape[1]} samples; the model has {shape[0]} of {shape[1]}")
        found = self.posterior_.estimate(x)
        half = self.width_ * found.standard_error
        return Recognition(found.ratio, found.ratio - half, found.ratio + half,
                           why_strange(found.strangeness, self.limit_))

    def to_dict(self) -> dict:
        return {"channels": self.channels.kind, "posterior": self.posterior_.to_dict(), "width": self.width_,
                "limit": self.limit_.tolist()}

    @classmethod
    def from_dict(cls, data: dict) -> CalibratedLikelihood:
        method = cls(data["channels"])
        method.posterior_ = RatioPosterior.from_dict(data["posterior"])
        method.width_, method.limit_ = float(data["width"]), np.asarray(data["limit"], dtype=float)
        return method
