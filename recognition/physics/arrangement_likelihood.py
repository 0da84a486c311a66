"""Likelihood of every arrangement of coal and gangue on known places.

The plate is linear, so a record x is the sum of the plate's responses to the forces of all stones,

    x = sum over stones of G_i F_i + e.

G_i is the response to a unit force on place i (plate_fem/response.py). F_i(t), the force of stone i, is normally
distributed: its mean depends on the material, its covariance does not; both come from simulated stones and are
proportional to the impact speed. e is the residual of the plate's model on simulated records, and the noise of the
sensors. Ten stones have 1024 arrangements. Each has a likelihood; the sum over all arrangements of one ratio gives the
probability of that ratio, all ratios being equally likely beforehand. An impact speed that varied in training is
averaged over; a damping that varied adds to the covariance of x.

Two neighbours that swap their materials give nearly the same record: the bending wave with a hill on one place and a
valley on the next has over 10 kHz, and the spectrum of a stone's force ends at about 4 kHz. Arrangements with nearly
the same record mostly have the same ratio, though. To seek all ten forces instead is an ill-posed problem (Hansen,
Discrete Inverse Problems, 2010).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from itertools import product
from math import comb

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from recognition.estimation.arrays import Floats, Integers

MOST_STONES = 12  # 4096 arrangements
#: Number of speeds examined, and how far beyond those of training, in shares of them, to see whether a record belongs
#: there.
SPEEDS, BEYOND = 31, 0.5
#: Share of the probability left out of the interval on either side.
TAIL = 0.05
MISFIT = "misfit of the plate's model"
#: Names of the distances of a record from the training, in the order of `distances`.
DISTANCES = (MISFIT, "another impact speed explains it better", "stones that scatter too little")
#: Log likelihood ratio of a speed outside the training that counts as a distance of 1: twenty times as likely.
REFERENCE_LOG_RATIO = 3.0
#: Digits in a model file: more than a sensor has, and a third of the size.
SHORT = {"digits": 7}


@dataclass(frozen=True)
class ArrangementEstimate:
    """Of one record. probability (stones + 1,): of 0, 1, 2 ... stones of gangue; misfit: least chi-square over the
    number of samples; log_likelihood_ratio: of the best speed anywhere against the best within the training."""

    probability: Floats
    misfit: float
    log_likelihood_ratio: float

    @property
    def ratio(self) -> float:
        """Mean over the probability."""
        return float(self.probability @ np.linspace(0, 1, self.probability.size))

    @property
    def median(self) -> float:
        """Median over the probability: no other answer has a smaller mean absolute error."""
        return float(np.searchsorted(np.cumsum(self.probability), 0.5)) / (self.probability.size - 1)

    @property
    def interval(self) -> tuple[float, float]:
        """Ratios between which at least 90 % of the probability lies."""
        below = np.cumsum(self.probability)
        low, high = np.searchsorted(below, [TAIL + 1e-12, 1 - TAIL - 1e-12])
        return low / (self.probability.size - 1), min(high, self.probability.size - 1) / (self.probability.size - 1)


@lru_cache(maxsize=4)
def arrangements(stones: int) -> tuple[Floats, Integers, Floats]:
    """Every arrangement: a 1 and which stones are gangue (2^stones, 1 + stones), how many are (2^stones,), and the
    prior probability (2^stones,), which is even over the ratios."""
    which = np.array(list(product((0.0, 1.0), repeat=stones)))
    count = which.sum(axis=1).astype(int)
    prior = 1 / np.array([comb(stones, k) for k in count])
    return np.column_stack([np.ones(len(which)), which]), count, prior / prior.sum()


@dataclass(frozen=True)
class ArrangementModel:
    """Mean and covariance of records by arrangement; d = channels x samples, p powers of the speed.

    scale (channels,): rms of the signals, in shares of which x is; residual (channels,): rms of what the plate's model
    leaves of x; covariance (d, d): of x, from stone to stone, at the speed middle_m_s; mean (p, d, 1 + stones): record
    of coal alone, and what each stone of gangue adds to it, as coefficients of (v - middle)^k v / middle; low_m_s,
    high_m_s: speeds of training. ValueError for arrays that do not fit together.
    """

    scale: Floats = field(metadata=SHORT)
    residual: Floats = field(metadata=SHORT)
    covariance: Floats = field(metadata=SHORT)
    mean: Floats = field(metadata=SHORT)
    middle_m_s: float
    low_m_s: float
    high_m_s: float

    def __post_init__(self) -> None:
        if not (self.mean.ndim == 3 and self.covariance.ndim == 2 and self.scale.shape == self.residual.shape != (0,)
                and 1 <= self.stones <= MOST_STONES
                and self.mean.shape[1] == self.covariance.shape[0] == self.samples * self.scale.size):
            raise ValueError("the arrays of the arrangements do not fit together")

    @property
    def stones(self) -> int:
        return self.mean.shape[2] - 1

    @property
    def samples(self) -> int:
        return self.mean.shape[1] // len(self.scale)

    def mean_at(self, speed_m_s: float) -> Floats:
        """Record of coal alone, and what each stone of gangue adds, shape (d, 1 + stones)."""
        return np.tensordot(self._powers(np.array([speed_m_s]))[0], self.mean, 1)

    def _speeds_m_s(self) -> Floats:
        speeds = np.linspace(self.low_m_s * (1 - BEYOND), self.high_m_s * (1 + BEYOND), SPEEDS)
        return np.union1d(speeds, [self.low_m_s, self.high_m_s])

    def _powers(self, speeds_m_s: Floats) -> Floats:
        """Factor of each coefficient of the mean, shape (speeds, p)."""
        v = speeds_m_s[:, None]
        return v / self.middle_m_s * (v - self.middle_m_s) ** np.arange(len(self.mean))

    def estimate(self, signals: Floats, noise: Floats, speed_m_s: float | None = None) -> ArrangementEstimate:
        """Of one record: signals (channels, samples), standard deviation of each sensor's noise (channels,), and the
        impact speed where it is known."""
        if speed_m_s is None:
            speeds = self._speeds_m_s()
            inside = (speeds >= self.low_m_s - 1e-9) & (speeds <= self.high_m_s + 1e-9)
        else:
            speeds, inside = np.array([speed_m_s]), np.array([True])
        chi_square = self._chi_square(signals, noise, speeds)
        best = chi_square[inside].min()
        # Tempering: where even the best arrangement fits worse than the covariance allows, all are held to be less
        # certain.
        temperature = max(1.0, float(best) / len(self.covariance))
        _, count, prior = arrangements(self.stones)
        weight = np.exp((best - chi_square[inside]) / (2 * temperature)) * prior
        probability = np.bincount(count, weight.sum(axis=0)) / weight.sum()
        log_ratio = (best - chi_square.min()) / (2 * temperature)
        return ArrangementEstimate(probability, float(best) / len(self.covariance), float(log_ratio))

    def _chi_square(self, signals: Floats, noise: Floats, speeds_m_s: Floats) -> Floats:
        """Of every arrangement at every speed, shape (speeds, 2^stones)."""
        x = (signals / self.scale[:, None]).ravel()
        variance = np.repeat(self.residual**2 + (noise / self.scale) ** 2, self.samples)
        powers, d, columns = self.mean.shape
        known = np.column_stack([x, self.mean.transpose(1, 0, 2).reshape(d, -1)])
        factor = cho_factor(self.covariance + np.diag(variance), lower=True, check_finite=False)
        inner = known.T @ cho_solve(factor, known, check_finite=False)
        # The mean at a speed is a sum over powers; so are its products with itself and with x.
        law = self._powers(speeds_m_s)
        blocks = inner[1:, 1:].reshape(powers, columns, powers, columns)
        squares = np.einsum("vp,vq,piqj->vij", law, law, blocks, optimize=True)
        sums = law @ inner[0, 1:].reshape(powers, columns)
        which = arrangements(columns - 1)[0]
        pairs = (which[:, :, None] * which[:, None, :]).reshape(len(which), -1)
        return np.asarray(squares.reshape(len(law), -1) @ pairs.T - 2 * sums @ which.T + inner[0, 0])


def distances(found: ArrangementEstimate, reference: Floats) -> Floats:
    """Distances of a record from the training, shape (3,) as in DISTANCES, 1 being as expected.

    reference (3,): quadratic in the ratio of the logarithm of the misfit of held-out records; coal scatters more than
    gangue.
    """
    return np.array([found.misfit, found.log_likelihood_ratio / REFERENCE_LOG_RATIO,
                     np.exp(np.polyval(reference, found.ratio)) / found.misfit])
