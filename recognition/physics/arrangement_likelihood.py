"""Likelihood of every arrangement of coal and gangue on known places.

The plate is linear, so a record x is the sum of the plate's responses to the forces of all stones,

    x = sum over stones of e^(u_i) G_i (f_0 + a_i f_1) + e.

G_i is the response to a unit force on place i (plate_fem/motion.py); u_i and a_i are normally distributed, by the law
of the stone's material (recognition.physics.force_law). e is what the law leaves of the forces, the residual of the
plate's model on simulated records, and the noise of the sensors. Ten stones have 1024 arrangements. The likelihood of
each is an integral over all u_i and a_i, found by Laplace's method (recognition.physics.near_record). The sum over all
arrangements of one ratio gives the probability of that ratio, all ratios being equally likely beforehand. An impact
speed that varied in training is summed over, as is the moment of the impact, which a trigger does not tell to some
microseconds; a damping that varied adds to the covariance of e.

Two neighbours that swap their materials give nearly the same record: the bending wave with a hill on one place and a
valley on the next has over 10 kHz, and the spectrum of a stone's force ends at about 4 kHz. Arrangements with nearly
the same record mostly have the same ratio, though. To seek all ten forces instead is an ill-posed problem (Hansen,
Discrete Inverse Problems, 2010).
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import product
from math import comb

import numpy as np
from scipy.linalg import solve_triangular
from scipy.signal import fftconvolve

from analysis.signals.resampling import low_pass
from recognition.estimation.arrays import Floats, Integers
from recognition.physics.force_law import SHORT, ForceLaw
from recognition.physics.near_record import NearRecord

MOST_STONES = 12  # 4096 arrangements
#: Number of speeds examined, and how far beyond those of training, in shares of them, to see whether a record belongs
#: there.
SPEEDS, BEYOND = 31, 0.5
#: The impact is sought so long before and after the beginning of a record, first every COARSE steps of the responses,
#: then every step about the best SOUGHT of these; the posterior is summed over FINE steps about the best.
LATEST_S, COARSE, SOUGHT = 3e-4, 6, 2
FINE = np.arange(-4, 5) / 2
SHARE = 0.9  # of the probability, in the interval
MISFIT = "misfit of the plate's model"
#: Names of the distances of a record from the training, in the order of `distances`.
DISTANCES = (MISFIT, "another impact speed explains it better")
#: Log likelihood ratio of a speed outside the training that counts as a distance of 1: twenty times as likely.
REFERENCE_LOG_RATIO = 3.0


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
def arrangements(stones: int) -> tuple[Integers, Integers, Floats]:
    """Every arrangement: which stones are gangue (2^stones, stones), how many are (2^stones,), and the prior
    probability (2^stones,), which is even over the ratios."""
    which = np.array(list(product((0, 1), repeat=stones)))
    count = which.sum(axis=1)
    prior = 1 / np.array([comb(stones, k) for k in count])
    return which, count, prior / prior.sum()


@dataclass(frozen=True)
class RecordLaw:
    """Law of records that begin at one moment; d = channels x samples. response (d, stones, k): to each form of the
    force on each place; rest, scatter (d, d): covariance of what the law leaves of the forces, and of what is not known
    of plate and places under mean forces."""

    response: Floats
    rest: Floats
    scatter: Floats


@dataclass(frozen=True)
class ArrangementModel:
    """Law of records, from the plate's response and the stones' forces.

    names: of the channels; scale (channels,): rms of the signals, in shares of which x is; residual (channels,): rms of
    what the plate's model leaves of x; step_s: of the responses; stride: steps of a sample; samples: of a record that
    are used. hat (channels, steps, stones): response of x to a force on each place that rises to 1 N over `width` steps
    and falls as long, from the impact on; law: of forces, whose bins are `width` steps each; scatter: responses
    (channels, steps, m) to what else varies, by one standard deviation each; plate_json: table `[plate]` of the scenes;
    place_m (stones, 2): where the stones fall; place_deviation_m: standard deviation along x and y of where they touch;
    damping_deviation: of the damping ratio; own_falls: records have places and arrivals of their own, which must be
    told; low_m_s, high_m_s: speeds of training; anti_alias: the record passes a low pass (analysis.signals.resampling)
    before it is sampled. ValueError for arrays that do not fit together.
    """

    names: tuple[str, ...]
    scale: Floats = field(metadata=SHORT)
    residual: Floats = field(metadata=SHORT)
    step_s: float
    stride: int
    samples: int
    hat: Floats = field(metadata=SHORT)
    width: int
    law: ForceLaw
    scatter: list[Floats]
    plate_json: str
    place_m: Floats
    place_deviation_m: float
    damping_deviation: float
    own_falls: bool
    low_m_s: float
    high_m_s: float
    anti_alias: bool = False

    def __post_init__(self) -> None:
        channels, steps = self.scale.size, (self.samples - 1) * self.stride + self.latest + 2 + self._ahead
        arrays = [self.hat, *self.scatter]
        if not (self.scale.shape == self.residual.shape == (len(self.names),) and channels and self.stride > 0
                and self.samples > 0 and self.width > 0
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
        """Law of records that begin `shift` steps after the impact. All are kept, in a dict since a model goes to other
        processes."""
        if shift not in self._kept:
            self._kept[shift] = self._law_at(shift)
        return self._kept[shift]

    def _law_at(self, shift: float) -> RecordLaw:
        hat, *scatter = self._taken
        rows = self._ahead + shift + self.stride * np.arange(self.samples, dtype=float)
        delayed = rows[:, None] - self.width * np.arange(self.law.bins)
        unit = _sampled(hat, delayed.ravel()).reshape(-1, delayed.shape[1], self.stones)
        unit = np.ascontiguousarray(unit.swapaxes(1, 2))  # (channels x samples, stones, bins)
        response, root = unit @ self.law.forms.T, np.linalg.cholesky(self.law.rest)
        rest = (unit @ root).reshape(len(unit), -1)
        every = np.concatenate([rest[:, :0], *(_sampled(one, rows).reshape(len(unit), -1) for one in scatter)], axis=1)
        return RecordLaw(response, rest @ rest.T, every @ every.T)

    def _speeds_m_s(self) -> Floats:
        speeds = np.linspace(self.low_m_s * (1 - BEYOND), self.high_m_s * (1 + BEYOND), SPEEDS)
        return np.union1d(speeds, [self.low_m_s, self.high_m_s])

    def estimate(self, signals: Floats, noise: Floats, speed_m_s: float | None = None,
                 arrival_s: float | None = None, channels: Integers | None = None) -> ArrangementEstimate:
        """Of one record: signals (m, samples), standard deviation of each sensor's noise (m,), speed and time of the
        impact, from the record's beginning, where they are known, and which channels of the model the m are."""
        rows = np.arange(len(self.scale)) if channels is None else np.asarray(channels)
        x, noise = signals / self.scale[rows, None], noise / self.scale[rows]
        speeds = self._speeds_m_s() if speed_m_s is None else np.array([speed_m_s])
        inside = (speeds >= self.low_m_s - 1e-9) & (speeds <= self.high_m_s + 1e-9) | (speed_m_s is not None)
        shifts = np.array([0.0 if arrival_s is None else -arrival_s / self.step_s])
        if arrival_s is None:
            shifts = self._arrivals(lambda shift: self._cost_of_any(x, noise, rows, shift))
        which, count, prior = arrangements(self.stones)
        near = [self._near(x, noise, rows, shift) for shift in shifts.tolist()]
        means, covariance = np.stack([self.law.mean_at(speed) for speed in speeds.tolist()]), self.law.covariance
        chi_square, volume = map(np.array, zip(*(one.integrals(means, covariance, which) for one in near), strict=True))
        likely = chi_square[:, inside]
        costs = likely + volume[:, inside] + np.array([one.log_determinant for one in near])[:, None, None]
        best = int(np.argmin(costs.min(axis=(1, 2))))
        nearest, anywhere = float(likely[best].min()), float(chi_square[best].min())
        # Tempering: where even the best arrangement fits worse than the covariance allows, all are held to be less
        # certain.
        temperature = max(1.0, nearest / x.size)
        weight = np.exp((costs.min() - costs) / (2 * temperature)) * prior
        probability = np.bincount(count, weight.sum(axis=(0, 1))) / weight.sum()
        share = float(np.mean(noise**2 / (self.residual[rows] ** 2 + noise**2)))
        return ArrangementEstimate(probability, nearest / x.size, share, (nearest - anywhere) / (2 * temperature),
                                   -float(shifts[best]) * self.step_s)

    def _arrivals(self, least: Callable[[float], float]) -> Floats:
        """Shifts about the most probable one, which is sought in wide steps, then in narrower ones about the best."""
        latest = float(self.latest)
        coarse = sorted(np.arange(-latest, latest + 1, COARSE).tolist(), key=least)[:SOUGHT]
        near = {shift + k for shift in coarse for k in range(-COARSE // 2, COARSE // 2 + 1) if abs(shift + k) <= latest}
        best = min(near, key=least)
        return np.clip(best + FINE, -latest, latest)

    def _chosen(self, noise: Floats, rows: Integers, shift: float, power: float) -> tuple[Floats, Floats]:
        """Responses (d, stones, k) in the channels of a record, and covariance (d, d) of e under forces of so many
        times the power of mean forces."""
        law = self.law_at(shift)
        chosen = (rows[:, None] * self.samples + np.arange(self.samples)).ravel()
        variance = np.repeat(self.residual[rows] ** 2 + noise**2, self.samples)
        return law.response[chosen], (law.rest + power * law.scatter)[np.ix_(chosen, chosen)] + np.diag(variance)

    def _near(self, x: Floats, noise: Floats, rows: Integers, shift: float) -> NearRecord:
        """With the scatter under mean forces, and then under those that explain the record best."""
        middle, power = self.law.of_any[0][0], 1.0
        for _ in range(2 if self.scatter else 1):
            response, covariance = self._chosen(noise, rows, shift, power)
            white, log_determinant = _white(np.column_stack([x.ravel(), response.reshape(x.size, -1)]), covariance)
            near = NearRecord.of(white[:, 0], white[:, 1:].reshape(response.shape), self.law, log_determinant)
            power = float(np.mean(np.exp(2 * near.numbers[:, 0])) / middle**2)
        return near

    def _cost_of_any(self, x: Floats, noise: Floats, rows: Integers, shift: float) -> float:
        """Minus twice the logarithm of the likelihood where nobody asks which stones are gangue."""
        response, covariance = self._chosen(noise, rows, shift, 1.0)
        mean, of_weights = self.law.of_any
        scattered = (response @ np.linalg.cholesky(of_weights)).reshape(x.size, -1)
        off = x.ravel() - (response @ mean).sum(axis=1)
        white, log_determinant = _white(off, covariance + scattered @ scattered.T)
        return float(white @ white) + log_determinant


def _white(known: Floats, covariance: Floats) -> tuple[Floats, float]:
    """What is known (d, ...) in units of a covariance (d, d), and the logarithm of its determinant."""
    root = np.linalg.cholesky(covariance)
    white = solve_triangular(root, known, lower=True, check_finite=False)
    return white, 2 * float(np.log(np.diag(root)).sum())


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
