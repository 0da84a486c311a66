"""Likelihood of every arrangement of coal and gangue on known places.

The plate is linear, so a record x is the sum of the plate's responses to the forces of all stones,

    x = sum over stones of G_i F_i + e.

G_i is the response to a unit force on place i (plate_fem/motion.py). F_i(t), the force of stone i, is normally
distributed: its mean depends on the material, its covariance does not; both come from simulated stones and are
proportional to the impact speed. e is the residual of the plate's model on simulated records, and the noise of the
sensors. Ten stones have 1024 arrangements. Each has a likelihood; the sum over all arrangements of one ratio gives the
probability of that ratio, all ratios being equally likely beforehand. An impact speed that varied in training is
averaged over; a damping that varied adds to the covariance of x. So is the moment of the impact, which a trigger does
not tell to some microseconds.

Two neighbours that swap their materials give nearly the same record: the bending wave with a hill on one place and a
valley on the next has over 10 kHz, and the spectrum of a stone's force ends at about 4 kHz. Arrangements with nearly
the same record mostly have the same ratio, though. To seek all ten forces instead is an ill-posed problem (Hansen,
Discrete Inverse Problems, 2010).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, cached_property, lru_cache
from itertools import product
from math import comb

import numpy as np
from scipy.linalg import solve_triangular
from scipy.signal import fftconvolve

from analysis.signals.resampling import low_pass
from recognition.estimation.arrays import Floats, Integers

MOST_STONES = 12  # 4096 arrangements
#: Number of speeds examined, and how far beyond those of training, in shares of them, to see whether a record belongs
#: there.
SPEEDS, BEYOND = 31, 0.5
#: The impact is sought so long before and after the beginning of a record, first every COARSE steps of the responses,
#: then every step about the best SOUGHT of these; the posterior is summed over FINE steps about the best.
LATEST_S, COARSE, SOUGHT = 3e-4, 6, 2
FINE = np.arange(-4, 5) / 2
SMALL_M = 1e-3  # step of a finite difference by the place
SHARE = 0.9  # of the probability, in the interval
MISFIT = "misfit of the plate's model"
#: Names of the distances of a record from the training, in the order of `distances`.
DISTANCES = (MISFIT, "another impact speed explains it better")
#: Log likelihood ratio of a speed outside the training that counts as a distance of 1: twenty times as likely.
REFERENCE_LOG_RATIO = 3.0
#: Digits in a model file: more than a sensor has, and a third of the size.
SHORT = {"digits": 7}


@dataclass(frozen=True)
class ArrangementEstimate:
    """Of one record. probability (stones + 1,): of 0, 1, 2 ... stones of gangue; misfit: least chi-square over the
    number of samples; noise_share: of the sensors' noise in the variance that a sample may have beside the law;
    log_likelihood_ratio: of the best speed anywhere against the best within the training; arrival_s: the most probable
    time of the impact, from the record's beginning."""

    probability: Floats
    misfit: float
    noise_share: float
    log_likelihood_ratio: float
    arrival_s: float

    @property
    def ratio(self) -> float:
        """Mean over the probability."""
        return float(self.probability @ np.linspace(0, 1, self.probability.size))

    @property
    def interval(self) -> tuple[float, float]:
        """The nearest ratios between which at least 90 % of the probability lies, of equally near ones the most."""
        below, stones = np.concatenate([[0.0], np.cumsum(self.probability)]), self.probability.size - 1
        within = [(high - low, below[low] - below[high + 1], low, high) for low in range(stones + 1)
                  for high in range(low, stones + 1) if below[high + 1] - below[low] >= SHARE - 1e-12]
        _, _, low, high = min(within)
        return low / stones, high / stones


@lru_cache(maxsize=4)
def arrangements(stones: int) -> tuple[Floats, Integers, Floats]:
    """Every arrangement: a 1 and which stones are gangue (2^stones, 1 + stones), how many are (2^stones,), and the
    prior probability (2^stones,), which is even over the ratios."""
    which = np.array(list(product((0.0, 1.0), repeat=stones)))
    count = which.sum(axis=1).astype(int)
    prior = 1 / np.array([comb(stones, k) for k in count])
    return np.column_stack([np.ones(len(which)), which]), count, prior / prior.sum()


def hats(width: int, steps: int, count: int) -> Floats:
    """Hat functions (steps, count) of time, each of which rises over `width` steps and falls as long, `width` steps
    after the one before."""
    middle = (np.arange(count) + 1) * width
    return np.asarray(np.maximum(0.0, 1 - np.abs(np.arange(steps)[:, None] + 0.5 - middle) / width))


@lru_cache(maxsize=4)
def _pairs(stones: int) -> Floats:
    """Products of each two columns of `arrangements`, shape ((1 + stones)^2, 2^stones)."""
    which = arrangements(stones)[0]
    return np.ascontiguousarray((which[:, :, None] * which[:, None, :]).reshape(len(which), -1).T)


@dataclass(frozen=True)
class RecordLaw:
    """Mean and covariance of records that begin at one moment; d = channels x samples, p powers of the speed.

    covariance (d, d): of x, from stone to stone, at the middle speed; mean (p, d, 1 + stones): record of coal alone,
    and what each stone of gangue adds to it, as coefficients of (v - middle)^k v / middle.
    """

    mean: Floats
    covariance: Floats


@dataclass(frozen=True)
class ArrangementModel:
    """Law of records, from the plate's response and the stones' forces.

    names: of the channels; scale (channels,): rms of the signals, in shares of which x is; residual (channels,): rms of
    what the plate's model leaves of x; step_s: of the responses; stride: steps of a sample; samples: of a record that
    are used. hat (channels, steps, stones): response of x to a force on each place that rises to 1 N over `width` steps
    and falls as long, from the impact on; laws (2, p, bins): mean force of coal and of gangue, a hat a bin, each
    `width` steps after the one before; covariance (bins, bins): of a force, from stone to stone; seen: number of
    different stones that tell it; scatter: responses (channels, steps, m) to what else varies, by one standard
    deviation each; plate_json: table `[plate]` of the scenes; place_m (stones, 2): where the stones fall;
    place_deviation_m: standard deviation along x and y of where they touch; damping_deviation: of the damping ratio;
    own_falls: records have places and arrivals of their own, which must be told; low_m_s, high_m_s: speeds of training;
    anti_alias: the record passes a low pass (analysis.signals.resampling) before it is sampled. ValueError for arrays
    that do not fit together.
    """

    names: tuple[str, ...]
    scale: Floats = field(metadata=SHORT)
    residual: Floats = field(metadata=SHORT)
    step_s: float
    stride: int
    samples: int
    hat: Floats = field(metadata=SHORT)
    width: int
    laws: Floats = field(metadata=SHORT)
    covariance: Floats = field(metadata=SHORT)
    seen: int
    scatter: list[Floats]
    plate_json: str
    place_m: Floats
    place_deviation_m: float
    damping_deviation: float
    own_falls: bool
    middle_m_s: float
    low_m_s: float
    high_m_s: float
    anti_alias: bool = False

    def __post_init__(self) -> None:
        channels, steps = self.scale.size, (self.samples - 1) * self.stride + self.latest + 2 + self._ahead
        arrays = [self.hat, *self.scatter]
        if not (self.laws.ndim == 3 and len(self.laws) == 2 and self.covariance.shape == (self.laws.shape[2],) * 2
                and self.scale.shape == self.residual.shape == (len(self.names),) and channels and self.stride > 0
                and self.samples > 0 and self.width > 0 and self.seen > 0
                and all(one.ndim == 3 and one.shape[0] == channels and one.shape[1] >= steps for one in arrays)
                and 1 <= self.stones <= MOST_STONES and self.place_m.shape == (self.stones, 2)):
            raise ValueError("the arrays of the arrangements do not fit together")

    @property
    def stones(self) -> int:
        return self.hat.shape[2]

    @property
    def latest(self) -> int:
        """Steps by which a record may begin too early or too late."""
        return round(LATEST_S / self.step_s)

    @property
    def _ahead(self) -> int:
        """Steps by which the low pass has no delay: what a record takes of a response begins so much earlier."""
        return low_pass(self.stride)[1] if self.anti_alias else 0

    @cached_property
    def _taken(self) -> list[Floats]:
        """`hat` and `scatter` as a record takes them, from `_ahead` steps before the impact on."""
        every = [self.hat, *self.scatter]
        if not self.anti_alias:
            return every
        return [fftconvolve(one, low_pass(self.stride)[0][None, :, None], axes=1) for one in every]

    @cached_property
    def _kept(self) -> dict[float, RecordLaw]:
        return {}

    def law_at(self, shift: float) -> RecordLaw:
        """Law of records that begin `shift` steps after the impact."""
        if shift not in self._kept:
            self._kept[shift] = self._law_at(shift)
        return self._kept[shift]

    def _law_at(self, shift: float) -> RecordLaw:
        hat, *scatter = self._taken
        rows = self._ahead + shift + self.stride * np.arange(self.samples, dtype=float)
        delayed = rows[:, None] - self.width * np.arange(self.laws.shape[2])
        unit = _sampled(hat, delayed.ravel()).reshape(-1, delayed.shape[1], self.stones)
        unit = np.ascontiguousarray(unit.swapaxes(1, 2))  # (channels x samples, stones, bins)
        coal, gangue = (np.einsum("dib,pb->pdi", unit, law, optimize=True) for law in self.laws)
        mean = np.concatenate([coal.sum(axis=2, keepdims=True), gangue - coal], axis=2)
        root = np.linalg.cholesky(self.covariance)
        # The scatter of each place by itself; and that of the mean forces, which are known from so many stones only and
        # err alike at all places.
        parts = [(unit @ root).reshape(len(unit), -1), unit.sum(axis=1) @ root / np.sqrt(2 * self.seen)]
        parts += [_sampled(one, rows).reshape(len(unit), -1) for one in scatter]
        every = np.concatenate(parts, axis=1)
        return RecordLaw(mean, every @ every.T)

    def _speeds_m_s(self) -> Floats:
        speeds = np.linspace(self.low_m_s * (1 - BEYOND), self.high_m_s * (1 + BEYOND), SPEEDS)
        return np.union1d(speeds, [self.low_m_s, self.high_m_s])

    def _powers(self, speeds_m_s: Floats) -> Floats:
        """Factor of each coefficient of the mean, shape (speeds, p)."""
        v = speeds_m_s[:, None]
        return v / self.middle_m_s * (v - self.middle_m_s) ** np.arange(self.laws.shape[1])

    def estimate(self, signals: Floats, noise: Floats, speed_m_s: float | None = None,
                 arrival_s: float | None = None, channels: Integers | None = None) -> ArrangementEstimate:
        """Of one record: signals (m, samples), standard deviation of each sensor's noise (m,), the impact speed and the
        time of the impact, from the record's beginning, where they are known, and which channels of the model the m
        are."""
        rows = np.arange(len(self.scale)) if channels is None else np.asarray(channels)
        x, noise = signals / self.scale[rows, None], noise / self.scale[rows]
        speeds = self._speeds_m_s() if speed_m_s is None else np.array([speed_m_s])
        inside = speeds if speed_m_s is not None else speeds[(speeds >= self.low_m_s - 1e-9)
                                                             & (speeds <= self.high_m_s + 1e-9)]

        @cache
        def products(shift: float) -> tuple[Floats, float]:
            return self._products(x, noise, rows, shift)

        @cache
        def cost(shift: float) -> Floats:
            inner, log_determinant = products(shift)
            return self._chi_square(inner, inside) + log_determinant

        def least(shift: float) -> float:
            return float(cost(shift).min())

        shifts = self._arrivals(least) if arrival_s is None else np.array([-arrival_s / self.step_s])
        costs = np.stack([cost(shift) for shift in shifts.tolist()])
        best = min(shifts.tolist(), key=least)
        inner, log_determinant = products(best)
        nearest, anywhere = least(best) - log_determinant, float(self._chi_square(inner, speeds).min())
        # Tempering: where even the best arrangement fits worse than the covariance allows, all are held to be less
        # certain.
        temperature = max(1.0, nearest / x.size)
        _, count, prior = arrangements(self.stones)
        weight = np.exp((costs.min() - costs) / (2 * temperature)) * prior
        probability = np.bincount(count, weight.sum(axis=(0, 1))) / weight.sum()
        share = float(np.mean(noise**2 / (self.residual[rows] ** 2 + noise**2)))
        return ArrangementEstimate(probability, nearest / x.size, share, (nearest - anywhere) / (2 * temperature),
                                   -best * self.step_s)

    def _arrivals(self, least: Callable[[float], float]) -> Floats:
        """Shifts about the most probable one, which is sought first in wide steps, then in narrower ones about the best
        of these."""
        latest = float(self.latest)
        coarse = sorted(np.arange(-latest, latest + 1, COARSE).tolist(), key=least)[:SOUGHT]
        near = {shift + k for shift in coarse for k in range(-COARSE // 2, COARSE // 2 + 1) if abs(shift + k) <= latest}
        best = min(near, key=least)
        return np.clip(best + FINE, -latest, latest)

    def _products(self, x: Floats, noise: Floats, rows: Integers, shift: float) -> tuple[Floats, float]:
        """Products of record and mean with each other, weighted by the inverse covariance, shape (1 + p (1 + stones),)
        twice, and the logarithm of its determinant."""
        law = self.law_at(shift)
        chosen = (rows[:, None] * self.samples + np.arange(self.samples)).ravel()
        mean, covariance = law.mean[:, chosen], law.covariance[np.ix_(chosen, chosen)]
        variance = np.repeat(self.residual[rows] ** 2 + noise**2, self.samples)
        known = np.column_stack([x.ravel(), mean.transpose(1, 0, 2).reshape(len(chosen), -1)])
        root = np.linalg.cholesky(covariance + np.diag(variance))
        white = solve_triangular(root, known, lower=True, check_finite=False)
        return white.T @ white, 2 * float(np.log(np.diag(root)).sum())

    def _chi_square(self, inner: Floats, speeds_m_s: Floats) -> Floats:
        """Of every arrangement at every speed, shape (speeds, 2^stones)."""
        powers, columns = self.laws.shape[1], 1 + self.stones
        # The mean at a speed is a sum over powers; so are its products with itself and with x.
        of_speed = self._powers(speeds_m_s)
        blocks = inner[1:, 1:].reshape(powers, columns, powers, columns)
        squares = np.einsum("vp,vq,piqj->vij", of_speed, of_speed, blocks, optimize=True)
        sums = of_speed @ inner[0, 1:].reshape(powers, columns)
        chi_square = squares.reshape(len(of_speed), -1) @ _pairs(columns - 1) + inner[0, 0]
        chi_square -= 2 * sums @ arrangements(columns - 1)[0].T
        return np.asarray(chi_square)


def _sampled(response: Floats, rows: Floats) -> Floats:
    """Of a response (channels, steps, m) at real steps `rows` (n,), between which it is linear; 0 before its start.
    Shape (channels, n, m)."""
    low = np.floor(rows).astype(int)
    share = (rows - low)[:, None]
    if not share.any():
        return np.where((low >= 0)[:, None], response[:, np.maximum(low, 0)], 0.0)
    parts = [np.where((at >= 0)[:, None], response[:, np.maximum(at, 0)], 0.0) for at in (low, low + 1)]
    return np.asarray((1 - share) * parts[0] + share * parts[1])


@dataclass(frozen=True)
class ExpectedMisfit:
    """Of records like those of the training. What the model does not explain and the sensors' noise add up in the
    chi-square, so the misfit that is expected goes about linearly with the share of the noise.

    noise_share (k,), misfit (k,): of records with more and more noise, and the misfit that 90 % of them keep.
    """

    noise_share: Floats
    misfit: Floats

    def distances(self, found: ArrangementEstimate) -> Floats:
        """Of a record from the training, shape (2,) as in DISTANCES, 1 being as expected."""
        expected = float(np.interp(found.noise_share, self.noise_share, self.misfit))
        return np.array([found.misfit / expected, found.log_likelihood_ratio / REFERENCE_LOG_RATIO])
