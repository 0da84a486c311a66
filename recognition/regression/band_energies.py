"""Energies of a record in windows of time and bands of frequency, and a Gaussian process on their logarithms, or on the
stones' impulse.

Sensors are pooled, which the arrangement of the stones then hardly moves; a louder record adds to all of them, damping
tilts the windows, a harder blow shifts the bands.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
import pandas as pd

from recognition.channels import Channels
from recognition.errors import RecognitionError
from recognition.physics.impulse import impulse
from recognition.regression.ratio_posterior import RatioPosterior, why_strange
from recognition.regression.saved_likelihood import Recognition

#: Ends of windows in shares of the record, ends of bands in shares of half its sample rate.
WINDOWS = (0.0, 0.025, 0.125, 0.375, 1.0)
BANDS = (0.0, 0.1, 0.25, 0.5, 1.0)


def log_rms(signals: np.ndarray, windows=WINDOWS, bands=BANDS) -> np.ndarray:
    """Logarithm of the rms of all signals (m, n) together in each window, then of their spectrum in each band."""
    ends = np.round(np.array(windows) * signals.shape[1]).astype(int)
    parts = [np.sqrt(np.mean(signals[:, a:b] ** 2)) for a, b in pairwise(ends)]
    spectrum = np.abs(np.fft.rfft(signals, axis=1)) ** 2
    ends = np.round(np.array(bands) * spectrum.shape[1]).astype(int)
    parts += [np.sqrt(np.sum(spectrum[:, a:b])) for a, b in pairwise(ends)]
    if min(parts) <= 0:
        raise RecognitionError("the record is silent in a window or a band")
    return np.log(parts)


def _without_errors(features: np.ndarray) -> np.ndarray:
    """An rms of many samples hardly feels the chance of their noise."""
    return np.stack([features, np.zeros_like(features)])


def _rms(signals: pd.DataFrame) -> np.ndarray:
    return _without_errors(log_rms(Channels("accelerometers").prepare(signals), (0.0, 1.0), ()))


def _sensors(signals: pd.DataFrame) -> np.ndarray:
    return _without_errors(log_rms(Channels("accelerometers").prepare(signals)))


def _all(signals: pd.DataFrame) -> np.ndarray:
    speed = Channels("centre").prepare(signals)[:1]
    rods = Channels("rods").prepare(signals)
    # No bands: above the first modes these two hold so little that noise of a sensor would be all there is.
    return np.hstack([_sensors(signals), _without_errors(log_rms(speed, WINDOWS, ())), _without_errors(log_rms(rods, WINDOWS, ()))])


def _impulse(signals: pd.DataFrame) -> np.ndarray:
    found = impulse(signals)
    return np.hstack([[[found.impulse_N_s], [found.standard_error_N_s]], _all(signals)])


#: name -> what it takes of a record, features and their standard errors by the noise of sensors, shape (2, p): the stones' impulse and all that follows; the sensors' windows and bands and
#: the windows of the centre of mass' velocity and of the rods' forces; the sensors alone; and their rms alone.
ENERGIES = {"impulse": _impulse, "energies_all": _all, "energies_sensors": _sensors, "energies_rms": _rms}
#: How many of them, from the first on, the ratio is told from, where that is not all: the others tell strange records.
ANSWERING = {"impulse": 1}


@dataclass(frozen=True)
class ProcessNumbers:
    """A fitted Gaussian process with Matern's kernel (nu 5/2), and the law that usual records keep.

    mean, scale (p,): of the features; points (n, m), weights (n,): of the process, in the first m standardised features; constant,
    length: of its kernel; scatter: mean square error of a record left out; offset, size: of the ratio; law: of the standardised features, taken as one channel.
    """

    mean: np.ndarray
    scale: np.ndarray
    points: np.ndarray
    weights: np.ndarray
    constant: float
    length: float
    scatter: float
    offset: float
    size: float
    law: RatioPosterior

    @property
    def usual_error(self) -> float:
        """Standard error of the ratio of a record without noise."""
        return float(self.size * np.sqrt(self.scatter))

    def ratio(self, record: np.ndarray) -> tuple[float, float]:
        """Of one record, features and their errors (2, p): ratio, and its standard error from the scatter of the training and
        the errors of the features."""
        m = self.points.shape[1]
        away = self.points - ((record[0] - self.mean) / self.scale)[:m]
        r = np.sqrt(5) * np.linalg.norm(away, axis=1) / self.length
        smooth = self.constant * np.exp(-r) * self.weights
        slope = 5 / (3 * self.length**2) * (smooth * (1 + r)) @ away
        error = slope * (record[1] / self.scale)[:m]
        return (float(self.offset + self.size * (smooth @ (1 + r + r**2 / 3))),
                float(np.hypot(self.usual_error, self.size * np.linalg.norm(error))))

    def strangeness(self, record: np.ndarray) -> np.ndarray:
        """`Estimate.strangeness` of features and errors (2, p) by the law, shape (3,)."""
        return self.law.estimate(((record[0] - self.mean) / self.scale)[None]).strangeness


class CalibratedEnergies:
    """A Gaussian process on energies as a method of a saved model, with intervals by `GroupConformal`."""

    def __init__(self, kind: str):
        self.kind = kind

    def prepare(self, signals: pd.DataFrame) -> np.ndarray:
        """Features and their standard errors, shape (2, p)."""
        return ENERGIES[self.kind](signals)

    def fit(self, X, y, groups=None, nuisance=None) -> CalibratedEnergies:
        """X (runs, 2, p); nuisance: see `EnergyProcess.fit`. Needs scikit-learn. Raises RecognitionError."""
        from recognition.regression.conformal import (
            GroupConformal,  # late: records are recognised without scikit-learn
        )
        from recognition.regression.gaussian_process import EnergyProcess

        conformal = GroupConformal(EnergyProcess(ANSWERING.get(self.kind))).fit(X, y, groups, nuisance)
        self.numbers_, self.width_ = conformal.estimator_.numbers_, conformal.width_
        self.limit_ = np.asarray(conformal.limit_)
        return self

    def predict(self, X) -> np.ndarray:
        """Mixing ratio of each record, shape (runs,); not clipped."""
        return np.array([self.numbers_.ratio(x)[0] for x in X])

    def recognise(self, x: np.ndarray) -> Recognition:
        """Of one record, shape (2, p)."""
        if x[0].shape != self.numbers_.mean.shape:
            raise RecognitionError(f"{x[0].size} features; the model has {self.numbers_.mean.size}")
        ratio, error = self.numbers_.ratio(x)
        strange = why_strange(self.numbers_.strangeness(x), self.limit_)
        return Recognition(ratio, ratio - self.width_ * error, ratio + self.width_ * error, strange)

    def to_dict(self) -> dict:
        numbers = {name: np.asarray(value).tolist() for name, value in vars(self.numbers_).items() if name != "law"}
        return {"energies": self.kind, "numbers": numbers | {"law": self.numbers_.law.to_dict()}, "width": self.width_,
                "limit": self.limit_.tolist()}

    @classmethod
    def from_dict(cls, data: dict) -> CalibratedEnergies:
        if data["energies"] not in ENERGIES:
            raise ValueError(f"energies {data['energies']!r}")
        method = cls(data["energies"])
        saved = data["numbers"]
        mean, scale, points, weights = (
            np.asarray(saved[name], dtype=float) for name in ("mean", "scale", "points", "weights"))
        constant, length, scatter, offset, size = (
            float(saved[name]) for name in ("constant", "length", "scatter", "offset", "size"))
        law = RatioPosterior.from_dict(saved["law"])
        method.numbers_ = ProcessNumbers(mean, scale, points, weights, constant, length, scatter, offset, size, law)
        method.width_, method.limit_ = float(data["width"]), np.asarray(data["limit"], dtype=float)
        return method


#: name -> an unfitted method.
ENERGY_METHODS = {name: partial(CalibratedEnergies, name) for name in ENERGIES}
