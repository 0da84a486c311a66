"""The four fusions of plate responses (Section V-B-2): energy, other, absolute, composite."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from recognition.errors import RecognitionError
from recognition.paper.kalman import PROCESS_TO_MEASUREMENT, fuse
from recognition.paper.standardise import ResponseRange

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
    ranges: dict[str, ResponseRange] = field(default_factory=dict)  # learnt by `fit`

    @property
    def names(self) -> tuple[str, ...]:
        """The responses taken. RecognitionError for an unknown kind."""
        if self.kind not in FUSIONS:
            raise RecognitionError(f"fusion {self.kind!r}; choose one of {', '.join(FUSIONS)}")
        return FUSIONS[self.kind]

    def prepare(self, signals: pd.DataFrame) -> np.ndarray:
        """The responses of one run, shape (m, n)."""
        return np.stack([response(signals, name) for name in self.names])

    def fit(self, responses: np.ndarray) -> Fusion:
        """responses: shape (runs, m, n), of the training runs."""
        columns = np.moveaxis(np.asarray(responses), 1, 0)
        self.ranges = {n: ResponseRange.of(values, n) for n, values in zip(self.names, columns, strict=True)}
        return self

    def normalised(self, responses: np.ndarray) -> np.ndarray:
        """The normalised responses before fusion, shape (..., m, n) as given."""
        low = np.array([[scale.minimum] for scale in self.ranges.values()])
        high = np.array([[scale.maximum] for scale in self.ranges.values()])
        return (responses - low) / (high - low)

    def transform(self, responses: np.ndarray) -> np.ndarray:
        """The fusion parameter QQ at each sample: shape (..., m, n) to (..., n)."""
        return fuse(self.normalised(responses), self.process_to_measurement)

    def to_dict(self) -> dict:
        ranges = {name: [scale.minimum, scale.maximum] for name, scale in self.ranges.items()}
        return {"kind": self.kind, "process_to_measurement": self.process_to_measurement, "ranges": ranges}

    @classmethod
    def from_dict(cls, data: dict) -> Fusion:
        ranges = {
            name: ResponseRange(float(low), float(high)) for name, (low, high) in data["ranges"].items()
        }
        fusion = cls(data["kind"], float(data["process_to_measurement"]), ranges)
        if tuple(ranges) != fusion.names:
            raise RecognitionError(
                f"ranges of {', '.join(ranges)}; the fusion takes {', '.join(fusion.names)}"
            )
        return fusion
