"""The four fusions of plate responses (Section V-B-2): energy, other, absolute, composite."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator

from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError
from recognition.paper.kalman import PROCESS_TO_MEASUREMENT, fuse
from recognition.paper.standardise import ResponseRange

ENERGY_RESPONSES = ("internal_J", "kinetic_J", "total_J")
MOTIONS = ("a_m_s2", "v_m_s", "u_m")

#: What each fusion takes; |...| is the absolute value of a response.
FUSIONS = {
    "energy": ENERGY_RESPONSES,
    "other": MOTIONS,
    "absolute": tuple(f"|{name}|" for name in MOTIONS),
    "composite": ENERGY_RESPONSES + MOTIONS,
}


def plate_response(signals: pd.DataFrame, name: str) -> Floats:
    """A response by name, `|a_m_s2|` being the absolute value of `a_m_s2`; shape (n,)."""
    column = name.strip("|")
    if column not in signals.columns:
        raise RecognitionError(f"no column {column!r} in the record; needs it for the fusion")
    values = signals[column].to_numpy(dtype=float)
    if not np.all(np.isfinite(values)):
        raise RecognitionError(f"column {column!r} of the record has a value that is not finite")
    return np.abs(values) if name.startswith("|") else values


@dataclass
class Fusion(BaseEstimator):
    """One of the four fusions: normalisation (41) fitted to training runs, then the Kalman filter.

    >>> fusion = Fusion("energy")
    >>> responses = np.stack([fusion.prepare(run.signals) for run in read_sweep("runs/paper").runs])
    >>> fusion.fit(responses).transform(responses).shape
    (11, 267)
    """

    kind: str = "energy"
    process_to_measurement: float = PROCESS_TO_MEASUREMENT
    ranges_: dict[str, ResponseRange] = field(init=False, repr=False)

    @property
    def names(self) -> tuple[str, ...]:
        """The responses taken. RecognitionError for an unknown kind."""
        if self.kind not in FUSIONS:
            raise RecognitionError(f"fusion {self.kind!r}; choose one of {', '.join(FUSIONS)}")
        return FUSIONS[self.kind]

    def prepare(self, signals: pd.DataFrame) -> Floats:
        """The responses of one run, shape (m, n)."""
        return np.stack([plate_response(signals, name) for name in self.names])

    def fit(self, responses: Floats) -> Fusion:
        """responses: shape (runs, m, n), of the training runs."""
        columns = np.moveaxis(np.asarray(responses), 1, 0)
        self.ranges_ = {n: ResponseRange.of(values, n) for n, values in zip(self.names, columns, strict=True)}
        return self

    def normalised(self, responses: Floats) -> Floats:
        """The normalised responses before fusion, shape (..., m, n) as given."""
        low = np.array([[self.ranges_[name].minimum] for name in self.names])
        high = np.array([[self.ranges_[name].maximum] for name in self.names])
        return (responses - low) / (high - low)

    def transform(self, responses: Floats) -> Floats:
        """The fusion parameter QQ at each sample: shape (..., m, n) to (..., n)."""
        return fuse(self.normalised(responses), self.process_to_measurement)
