"""Sensors against each other: a plate that rings freely shows each mode at every sensor in the ratio of its shape.

So gains and swapped sensors show without any knowledge of what struck the plate, where or how often. A gain that all
sensors have in common does not show.
"""

from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.plate.plate_model import PlateModel

LEAST_DAMPING = 1e-5
PRIOR_GAIN = 0.3  # standard deviation of the logarithm of a gain
ROUNDS = 8
FEW = 4  # sensors: all their orders are tried; of more, all swaps of two
LEAST_ERROR = 0.005
RIDGE = 1e-6  # of the mean diagonal: modes that nothing shows stay still


@dataclass(frozen=True)
class Ringing:
    """What a stretch of free motion says. misfit: rms of what no motion of the modes explains, in shares of the record;
    expected: what it should be by noise and by the plate's own standard deviations; gain (s,), against their
    median; gain_sd (s,); order: which sensor each channel is, by the best order; order_misfit: its misfit."""

    misfit: float
    expected: float
    gain: Floats
    gain_sd: Floats
    order: tuple[int, ...]
    order_misfit: float


def ringing_of(signals: Floats, rate_Hz: float, plate: PlateModel, noise: Floats) -> Ringing:
    """Of signals (s, n) during which nothing strikes the plate; noise (s,): standard deviation of each channel's."""
    motion = _motion(plate, signals.shape[1], rate_Hz)
    total = float(np.sum(signals**2))
    expected = _expected(signals, plate, motion, rate_Hz, noise)
    misfits = {order: _left(signals, plate.sensor_shape[list(order)], motion)[0] / total
               for order in _orders(len(signals))}
    order = min(misfits, key=lambda key: misfits[key])
    gain, left, sd = _gains(signals, plate.sensor_shape, motion)
    return Ringing(float(np.sqrt(left / total)), expected, gain, sd, order, float(np.sqrt(misfits[order])))


def _orders(sensors: int) -> list[tuple[int, ...]]:
    own = tuple(range(sensors))
    if sensors <= FEW:
        return list(permutations(own))
    swaps = ({i: j, j: i} for i, j in combinations(own, 2))
    return [own, *(tuple(swap.get(k, k) for k in own) for swap in swaps)]


def _motion(plate: PlateModel, n: int, rate_Hz: float) -> Floats:
    """(m, 2, n): decaying cosine and sine of each mode that bends the plate, others are left at zero."""
    decay = 2 * np.pi * plate.frequency_Hz * np.maximum(plate.damping_ratio, LEAST_DAMPING)
    t_s = np.arange(n) / rate_Hz
    turn = np.exp((-decay + 2j * np.pi * plate.frequency_Hz * np.sqrt(1 - plate.damping_ratio**2))[:, None] * t_s)
    moves = (plate.frequency_Hz > 0) & (plate.frequency_Hz < rate_Hz / 2)
    return np.stack([turn.real, turn.imag], axis=1) * moves[:, None, None]


def _design(shape: Floats, motion: Floats) -> Floats:
    """(s n, 2 m)."""
    return np.einsum("im,mcn->inmc", shape, motion).reshape(shape.shape[0] * motion.shape[2], -1)


def _left(signals: Floats, shape: Floats, motion: Floats) -> tuple[float, Floats]:
    """Sum of squares of what the best motion leaves, and that motion (s, n)."""
    design, values = _design(shape, motion), signals.ravel()
    fitted = design @ _amplitude(design, values)
    return float(np.sum((values - fitted) ** 2)), fitted.reshape(signals.shape)


def _amplitude(design: Floats, values: Floats) -> Floats:
    """(2 m,): of the best motion."""
    gram = design.T @ design
    ridge = RIDGE * np.trace(gram) / len(gram) * np.eye(len(gram))
    return np.asarray(np.linalg.solve(gram + ridge, design.T @ values), float)


def _gains(signals: Floats, shape: Floats, motion: Floats) -> tuple[Floats, float, Floats]:
    """Gains (s,), the sum of squares left with them, and the standard deviation of each (s,), by Gauss-Newton on what
    is left when the motion is eliminated."""
    log_gain = np.zeros(len(signals))
    for _ in range(ROUNDS):
        gain = np.exp(log_gain)[:, None]
        design = _design(gain * shape, motion)
        basis = np.linalg.qr(design)[0]
        left, fitted = _left(signals, gain * shape, motion)
        slopes = np.zeros((len(signals), signals.size))
        for i, row in enumerate(fitted):
            slopes[i].reshape(signals.shape)[i] = row
        slopes = slopes - (slopes @ basis) @ basis.T
        error = max(left, LEAST_ERROR**2 * float(np.sum(signals**2))) / signals.size
        matrix = slopes @ slopes.T / error + np.eye(len(signals)) / PRIOR_GAIN**2
        right = slopes @ (signals - fitted).ravel() / error - log_gain / PRIOR_GAIN**2
        log_gain = log_gain + np.linalg.solve(matrix, right)
        log_gain = log_gain - log_gain.mean()
    apart = np.eye(len(signals)) - 1 / len(signals)  # a gain in common changes nothing
    sd = np.sqrt(np.diag(apart @ np.linalg.inv(matrix) @ apart))
    left = _left(signals, np.exp(log_gain)[:, None] * shape, motion)[0]
    return np.exp(log_gain - np.median(log_gain)), left, sd


def _expected(signals: Floats, plate: PlateModel, motion: Floats, rate_Hz: float, noise: Floats) -> float:
    """Misfit by noise, and by the standard deviations of shapes, frequencies and damping, each mode by the energy that
    it has in the best motion."""
    design, n = _design(plate.sensor_shape, motion), signals.shape[1]
    each = design * _amplitude(design, signals.ravel())
    energy = np.sum(each.reshape(len(each), -1, 2).sum(axis=2) ** 2, axis=0)
    omega = 2 * np.pi * plate.frequency_Hz
    drift = omega**2 * (plate.frequency_sd**2 + (plate.damping_ratio * plate.damping_sd) ** 2) * (n / rate_Hz) ** 2 / 12
    share = np.sum(energy * (plate.shape_sd**2 + np.minimum(drift, 1.0))) / np.sum(energy)
    return float(np.sqrt(share + n * np.sum(noise**2) / np.sum(signals**2)))
