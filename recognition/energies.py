"""Energies of a record in windows of time and bands of frequency, and a Gaussian process on their logarithms.

Sensors are pooled, which the arrangement of the stones then hardly moves; a louder record adds to all of them, damping
tilts the windows, a harder blow shifts the bands.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
import pandas as pd

from recognition.calibrated import Recognition
from recognition.channels import Channels
from recognition.errors import RecognitionError
from recognition.posterior import RatioPosterior, why_strange

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


def _rms(signals: pd.DataFrame) -> np.ndarray:
    return log_rms(Channels("accelerometers").prepare(signals), (0.0, 1.0), ())


def _sensors(signals: pd.DataFrame) -> np.ndarray:
    return log_rms(Channels("accelerometers").prepare(signals))


def _all(signals: pd.DataFrame) -> np.ndarray:
    speed = Channels("centre").prepare(signals)[:1]
    rods = Channels("rods").prepare(signals)
    # No bands: above the first modes these two hold so little that noise of a sensor would be all there is.
    return np.concatenate([_sensors(signals), log_rms(speed, WINDOWS, ()), log_rms(rods, WINDOWS, ())])


#: name -> what it takes of a record, shape (p,): the sensors' rms alone, their windows and bands, and the windows of the
#: centre of mass' velocity and of the rods' forces besides.
ENERGIES = {"rms": _rms, "sensors": _sensors, "all": _all}


@dataclass(frozen=True)
class ProcessNumbers:
    """A fitted Gaussian process with Matern's kernel (nu 5/2), and the law that usual records keep.

    mean, scale (p,): of the features; points (n, p), weights (n,): of the process, in standardised features; constant,
    length: of its kernel; offset, size: of the ratio; law: of the standardised features, taken as one channel.
    """

    mean: np.ndarray
    scale: np.ndarray
    points: np.ndarray
    weights: np.ndarray
    constant: float
    length: float
    offset: float
    size: float
    law: RatioPosterior

    def ratio(self, features: np.ndarray) -> float:
        """Of one record, shape (p,)."""
        z = (features - self.mean) / self.scale
        r = np.sqrt(5) * np.linalg.norm(self.points - z, axis=1) / self.length
        kernel = self.constant * (1 + r + r**2 / 3) * np.exp(-r)
        return float(self.offset + self.size * (kernel @ self.weights))

    def strangeness(self, features: np.ndarray) -> np.ndarray:
        """`Estimate.strangeness` by the law, shape (3,)."""
        return self.law.estimate(((features - self.mean) / self.scale)[None]).strangeness


class CalibratedEnergies:
    """A Gaussian process on energies as a method of a saved model, with intervals by `GroupConformal`."""

    def __init__(self, kind: str):
        self.kind = kind

    def prepare(self, signals: pd.DataFrame) -> np.ndarray:
        """Shape (p,)."""
        return ENERGIES[self.kind](signals)

    def fit(self, X, y, groups=None, nuisance=None) -> CalibratedEnergies:
        """X (runs, p); nuisance: see `EnergyProcess.fit`. Needs scikit-learn. Raises RecognitionError."""
        from recognition.intervals import GroupConformal  # late: records are recognised without scikit-learn
        from recognition.process import EnergyProcess

        conformal = GroupConformal(EnergyProcess()).fit(X, y, groups, nuisance)
        self.numbers_, self.width_ = conformal.estimator_.numbers_, conformal.width_
        self.limit_ = np.asarray(conformal.limit_)
        return self

    def predict(self, X) -> np.ndarray:
        """Mixing ratio of each record, shape (runs,); not clipped."""
        return np.array([self.numbers_.ratio(x) for x in X])

    def recognise(self, x: np.ndarray) -> Recognition:
        """Of one record, shape (p,)."""
        if x.shape != self.numbers_.mean.shape:
            raise RecognitionError(f"{x.size} features; the model has {self.numbers_.mean.size}")
        ratio = self.numbers_.ratio(x)
        strange = why_strange(self.numbers_.strangeness(x), self.limit_)
        return Recognition(ratio, ratio - self.width_, ratio + self.width_, strange)

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
        constant, length, offset, size = (float(saved[name]) for name in ("constant", "length", "offset", "size"))
        law = RatioPosterior.from_dict(saved["law"])
        method.numbers_ = ProcessNumbers(mean, scale, points, weights, constant, length, offset, size, law)
        method.width_, method.limit_ = float(data["width"]), np.asarray(data["limit"], dtype=float)
        return method


#: name -> an unfitted method.
ENERGY_METHODS = {f"energies_{kind}": partial(CalibratedEnergies, kind) for kind in ("all", "sensors", "rms")}
