"""Noise of the sensors and of the machine they sit on, learnt from the quiet beginning of a record.

The channels' noise n is coloured, and correlated between channels: a vector autoregression

    n[t] = sum_k A_k n[t - k] + e[t],    e normal with covariance S, k = 1 ... p.

Least squares on one half of the quiet give A and S; the other half chooses p, and shows whether the noise stays.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.linalg import solve_triangular
from scipy.signal import oaconvolve

from recognition.estimation.arrays import Floats

ORDERS = (0, 1, 2, 4, 8, 16, 32, 48)
LEAST_SAMPLES = 8  # for each coefficient of a channel
CHUNK = 20_000  # samples at once: their lags need memory


@dataclass(frozen=True)
class SensorNoise:
    """filter (p + 1, c, c): its sum over k with n[t - k] is white with unit covariance, in 1/unit of a channel.

    change: variance of one half of the quiet, whitened by what the other half taught, the larger one of both.
    """

    filter: Floats
    change: float

    @classmethod
    def of(cls, quiet: Floats, floor: float = 0.0) -> Self:
        """Learnt from channels (c, samples) in which nothing falls, with white noise of variance `floor` besides.
        numpy.linalg.LinAlgError for a channel without noise."""
        c, half = len(quiet), quiet.shape[1] // 2
        orders = [p for p in ORDERS if LEAST_SAMPLES * c * (p + 1) <= half]
        parts = [_products(values, orders[-1], floor) for values in (quiet[:, :half], quiet[:, half:])]
        tried = {p: [_surprise(_regression(a, c, p), b, c, p) for a, b in (parts, parts[::-1])] for p in orders}
        best = min(orders, key=lambda p: sum(score for score, _ in tried[p]))
        return cls(_regression((parts[0][0] + parts[1][0], parts[0][1] + parts[1][1]), c, best),
                   max(variance for _, variance in tried[best]))

    def spectrum(self, f_Hz: Floats, rate_Hz: float) -> Floats:
        """(bins, c, c): real part of the one-sided cross spectra, per Hz."""
        turn = np.exp(-2j * np.pi * np.outer(f_Hz / rate_Hz, np.arange(len(self.filter))))
        inverse = np.linalg.inv(np.tensordot(turn, self.filter, 1))
        return np.asarray(2 / rate_Hz * np.real(inverse @ inverse.conj().swapaxes(1, 2)))

    def whitened(self, values: Floats) -> Floats:
        """Channels (c, samples) with noise that is white and of unit covariance."""
        taps, n = self.filter.transpose(1, 2, 0), values.shape[1]
        return np.array([oaconvolve(row, values, axes=-1)[:, :n].sum(axis=0) for row in taps])


def _products(values: Floats, order: int, floor: float) -> tuple[Floats, int]:
    """Sum over time of products (c (order + 1), c (order + 1)) of samples and the ones before, and how many."""
    c, n = values.shape
    total = floor * (n - order) * np.eye(c * (order + 1))
    for first in range(order, n, CHUNK):
        last = min(first + CHUNK, n)
        lags = np.concatenate([values[:, first - k:last - k] for k in range(order + 1)])
        total += lags @ lags.T
    return total, n - order


def _regression(part: tuple[Floats, int], c: int, order: int) -> Floats:
    """The whitening filter (order + 1, c, c)."""
    products, count = part
    past = slice(c, c * (order + 1))
    coefficients = np.linalg.solve(products[past, past], products[past, :c]).T
    left = (products[:c, :c] - coefficients @ products[past, :c]) / (count - c * order)
    rows = np.hstack([np.eye(c), -coefficients])
    white = solve_triangular(np.linalg.cholesky(left), rows, lower=True)
    return np.asarray(white.reshape(c, order + 1, c).swapaxes(0, 1))


def _surprise(white: Floats, part: tuple[Floats, int], c: int, order: int) -> tuple[float, float]:
    """Minus twice the mean log likelihood of another part, but for a constant, and the variance that is left."""
    rows = white.swapaxes(0, 1).reshape(c, -1)
    products, count = part[0][:rows.shape[1], :rows.shape[1]], part[1]
    left = float(np.einsum("ik,kl,il->", rows, products, rows)) / count
    return left - 2 * float(np.log(np.diag(white[0])).sum()), left / c
