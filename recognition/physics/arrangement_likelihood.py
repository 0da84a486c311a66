"""Which stones are gangue: one likelihood for every arrangement of stones that fall on known places.

The plate is linear, so a record is the sum of what every stone does to it,

    x = sum over stones of G_i F_i + e,

G_i the plate's answer to a push on place i (plate_fem/response.py), F_i(t) the force of stone i, normally distributed about
the mean of its material with a covariance, both learnt from simulated stones and in shares of the impact speed, and e what
the plate's model leaves of a simulated record, and the sensors' noise. With ten stones there are 1024 arrangements; each has
a likelihood, and those of one ratio together give the ratio's probability, all ratios being equally likely beforehand. A
speed that varied in training is averaged over, a damping is one more scatter of x.

Neighbours that swap places look alike (the bending wave with a hill on one and a valley on the next has over 10 kHz, a push
reaches 4), but mixtures that look alike mostly have the same ratio. See Hansen, Discrete Inverse Problems (2010), for the
ill-posed case, in which all ten forces are sought.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from itertools import product
from math import comb
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy.linalg import cho_factor, cho_solve

from analysis.records import sample_rate_Hz
from recognition.channels import Channels
from recognition.errors import RecognitionError
from recognition.regression.saved_likelihood import Recognition

if TYPE_CHECKING:
    from recognition.physics.force_records import Lesson

#: Time from the first contact that is listened to. Pushes last 0.45 ms; what the plate rings on holds them still.
LISTENED_S, MOST_SAMPLES = 3.75e-3, 60
MOST_STONES = 12  # 4096 arrangements
#: Speeds looked at, in shares of the range in training: beyond it, to see that a record does not belong there.
SPEEDS, BEYOND = 31, 0.5
#: Share of the interval left out on either side.
TAIL = 0.05
MISFIT = "misfit of the plate's model"
STRANGE = (MISFIT, "another impact speed explains it better", "stones that scatter too little")
#: A log-likelihood that another speed gains which is as strange as the 1 that strangeness is scaled to: twenty times as likely.
GAIN = 3.0


@dataclass(frozen=True)
class StonesEstimate:
    """probability (stones + 1,): of 0, 1, 2 ... stones of gangue; misfit: least chi-square over the number of samples;
    gain: of log-likelihood, if the speed may lie outside the training."""

    probability: np.ndarray
    misfit: float
    gain: float

    @property
    def ratio(self) -> float:
        """Mean over the probability."""
        return float(self.probability @ np.linspace(0, 1, self.probability.size))

    @property
    def interval(self) -> tuple[float, float]:
        """Ratios between which 90 % lie, at least."""
        below = np.cumsum(self.probability)
        low, high = np.searchsorted(below, [TAIL + 1e-12, 1 - TAIL - 1e-12])
        return low / (self.probability.size - 1), min(high, self.probability.size - 1) / (self.probability.size - 1)


@lru_cache(maxsize=4)
def arrangements(stones: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """1 and which stones are gangue (2^stones, 1 + stones), how many (2^stones,), and the prior, even over the ratios."""
    which = np.array(list(product((0.0, 1.0), repeat=stones)))
    count = which.sum(axis=1).astype(int)
    prior = 1 / np.array([comb(stones, k) for k in count])
    return np.column_stack([np.ones(len(which)), which]), count, prior / prior.sum()


@dataclass(frozen=True)
class StoneNumbers:
    """Fitted; d = channels x samples, p powers of the speed.

    scale (channels,): of the signals, x being in shares of it; rest (channels,): rms of what the plate's model leaves;
    scatter (d, d): covariance of x from stone to stone, at the speed middle_m_s; mean (p, d, 1 + stones): of a record of
    coal alone, and what each stone of gangue adds to it, by (v - middle)^k and in shares of v / middle; low, high: of the
    speed in training.
    """

    scale: np.ndarray
    rest: np.ndarray
    scatter: np.ndarray
    mean: np.ndarray
    middle_m_s: float
    low_m_s: float
    high_m_s: float

    @property
    def stones(self) -> int:
        return self.mean.shape[2] - 1

    @property
    def samples(self) -> int:
        return self.mean.shape[1] // len(self.scale)

    def speeds_m_s(self) -> np.ndarray:
        speeds = np.linspace(self.low_m_s * (1 - BEYOND), self.high_m_s * (1 + BEYOND), SPEEDS)
        return np.union1d(speeds, [self.low_m_s, self.high_m_s])

    def mean_at(self, speed_m_s: float) -> np.ndarray:
        """Of a record of coal alone, and what each stone of gangue adds, shape (d, 1 + stones)."""
        return np.tensordot(self._law(np.array([speed_m_s]))[0], self.mean, 1)

    def _law(self, speeds_m_s: np.ndarray) -> np.ndarray:
        """Share of each power of the speed in the mean, shape (speeds, p)."""
        return speeds_m_s[:, None] / self.middle_m_s * (speeds_m_s[:, None] - self.middle_m_s) ** np.arange(len(self.mean))

    def estimate(self, record: np.ndarray, speed_m_s: float | None = None) -> StonesEstimate:
        """Of one record (channels, samples + 1) of `Stones.prepare`; speed_m_s where it is told."""
        speeds = self.speeds_m_s() if speed_m_s is None else np.array([speed_m_s])
        inside = (speeds >= self.low_m_s - 1e-9) & (speeds <= self.high_m_s + 1e-9) if speed_m_s is None else np.array([True])
        chi = self._chi_square(record, speeds)
        # Where even the best arrangement fits worse than the scatter allows, all are held to be less certain.
        heat = max(1.0, float(chi[inside].min()) / len(self.scatter))
        _, count, prior = arrangements(self.stones)
        weight = np.exp((chi[inside].min() - chi[inside]) / (2 * heat)) * prior
        probability = np.bincount(count, weight.sum(axis=0)) / weight.sum()
        gain = (chi[inside].min() - chi.min()) / (2 * heat)
        return StonesEstimate(probability, float(chi[inside].min()) / len(self.scatter), float(gain))

    def _chi_square(self, record: np.ndarray, speeds_m_s: np.ndarray) -> np.ndarray:
        """Of every arrangement at every speed, shape (speeds, 2^stones)."""
        x = (record[:, :-1] / self.scale[:, None]).ravel()
        variance = np.repeat(self.rest**2 + (record[:, -1] / self.scale) ** 2, self.samples)
        powers, d, columns = self.mean.shape
        known = np.column_stack([x, self.mean.transpose(1, 0, 2).reshape(d, -1)])
        factor = cho_factor(self.scatter + np.diag(variance), lower=True, check_finite=False)
        inner = known.T @ cho_solve(factor, known, check_finite=False)
        # The mean at a speed is a sum over powers; so are its products with itself and with x.
        law = self._law(speeds_m_s)
        blocks = inner[1:, 1:].reshape(powers, columns, powers, columns)
        squares = np.einsum("vp,vq,piqj->vij", law, law, blocks, optimize=True)
        sums = law @ inner[0, 1:].reshape(powers, columns)
        which = arrangements(columns - 1)[0]
        pairs = (which[:, :, None] * which[:, None, :]).reshape(len(which), -1)
        return squares.reshape(len(law), -1) @ pairs.T - 2 * sums @ which.T + inner[0, 0]


def strangeness(found: StonesEstimate, usual: np.ndarray) -> np.ndarray:
    """Shape (3,), as in STRANGE, 1 being as expected; usual (3,): logarithm of the misfit of usual records, a quadratic in the
    ratio, for coal scatters more than gangue."""
    return np.array([found.misfit, found.gain / GAIN, np.exp(np.polyval(usual, found.ratio)) / found.misfit])


def noise_of(signals: np.ndarray) -> np.ndarray:
    """Standard deviation (m,) of white noise on smooth signals (m, n): of their third differences, over the last quarter,
    where the plate's high modes have died away. At 6667 Hz what is left of them counts as noise of 1 %."""
    late = signals[:, -(signals.shape[1] // 4):]
    return np.sqrt(np.mean(np.diff(late, 3, axis=1) ** 2, axis=1) / 20)


class Stones:
    """The method: scikit-learn's conventions, and `lessons` beside X."""

    def prepare(self, signals: pd.DataFrame) -> np.ndarray:
        """Velocity of the centre of mass, accelerometers and rods, and in the last column each one's noise, shape
        (channels, samples + 1)."""
        values = Channels("plate").prepare(signals)
        samples = min(MOST_SAMPLES, round(LISTENED_S * sample_rate_Hz(signals["t_s"].to_numpy(dtype=float), "record")))
        if values.shape[1] < 4 * samples:
            raise RecognitionError(f"{values.shape[1]} samples; needs {4 * samples} to tell the sensors' noise")
        return np.column_stack([values[:, :samples], noise_of(values)])

    def fit(self, X, y, groups=None, nuisance=None, lessons: Sequence[Lesson | None] = ()) -> Stones:
        """X (runs, channels, samples + 1); lessons: of the same runs, None where there is none. groups (runs,): draws, for
        the limits of what is usual. All else is in the lessons. RecognitionError where too few stones fell on the same
        places at once."""
        # Late: records are recognised without the simulation.
        from recognition.physics.arrangement_fit import fit_numbers, usual_limits

        groups = np.asarray(y if groups is None else groups)
        self.numbers_ = fit_numbers(np.asarray(X, dtype=float), lessons, groups)
        self.usual_, self.limit_ = usual_limits(np.asarray(X, dtype=float), lessons, groups, np.asarray(y))
        return self

    def recognise(self, x: np.ndarray, speed_m_s: float | None = None) -> Recognition:
        """Of one record (channels, samples + 1); speed_m_s where it is told."""
        shape = (len(self.numbers_.scale), self.numbers_.samples + 1)
        if x.shape != shape:
            raise RecognitionError(f"{x.shape[0]} channels of {x.shape[1] - 1} samples; the model has {shape[0]} of {shape[1] - 1}")
        found = self.numbers_.estimate(x, speed_m_s)
        strange = "; ".join(f"{what} {value:.3g}, limit {most:.3g}" for what, value, most in
                            zip(STRANGE, strangeness(found, self.usual_), self.limit_, strict=True) if value > most)
        return Recognition(found.ratio, *found.interval, strange)

    def predict(self, X) -> np.ndarray:
        """Mixing ratio of each record, shape (runs,)."""
        return np.array([self.recognise(x).ratio for x in X])

    def to_dict(self) -> dict:
        numbers = {name: _shortened(value) for name, value in asdict(self.numbers_).items()}
        return {"numbers": numbers, "usual": self.usual_.tolist(), "limit": self.limit_.tolist()}

    @classmethod
    def from_dict(cls, data: dict) -> Stones:
        method = cls()
        saved = data["numbers"]
        scale, rest, scatter, mean = (np.asarray(saved[name], dtype=float) for name in ("scale", "rest", "scatter", "mean"))
        middle, low, high = (float(saved[name]) for name in ("middle_m_s", "low_m_s", "high_m_s"))
        method.numbers_ = StoneNumbers(scale, rest, scatter, mean, middle, low, high)
        n = method.numbers_
        if not (n.mean.ndim == 3 and n.scatter.ndim == 2 and n.scale.shape == n.rest.shape != (0,) and 1 <= n.stones <= MOST_STONES
                and n.mean.shape[1] == n.scatter.shape[0] == n.samples * n.scale.size):
            raise ValueError("the stones' arrays do not fit together")
        method.usual_, method.limit_ = (np.asarray(data[name], dtype=float) for name in ("usual", "limit"))
        return method


def _shortened(value) -> list | float:
    """To seven digits, which is more than a sensor has: a third of the file."""
    return np.vectorize(lambda number: float(f"{number:.7g}"))(np.asarray(value, dtype=float)).tolist()
