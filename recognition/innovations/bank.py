"""Signature of one stone in the innovations, as a function of its arrival, duration, place, breaking and impulse."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

from recognition.estimation.arrays import Floats
from recognition.innovations.signatures import DURATIONS_S, LEAD, Channels, Floats32, modal_table
from recognition.innovations.whitening import Whitening
from recognition.plate.plate_model import PlateModel
from recognition.stone_forces.forces import StoneForces

LAGS, FIT_LAGS = 320, 56  # samples of a signature: until one channel alone rings no more, and those of a fit
HIGHEST_SHARE = 1.0  # of the sample rate: modes above it are felt no more
SHAPE_STEP_M = 2.5e-3  # of the grid of shapes; between its points they are linear
KEPT = 64  # signatures
TIME, DURATION, X, Y, BREAKING, IMPULSE = range(6)  # of a stone's parameters: samples, log s, m, m, 1, log N s
PARAMETERS = 6


@dataclass(frozen=True)
class Bank:
    """Innovations of unit impulses on the modes, channel fastest; the first and last phase lie outside the sample.

    responses: for accelerations, and amplitudes where rods are heard, channels (c, n) of the modes, and the modes'
    responses (form, duration, phase, n, LAGS). filter: spectrum (c, c, bins) of what makes LAGS samples of channels
    innovations. fitted (form, duration, phase, n, FIT_LAGS c): innovations.
    shapes (nx, ny, n): of the modes on a grid from -half_m (2,) on.
    """

    responses: tuple[tuple[Floats, Floats32], ...]
    filter: NDArray[np.complex128]
    fitted: Floats32
    shapes: Floats32
    half_m: Floats
    rate_Hz: float
    channels: int

    @classmethod
    def of(cls, plate: PlateModel, channels: Channels, forces: StoneForces, whitening: Whitening,
           rate_Hz: float) -> Self:
        plate = plate.below(HIGHEST_SHARE * rate_Hz)
        observed = channels.observed(plate)[:2 if channels.rods else 1]
        responses = tuple((of, modal_table(plate, forces, rate_Hz, LAGS, amplitude=k == 1))
                          for k, of in enumerate(observed))
        half = np.array([plate.lines_x_m[-1], plate.lines_y_m[-1]])
        m, k, p, n, _ = responses[0][1].shape
        fitted = np.empty((m, k, p, n, FIT_LAGS * len(observed[0])), dtype=np.float32)
        empty = cls(responses, np.zeros(0, complex), fitted, _shapes(plate, half), half, rate_Hz, len(observed[0]))
        return empty.by(whitening)

    def by(self, whitening: Whitening) -> Self:
        """The same by another filter. It takes the memory of this one, which is no more."""
        self.fitted[:] = 0
        for response in self.responses:
            _add_whitened(self.fitted, *response, whitening)
        return replace(self, filter=np.fft.rfft(whitening.response[:, :, :LAGS], 2 * LAGS))

    @property
    def phases(self) -> int:
        return self.fitted.shape[2] - 3

    def shape_at(self, x_m: float, y_m: float) -> Floats32:
        """(n,): shapes at a place."""
        (i, x_off_m), (j, y_off_m) = self._grid_node(0, x_m), self._grid_node(1, y_m)
        shape, by_x, by_y = self._shape_about(i, j)
        return np.asarray(shape + x_off_m * by_x + y_off_m * by_y)

    def _shape_about(self, i: int, j: int) -> Floats32:
        """(3, n): shapes at a node, and their slopes."""
        by_x, by_y = _slope(self.shapes[:, j], i, SHAPE_STEP_M), _slope(self.shapes[i], j, SHAPE_STEP_M)
        return np.array([self.shapes[i, j], by_x, by_y])

    def _grid_node(self, axis: int, at_m: float) -> tuple[int, float]:
        """Node of the grid of shapes that is nearest, and how far it is."""
        from_end_m = at_m + float(self.half_m[axis])
        node = min(max(round(from_end_m / SHAPE_STEP_M), 0), self.shapes.shape[axis] - 1)
        return node, from_end_m - node * SHAPE_STEP_M

    def signature(self, stone: Floats) -> tuple[int, Floats32]:
        """First sample, and the signature over FIT_LAGS with its derivatives by the parameters (7, FIT_LAGS c)."""
        return self._kept(*stone.tolist())

    @cached_property
    def _kept(self) -> Callable[..., tuple[int, Floats32]]:
        """`_signature`; the last ones are kept, since a fit to several stones asks for the same again."""
        return lru_cache(KEPT)(self._signature)

    @cached_property
    def _about(self) -> Callable[[int, int, int, int], Floats32]:
        """Rows (12, FIT_LAGS c) of (innovations, slopes by time and log duration, second form) x (shape, slopes) at a
        node; a fit stays near one, so the last are kept."""
        return lru_cache(KEPT)(self._rows_about)

    def _rows_about(self, k: int, p: int, i: int, j: int) -> Floats32:
        shape, whole = self._shape_about(i, j), self.fitted[0]
        by_time = shape @ (whole[k, p + 2] - whole[k, p]) * (self.phases / 2)
        by_duration = shape @ _slope(whole[:, p + 1], k, _LOG_STEP)
        rows = np.array([shape @ whole[k, p + 1], by_time, by_duration, shape @ self.fitted[1, k, p + 1]])
        return rows.reshape(12, -1)

    def _signature(self, time: float, log_duration: float, x_m: float, y_m: float, breaking: float,
                   log_impulse: float) -> tuple[int, Floats32]:
        first, (k, k_off), (p, p_off) = self._nodes(time, log_duration)
        (i, x_off_m), (j, y_off_m) = self._grid_node(0, x_m), self._grid_node(1, y_m)
        at, of = np.array([1.0, x_off_m, y_off_m]), np.array([1.0, p_off / self.phases, k_off * _LOG_STEP, breaking])
        weights = np.zeros((PARAMETERS + 1, 4, 3))
        weights[0] = weights[1 + IMPULSE] = of[:, None] * at
        weights[1 + TIME, 1] = weights[1 + DURATION, 2] = weights[1 + BREAKING, 3] = at
        weights[1 + X, :, 1] = weights[1 + Y, :, 2] = of
        weights *= math.exp(log_impulse)
        rows: Floats32 = weights.reshape(-1, 12).astype(np.float32) @ self._about(k, p, i, j)
        return first - LEAD, rows

    def whole(self, stone: Floats) -> tuple[int, Floats]:
        """First sample, and the signature over LAGS (c, LAGS)."""
        time, log_duration, x_m, y_m, breaking, log_impulse = stone.tolist()
        first, (k, b), (p, a) = self._nodes(time, log_duration)
        i, j = k + (1 if b > 0 else -1), p + (1 if a > 0 else -1)
        shape, seen = math.exp(log_impulse) * self.shape_at(x_m, y_m), np.zeros((self.channels, LAGS))
        for observed, modal in self.responses:
            of = (1 - abs(a) - abs(b)) * modal[0, k, p + 1] + breaking * modal[1, k, p + 1]
            for share, node in ((abs(b), (i, p + 1)), (abs(a), (k, j + 1))):
                if share > 0:
                    of += share * modal[0, node[0], node[1]]
            seen -= (observed * shape) @ of
        white = np.einsum("dck,ck->dk", self.filter, np.fft.rfft(seen, 2 * LAGS))
        return first - LEAD, np.fft.irfft(white, 2 * LAGS)[:, :LAGS]

    def _nodes(self, time: float, log_duration: float) -> tuple[int, tuple[int, float], tuple[int, float]]:
        """Whole sample, then the nearest node of durations and of phases, with how far it is in their steps."""
        first = math.floor(time)
        return (first, _nearest((log_duration - _LOG_FIRST) / _LOG_STEP, len(DURATIONS_S)),
                _nearest((time - first) * self.phases, self.phases + 1))


_LOG_FIRST = float(np.log(DURATIONS_S[0]))
_LOG_STEP = float(np.log(DURATIONS_S[1] / DURATIONS_S[0]))


def _nearest(position: float, count: int) -> tuple[int, float]:
    """Node nearest to a position on a grid of `count` nodes, and how far it is; beyond the ends it stops."""
    position = min(max(position, 0.0), count - 1.0)
    k = round(position)
    return k, position - k


def _slope(values: Floats32, k: int, step: float) -> Floats32:
    """Of values at node k of the first axis, by its neighbours."""
    low, high = max(k - 1, 0), min(k + 1, len(values) - 1)
    return np.asarray((values[high] - values[low]) / np.float32((high - low) * step))


def _add_whitened(out: Floats32, observed: Floats, modal: Floats32, whitening: Whitening) -> None:
    """Adds innovations (..., n, FIT_LAGS c) of the modes' responses (form, duration, phase, n, lags), downwards."""
    by_mode = -np.einsum("dcl,cn->ndl", whitening.response[:, :, :FIT_LAGS], observed)
    spectrum = np.fft.rfft(by_mode, 2 * FIT_LAGS)
    for index in np.ndindex(modal.shape[:2]):
        parts = np.fft.rfft(modal[index][..., :FIT_LAGS], 2 * FIT_LAGS)[:, :, None] * spectrum
        full = np.fft.irfft(parts, 2 * FIT_LAGS)[..., :FIT_LAGS]
        out[index] += full.swapaxes(-1, -2).reshape(out[index].shape)


def _shapes(plate: PlateModel, half_m: Floats) -> Floats32:
    axes = [np.arange(-h, h + SHAPE_STEP_M / 2, SHAPE_STEP_M) for h in half_m]
    along_x, along_y = plate.splines
    by_x, by_y = along_x(np.clip(axes[0], -half_m[0], half_m[0])), along_y(np.clip(axes[1], -half_m[1], half_m[1]))
    parts = (np.asarray(part, dtype=np.float32) for part in (by_x, by_y, plate.grid_shape))
    return np.asarray(np.einsum("ai,bj,ijn->abn", *parts, optimize=True))
