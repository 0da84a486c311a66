"""Responses of the plate: normalised (Eqs. 38, 39, 41), Kalman-filtered by filterpy, and fused (Section V-B).

The paper names neither its state model nor its covariances. The model here is the plainest that does what its figures
describe (smaller and slower fluctuation):

    x_k = x_(k-1) + w,  w ~ N(0, q)          the response as a random walk
    y_k = [1 ... 1]^T x_k + v,  v ~ N(0, r I)  m normalised responses, each measuring it

With m = 1 it filters one response, with m > 1 it fuses them. Only q / r matters: the answer scales with the signal, and
the filter needs no unit. It starts at the mean of the first samples with variance r / m, as measured.
"""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Self

import numpy as np
import pandas as pd
from scipy.stats import spearmanr

from recognition.estimation.arrays import Floats, Integers, finite
from recognition.estimation.errors import RecognitionError
from recognition.estimation.method import Fitted

ENERGY_RESPONSES = ("internal_J", "kinetic_J", "total_J")
MOTIONS = ("a_m_s2", "v_m_s", "u_m")

#: What each fusion takes; |...| is the absolute value of a response.
FUSIONS = {
    "energy": ENERGY_RESPONSES,
    "other": MOTIONS,
    "absolute": tuple(f"|{name}|" for name in MOTIONS),
    "composite": ENERGY_RESPONSES + MOTIONS,
}
#: q / r. The steady gain is then 0.27 for one signal (a time constant of about three samples, 0.5 ms at 6667 Hz) and
#: 0.42 in total for three. An assumption: the paper gives none.
PROCESS_TO_MEASUREMENT = 0.1


def plate_response(signals: pd.DataFrame, name: str) -> Floats:
    """A response by name, `|a_m_s2|` being the absolute value of `a_m_s2`; shape (n,)."""
    column = name.strip("|")
    if column not in signals.columns:
        raise RecognitionError(f"no column {column!r} in the record; needs it for the fusion")
    values = signals[column].to_numpy(dtype=float)
    if not np.all(np.isfinite(values)):
        raise RecognitionError(f"column {column!r} of the record has a value that is not finite")
    return np.abs(values) if name.startswith("|") else values


@dataclass(eq=False)
class Fusion(Fitted):
    """One of the four fusions: normalisation (41) fitted to training runs, then the Kalman filter.

    >>> fusion = Fusion("energy")
    >>> responses = np.stack([fusion.prepare(run.signals) for run in read_sweep("runs/paper").runs])
    >>> fusion.fit(responses).transform(responses).shape
    (11, 267)
    """

    kind: str = "energy"
    process_to_measurement: float = PROCESS_TO_MEASUREMENT
    low_: Floats = field(init=False, repr=False)
    high_: Floats = field(init=False, repr=False)

    @property
    def names(self) -> tuple[str, ...]:
        """The responses taken. RecognitionError for an unknown kind."""
        if self.kind not in FUSIONS:
            raise RecognitionError(f"fusion {self.kind!r}; choose one of {', '.join(FUSIONS)}")
        return FUSIONS[self.kind]

    def prepare(self, signals: pd.DataFrame) -> Floats:
        """The responses of one run, shape (m, n)."""
        return np.stack([plate_response(signals, name) for name in self.names])

    def fit(self, responses: Floats) -> Self:
        """Minima and maxima (m, 1) over training runs, responses (runs, m, n). RecognitionError for a constant one."""
        responses = self._responses(responses)
        self.low_, self.high_ = (end(responses, axis=(0, 2))[:, None] for end in (np.min, np.max))
        for name, low, high in zip(self.names, self.low_[:, 0], self.high_[:, 0], strict=True):
            if not low < high:
                raise RecognitionError(f"{name}: the same value {low:g} in all training runs")
        return self

    def normalised(self, responses: Floats) -> Floats:
        """The normalised responses before fusion, shape (..., m, n) as given."""
        return (self._responses(responses) - self.low_) / (self.high_ - self.low_)

    def _responses(self, responses: Floats) -> Floats:
        """RecognitionError for what is not finite, or for another number of responses."""
        responses = finite("responses", responses, 2)
        if responses.shape[-2] != len(self.names):
            raise RecognitionError(f"responses have shape {responses.shape}; needs (..., {len(self.names)}, n)")
        return responses

    def transform(self, responses: Floats) -> Floats:
        """The fusion parameter QQ at each sample: shape (..., m, n) to (..., n)."""
        return fuse(self.normalised(responses), self.process_to_measurement)


@lru_cache(maxsize=32)
def gains(count: int, samples: int, process_to_measurement: float) -> Floats:
    """Gain of each sample on each of `count` signals, shape (samples, count), by filterpy.

    Gains of a linear filter do not depend on the data: they are found once for all records.
    """
    from filterpy.kalman import KalmanFilter  # late: it pulls matplotlib

    kalman = KalmanFilter(dim_x=1, dim_z=count)
    kalman.P = np.array([[1.0 / count]])
    kalman.F = np.eye(1)
    kalman.H = np.ones((count, 1))
    kalman.Q = np.array([[process_to_measurement]])
    kalman.R = np.eye(count)
    found = np.empty((samples, count))
    found[0] = 1.0 / count
    for k in range(1, samples):
        kalman.predict()
        kalman.update(np.zeros((count, 1)))
        found[k] = kalman.K[0]
    found.flags.writeable = False
    return found


def fuse(signals: Floats, process_to_measurement: float = PROCESS_TO_MEASUREMENT) -> Floats:
    """Fuse m normalised responses: (..., m, n) to (..., n). RecognitionError for one not finite, or q / r below 0.

    >>> fuse([[1.0, 1.0, 1.0], [3.0, 3.0, 3.0]]).tolist()
    [2.0, 2.0, 2.0]
    """
    signals = finite("signals", signals, 2)
    if not 0 <= process_to_measurement < np.inf:
        raise RecognitionError(f"process_to_measurement = {process_to_measurement}; must be finite and at least 0")
    count, samples = signals.shape[-2:]
    weights = gains(count, samples, float(process_to_measurement))
    measured, total = np.einsum("...mk,km->...k", signals, weights), weights.sum(axis=1)
    fused = np.empty(measured.shape)
    fused[..., 0] = measured[..., 0]
    for k in range(1, samples):
        fused[..., k] = (1.0 - total[k]) * fused[..., k - 1] + measured[..., k]
    return fused


def kalman_filter(signal: Floats, process_to_measurement: float = PROCESS_TO_MEASUREMENT) -> Floats:
    """Filter one response, shape (..., n); same unit and shape. RecognitionError as `fuse`.

    >>> kalman_filter([0.0, 1.0, 1.0]).round(3).tolist()
    [0.0, 0.524, 0.707]
    """
    return fuse(finite("signal", signal, 1)[..., None, :], process_to_measurement)


@dataclass
class MinMaxByTrend:
    """Eq. 39: (x - min) / (max - min) for rising parameters, (x - max) / (min - max) for falling ones.

    With every direction +1 it is Eq. 38. Minima and maxima come from the training data
    alone; a later sample outside them goes outside [0, 1] and is not clipped.
    """

    minimum: Floats = field(init=False, repr=False)
    maximum: Floats = field(init=False, repr=False)
    direction: Integers = field(init=False, repr=False)

    def fit(self, x: Floats, directions: Integers) -> Self:
        """x: shape (n, p); directions: shape (p,), +1 or -1."""
        x = np.asarray(x, dtype=float)
        self.minimum, self.maximum = x.min(axis=0), x.max(axis=0)
        self.direction = np.asarray(directions, dtype=int)
        flat = np.flatnonzero(self.maximum == self.minimum)
        if flat.size:
            raise RecognitionError(f"parameter {flat[0]} has the same value in all {len(x)} training records")
        return self

    def transform(self, x: Floats) -> Floats:
        """Standardised parameters, shape (n, p) as given. RecognitionError for another number of them."""
        x = np.asarray(x, dtype=float)
        if x.shape[-1:] != self.minimum.shape:
            raise RecognitionError(f"{x.shape[-1]} features; the model has {self.minimum.size}")
        rising = (x - self.minimum) / (self.maximum - self.minimum)
        return np.where(self.direction > 0, rising, 1.0 - rising)


def trend(x: Floats, ratios: Floats) -> Integers:
    """Direction of each parameter with the ratio: the sign of Spearman's rank correlation.

    x: shape (n, p); returns shape (p,), +1 or -1 (+1 where there is no trend at all).
    """
    rho = np.array([spearmanr(ratios, column).statistic for column in np.asarray(x).T])
    return np.where(rho < 0, -1, 1)
