"""Mean and covariance of the record of a volley, and its likelihood.

A record is x = sum_i J_i r(place_i, delay_i) + e, with impulses J of the stones and responses r = sum_k phi_k(place)
a_k. Places and delays of stones are independent draws, so that only the total impulse T = sum J_i and the sum of
squares Q = sum J_i^2 count, whatever the stones are:

    mean = T E[r],    covariance = Q (E[r r'] - E[r] E[r]') + T^2 C

with the expectations over places and delays. C is what all stones have in common: what the taps left unknown of the
plate, and a factor by which all impulses differ. To this comes the noise of the sensors. The effective number of stones
is N = T^2/Q, their number where all are alike.

Only frequencies below the Nyquist frequency of every third sample count: there the plate is known best, few modes
suffice, and stones that arrive within 0.1 ms are nearly one push.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Self

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.special import logsumexp

from recognition.estimation.arrays import Floats
from recognition.innovations.signatures import FINE_S, low_passed, modal_motion
from recognition.plate.plate_model import PlateModel
from recognition.stone_forces.forces import StoneForces

RATE_Hz = 20_000.0  # of the record
DECIMATION = 3
HIGHEST_Hz = 6000.0  # of the modes; those above the pass band are felt while a stone pushes
BEFORE_S, LENGTH_S = 4e-3, 0.1  # of the part, before and after the arrival
MARGIN = 20  # samples of the part beside it, for the filter
SPREAD_S, DELAY_STEP_S = 1e-4, 25e-6  # of a volley; of arrivals and delays
FREQUENCY_STEP, DAMPING_STEP = 1e-5, 1e-3  # relative, of the slopes
#: How far from the plate's centre stones fall, as shares of its half sides: all are tried, as nobody knows.
REACHES = (0.4, 0.6, 0.8, 1.0)
SPREADS_S = (DELAY_STEP_S, SPREAD_S)  # within which stones arrive: the least that is told apart, and the most
COMMON_SD, OWN_SD = 0.02, 0.02  # relative, of the impulses of all stones together and of each alone
PHASES = 2  # of an arrival within a sample
PLACES = 41  # along a side, over which shapes are averaged
PATCHES = 3.0  # parts of a plate over which the error of a shape is independent
LOST = 1e-4  # of the largest direction: smaller ones of the basis are left out
TOTAL_STEP, NUMBER_STEP = 0.05, 0.2  # of the nodes, relative
GAIN_LEAST = 1e-12


@dataclass(frozen=True)
class Stones:
    """What is told of a volley: the fewest and the most stones, their radius, and the lowest and highest speed. All
    have one radius and speed, their places are anywhere on the plate, and all of them arrive within SPREAD_S."""

    counts: tuple[int, int]
    radius_m: float
    speeds_m_s: tuple[float, float]


@dataclass(frozen=True)
class Responses:
    """Accelerations of the modes under a unit modal impulse of a stone's form: delayed (delays, m, n) by multiples of
    DELAY_STEP_S; their slopes by_frequency and by_damping (m, n), by the logarithm of either."""

    delayed: Floats
    by_frequency: Floats
    by_damping: Floats

    @classmethod
    def of(cls, plate: PlateModel, stones: Stones, forces: StoneForces, delays: int) -> Self:
        """Of a plate with no modes above HIGHEST_Hz."""
        f, zeta = plate.frequency_Hz, plate.damping_ratio
        fine = round((BEFORE_S + LENGTH_S + MARGIN * DECIMATION / RATE_Hz) / FINE_S)
        sizes = np.array(stones.radius_m), np.array(np.mean(stones.speeds_m_s))
        duration_s = float(np.exp(np.mean([forces.mean(material, *sizes)[0] for material in (0, 1)])))
        t_s: Floats = (np.arange(fine, dtype=float) + 0.5) * FINE_S - BEFORE_S
        pulse = forces.pulse(0, duration_s, t_s)
        push = np.tile(-pulse / (pulse.sum() * FINE_S), (len(f), 1))
        at_once, higher, more = (modal_motion(*modes, push, FINE_S) for modes in
                                 ((f, zeta), (f * (1 + FREQUENCY_STEP), zeta), (f, zeta * (1 + DAMPING_STEP))))
        delayed = np.array([_sampled(at_once, k) for k in range(delays)])
        return cls(delayed, _sampled((higher - at_once) / FREQUENCY_STEP, delays // 2),
                   _sampled((more - at_once) / DAMPING_STEP, delays // 2))


def _sampled(fine: Floats, delay: int) -> Floats:
    """(m, n): motions (m, fine steps), later by `delay` steps of DELAY_STEP_S, as the record is sampled and used."""
    later = round(delay * DELAY_STEP_S / FINE_S)
    shifted = np.pad(fine, ((0, 0), (later, 0)))[:, :fine.shape[1]]
    sampled = low_passed(low_passed(shifted, round(1 / (FINE_S * RATE_Hz))), DECIMATION)
    return sampled[:, :round((BEFORE_S + LENGTH_S) * RATE_Hz / DECIMATION)]


def part_of(values: Floats, start: int, samples: int) -> Floats:
    """`samples` decimated samples of a record (c, t) from its sample `start` on."""
    wide = values[:, start - MARGIN * DECIMATION:start + (samples + MARGIN) * DECIMATION]
    return low_passed(wide, DECIMATION)[:, MARGIN:MARGIN + samples]


@dataclass(frozen=True)
class Moments:
    """Of channels that are divided by their noise.

    basis (r, c, n): orthonormal, of all that stones can make of them. In it, for each of REACHES, then of SPREADS_S,
    and then of the phases, response (h, r): E[r]; own and common (h, r, r): what Q and T^2 multiply.
    """

    basis: Floats
    response: Floats
    own: Floats
    common: Floats

    @classmethod
    def of(cls, plate: PlateModel, sensors: tuple[int, ...], stones: Stones, forces: StoneForces,
           noise: Floats) -> Self:
        plate = plate.below(HIGHEST_Hz)
        widths = [round(spread_s / DELAY_STEP_S) + 1 for spread_s in SPREADS_S]
        a = Responses.of(plate, stones, forces, max(widths) + PHASES - 1)
        seen = plate.sensor_shape[list(sensors)] / noise[:, None]

        def observed(motion: Floats) -> Floats:  # (m, n) -> (m, c n)
            return (seen.T[:, :, None] * motion[:, None, :]).reshape(len(motion), -1)

        delayed = [observed(motion) for motion in a.delayed]
        slopes = [observed(motion) * sd[:, None] for motion, sd in
                  ((a.by_frequency, plate.frequency_sd), (a.by_damping, plate.damping_sd))]
        basis = _basis(np.vstack([*delayed, *slopes]))
        error = plate.shape_sd * plate.rms_shape
        middle = a.delayed[len(delayed) // 2]
        at_sensors = [_alone(middle, c, noise) * error[:, None] for c in range(len(noise))]
        doubt = np.array([rows @ basis.T for rows in [*slopes, *at_sensors]])
        at_places = (delayed[len(delayed) // 2] * error[:, None]) @ basis.T
        projected = np.array([rows @ basis.T for rows in delayed])
        places = [_over_places(plate, stones.radius_m, reach) for reach in REACHES]
        found = [_moments(projected[p:p + width], over, doubt, at_places)
                 for over in places for width in widths for p in range(PHASES)]
        return cls(basis.reshape(len(basis), len(noise), -1), *(np.array(part) for part in zip(*found, strict=True)))

    def mean(self, case: int, total: float) -> Floats:
        """(r,): of stones with a total impulse."""
        return np.asarray(total * self.response[case])

    def covariance(self, case: int, total: float, squares: float) -> Floats:
        """(r, r): of stones with a total impulse and a sum of its squares, without noise."""
        return np.asarray(squares * self.own[case] + total**2 * self.common[case])


def _moments(delayed: Floats, places: tuple[Floats, Floats], doubt: Floats,
             at_places: Floats) -> tuple[Floats, Floats, Floats]:
    """E[r] (r,), own and common (r, r) of stones whose delays are those of `delayed` (delays, m, r)."""
    shape, square = places
    weight = np.where(np.isin(np.arange(len(delayed)), (0, len(delayed) - 1)), 0.5, 1.0) / (len(delayed) - 1)
    response = np.einsum("d,dmr,m->r", weight, delayed, shape, optimize=True)
    power = np.einsum("d,dmr,mn,dns->rs", weight, delayed, square, delayed, optimize=True)
    own = (1 + OWN_SD**2) * power - np.outer(response, response)
    own += _weighted(doubt, square.diagonal() - shape**2)
    common = COMMON_SD**2 * np.outer(response, response) + at_places.T @ at_places / PATCHES
    return response, own, common + _weighted(doubt, shape**2)


def _weighted(doubt: Floats, weight: Floats) -> Floats:
    """(r, r): covariance of rows (kind, m, r) whose variances are weights (m,)."""
    rows = (doubt * np.sqrt(np.maximum(weight, 0.0))[:, None]).reshape(-1, doubt.shape[-1])
    return np.asarray(rows.T @ rows)


def _over_places(plate: PlateModel, radius_m: float, reach: float) -> tuple[Floats, Floats]:
    """Mean (m,) and mean product (m, m) of the shapes over places, up to a share `reach` of those on the plate."""
    middles = reach * (2 * (np.arange(PLACES) + 0.5) / PLACES - 1)
    weights = [along(middles * (lines[-1] - radius_m))
               for along, lines in zip(plate.splines, (plate.lines_x_m, plate.lines_y_m), strict=True)]
    shape = np.einsum("ai,bj,ijm->abm", *weights, plate.grid_shape, optimize=True).reshape(PLACES**2, -1)
    return shape.mean(axis=0), shape.T @ shape / len(shape)


def _basis(rows: Floats) -> Floats:
    """(r, columns): orthonormal, of the space that rows span."""
    square, directions = np.linalg.eigh(rows @ rows.T)
    kept = square > LOST**2 * square[-1]
    return np.asarray((directions[:, kept] / np.sqrt(square[kept])).T @ rows)


def _alone(motion: Floats, channel: int, noise: Floats) -> Floats:
    """(m, c n): motions (m, n) of modes in one channel, as an error of their shapes at its sensor makes them."""
    out = np.zeros((len(motion), len(noise), motion.shape[-1]))
    out[:, channel] = motion / noise[channel]
    return out.reshape(len(motion), -1)


@dataclass(frozen=True)
class Likelihood:
    """log (reaches, t, k): logarithm of the likelihood at log_total (t,) and log_number (k,), summed over the arrivals;
    misfit: chi-square of the likeliest node, per number; case, start: of the moments' cases, and of the arrivals, where
    that is; gain (c,): of each channel at this node, against what the others make of the stones."""

    log_total: Floats
    log_number: Floats
    log: Floats
    misfit: float
    case: int
    start: int
    gain: Floats

    @classmethod
    def of(cls, moments: Moments, parts: Floats, totals: tuple[float, float],
           numbers: tuple[float, float]) -> Self:
        """Of parts (s, c, n) of a record, one an arrival, between two total impulses and two effective numbers."""
        log_total, log_number = _nodes(totals, TOTAL_STEP), _nodes(numbers, NUMBER_STEP)
        x = np.einsum("rcn,scn->sr", moments.basis, parts)
        shape = (len(moments.response), len(log_total), len(log_number), len(x))
        log, chi_square = np.empty(shape), np.empty(shape)
        for h, (k, number) in product(range(len(moments.response)), enumerate(np.exp(log_number).tolist())):
            log[h, :, k], chi_square[h, :, k] = _over_totals(moments, h, np.exp(log_total), number, x)
        best = np.unravel_index(int(log.argmax()), shape)
        h, t, k, s = (int(i) for i in best)
        total, squares = float(np.exp(log_total[t])), float(np.exp(2 * log_total[t] - log_number[k]))
        summed = logsumexp(log.reshape(len(REACHES), -1, *shape[1:]), axis=(1, 4))
        return cls(log_total, log_number, summed, float(chi_square[best]) / x.shape[1], h, s,
                   gains(moments, h, total, squares, parts[s]))

    def at(self, reach: int, total: Floats, squares: Floats) -> Floats:
        """(n,): logarithm of the likelihood, of the reach REACHES[reach], at totals and sums of squares (n,)."""
        return np.asarray(self._splines[reach](np.log(total), np.log(total**2 / squares), grid=False))

    @cached_property
    def _splines(self) -> list[RectBivariateSpline]:
        return [RectBivariateSpline(self.log_total, self.log_number, log, ky=min(3, len(self.log_number) - 1))
                for log in self.log]


def _over_totals(moments: Moments, case: int, total: Floats, number: float, x: Floats) -> tuple[Floats, Floats]:
    """Logarithm of the likelihood and chi-square (t, s) at totals (t,) of records (s, r), in the axes in which all of
    their covariances T^2 (own / N + common) + noise are diagonal.

    The covariance is that of the likeliest total, whatever the total, so that the mean alone tells totals from each
    other (a quasi-likelihood, Wedderburn 1974). The power of what scatters would tell them too, but it is known badly:
    with it, totals came out up to 2 % lower.
    """
    values, axes = np.linalg.eigh(moments.own[case] / number + moments.common[case])
    variance = total[:, None] ** 2 * np.maximum(values, 0.0) + 1 / DECIMATION
    square = ((x @ axes)[None] - total[:, None, None] * (moments.response[case] @ axes)) ** 2
    chi_square = np.sum(square / variance[:, None], axis=-1)
    log = -0.5 * (chi_square + np.log(variance).sum(axis=1)[:, None])
    best = log.argmax(axis=0)
    by_mean = np.sum(square / variance[best], axis=-1)
    return log.max(axis=0) - 0.5 * (by_mean - by_mean.min(axis=0)), chi_square


def _nodes(between: tuple[float, float], step: float) -> Floats:
    """Logarithms of numbers from one to the other, about a relative step apart."""
    low, high = np.log(between)
    return np.linspace(low, high, 2 + int((high - low) / step))


def gains(moments: Moments, case: int, total: float, squares: float, values: Floats) -> Floats:
    """(c,): slope of each channel of values (c, n) against what is expected of it from all other channels."""
    mean, covariance = moments.mean(case, total), moments.covariance(case, total, squares)
    found = []
    for channel, basis in enumerate(np.moveaxis(moments.basis, 1, 0)):
        others = np.delete(moments.basis, channel, axis=1).reshape(len(mean), -1)
        measured = DECIMATION * others @ np.delete(values, channel, axis=0).ravel()
        seen = DECIMATION * others @ others.T
        stones = mean + covariance @ np.linalg.solve(np.eye(len(mean)) + seen @ covariance, measured - seen @ mean)
        expected = stones @ basis
        found.append(values[channel] @ expected / max(float(expected @ expected), GAIN_LEAST))
    return np.array(found)
