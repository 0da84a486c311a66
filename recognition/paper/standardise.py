"""Standardisation of parameters (Eqs. 38, 39) and normalisation of responses (Eq. 41)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.stats import spearmanr

from recognition.estimation.arrays import Floats, Integers
from recognition.estimation.errors import RecognitionError


@dataclass
class MinMaxByTrend:
    """Eq. 39: (x - min) / (max - min) for rising parameters, (x - max) / (min - max) for falling ones.

    With every direction +1 it is Eq. 38. Minima and maxima come from the training data
    alone; a later sample outside them goes outside [0, 1] and is not clipped.
    """

    minimum: Floats = field(init=False, repr=False)
    maximum: Floats = field(init=False, repr=False)
    direction: Integers = field(init=False, repr=False)

    def fit(self, x: Floats, directions: Integers) -> MinMaxByTrend:
        """x: shape (n, p); directions: shape (p,), +1 or -1."""
        x = np.asarray(x, dtype=float)
        self.minimum, self.maximum = x.min(axis=0), x.max(axis=0)
        self.direction = np.asarray(directions, dtype=int)
        flat = np.flatnonzero(self.maximum == self.minimum)
        if flat.size:
            raise RecognitionError(f"parameter {flat[0]} has the same value in all {len(x)} training records")
        return self

    def transform(self, x: Floats) -> Floats:
        """Standardised parameters, shape (n, p) as given."""
        rising = (np.asarray(x, dtype=float) - self.minimum) / (self.maximum - self.minimum)
        return np.where(self.direction > 0, rising, 1.0 - rising)


def trend(x: Floats, ratios: Floats) -> Integers:
    """Direction of each parameter with the ratio: the sign of Spearman's rank correlation.

    x: shape (n, p); returns shape (p,), +1 or -1 (+1 where there is no trend at all).
    """
    rho = np.array([spearmanr(ratios, column).statistic for column in np.asarray(x).T])
    return np.where(rho < 0, -1, 1)


@dataclass(frozen=True)
class ResponseRange:
    """Eq. 41: each response scaled by its minimum and maximum over all training runs together."""

    minimum: float
    maximum: float

    @classmethod
    def of(cls, signals: Floats, name: str = "response") -> ResponseRange:
        """signals: shape (n_runs, n_samples)."""
        low, high = float(np.min(signals)), float(np.max(signals))
        if not low < high:
            raise RecognitionError(f"{name}: the same value {low:g} in all training runs")
        return cls(low, high)
