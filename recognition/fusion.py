"""The four fusions of plate responses (Section V-B-2): energy, other, absolute, composite."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from recognition.errors import RecognitionError
from recognition.kalman import PROCESS_TO_MEASUREMENT, fuse
from recognition.standardise import ResponseRange

ENERGIES = ("internal_J", "kinetic_J", "total_J")
MOTIONS = ("a_m_s2", "v_m_s", "u_m")

#: What each fusion takes; |...| is the absolute value of a response.
FUSIONS = {
    "energy": ENERGIES,
    "other": MOTIONS,
    "absolute": tuple(f"|{name}|" for name in MOTIONS),
    "composite": ENERGIES + MOTIONS,
}


def response(signals: pd.DataFrame, name: str) -> np.ndarray:
    """A response by name, `|a_m_s2|` being the absolute value of `a_m_s2`; shape (n,)."""
    column = name.strip("|")
    if column not in signals.columns:
        raise RecognitionError(f"no column {column!r} in the record; needs it for the fusion")
    values = signals[column].to_numpy(dtype=float)
    if not np.all(np.isfinite(values)):
        raise RecognitionError(f"column {column!r} of the record has a value that is not finite")
    return np.abs(values) if name.startswith("|") else values


@dataclass
class Fusion:
    """One of the four fusions: normalisation (41) learnt from training runs, then the Kalman filter."""

    kind: str = "energy"
    process_to_measurement: float = PROCESS_TO_MEASUREMENT
    ranges: dict[str, ResponseRange] | None = None

    def fit(self, runs: list[pd.DataFrame]) -> Fusion:
        """runs: tables of signals of the training runs."""
        if self.kind not in FUSIONS:
            raise RecognitionError(f"fusion {self.kind!r}; choose one of {', '.join(FUSIONS)}")
        self.ranges = {
            name: ResponseRange.of(np.concatenate([response(run, name) for run in runs]), name)
            for name in FUSIONS[self.kind]
        }
        return self

    def normalised(self, signals: pd.DataFrame) -> np.ndarray:
        """The normalised responses before fusion, shape (m, n)."""
        return np.stack([scale.normalise(response(signals, name)) for name, scale in self.ranges.items()])

    def transform(self, signals: pd.DataFrame) -> np.ndarray:
        """The fusion parameter QQ of one run at each sample, shape (n,)."""
        return fuse(self.normalised(signals), self.process_to_measurement)

    def to_dict(self) -> dict:
        ranges = {name: [scale.minimum, scale.maximum] for name, scale in self.ranges.items()}
        return {"kind": self.kind, "process_to_measurement": self.process_to_measurement, "ranges": ranges}

    @classmethod
    def from_dict(cls, data: dict) -> Fusion:
        ranges = {
            name: ResponseRange(float(low), float(high)) for name, (low, high) in data["ranges"].items()
        }
        return cls(data["kind"], float(data["process_to_measurement"]), ranges)
