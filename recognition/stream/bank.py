"""Signature of one stone in the innovations, as a function of its arrival, duration, place and impulse."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.plate.plate_model import PlateModel
from recognition.stream.forces import StoneForces
from recognition.stream.signatures import DURATIONS_S, LEAD, Channels, Floats32, modal_table
from recognition.stream.whitening import Whitening

LAGS, FIT_LAGS = 160, 56  # samples of a signature: all, and those by which a stone is fitted
HIGHEST_SHARE = 0.6  # of the sample rate: modes above it are felt no more
SHAPE_STEP_M = 2.5e-3  # of the grid of shapes; between its points they are linear
TIME, DURATION, X, Y, IMPULSE = range(5)  # of a stone's parameters: samples, log s, m, m, log N s


@dataclass(frozen=True)
class Bank:
    """table (material, duration, phase, n, LAGS c): innovations of a unit impulse on mode n, channel fastest; fitted:
    their first FIT_LAGS samples.

    shapes (nx, ny, 3, n): shapes and their slopes along x and y on a grid from -half_m (2,) on.
    """

    table: Floats32
    fitted: Floats32
    shapes: Floats32
    half_m: Floats
    rate_Hz: float
    channels: int

    @classmethod
    def of(cls, plate: PlateModel, channels: Channels, forces: StoneForces, whitening: Whitening,
           rate_Hz: float) -> Bank:
        plate = _below(plate, HIGHEST_SHARE * rate_Hz)
        acceleration, amplitude = channels.observed(plate)
        table = _whitened(modal_table(plate, forces, rate_Hz, LAGS), acceleration, whitening)
        if channels.rods:
            table += _whitened(modal_table(plate, forces, rate_Hz, LAGS, amplitude=True), amplitude, whitening)
        half = np.array([plate.lines_x_m[-1], plate.lines_y_m[-1]])
        fitted = np.ascontiguousarray(table[..., :FIT_LAGS * len(acceleration)])
        return cls(table, fitted, _shapes(plate, half), half, rate_Hz, len(acceleration))

    @property
    def phases(self) -> int:
        return self.table.shape[2] - 1

    def shape_at(self, x_m: float, y_m: float) -> Floats32:
        """(3, n): shapes at a place, and their slopes."""
        nodes, far = [], []
        for at, half, count in zip((x_m, y_m), self.half_m.tolist(), self.shapes.shape[:2], strict=True):
            nodes.append(min(max(round((at + half) / SHAPE_STEP_M), 0), count - 1))
            far.append(np.float32(at + half - nodes[-1] * SHAPE_STEP_M))
        found = self.shapes[nodes[0], nodes[1]].copy()
        found[0] += far[0] * found[1] + far[1] * found[2]
        return found

    def signature(self, material: int, stone: Floats, lags: int = FIT_LAGS) -> tuple[int, Floats]:
        """First sample, and the signature with its derivatives by the parameters (6, lags c)."""
        time, log_duration, x_m, y_m, log_impulse = stone.tolist()
        k, beta = _node((log_duration - _LOG_FIRST) / _LOG_STEP, len(DURATIONS_S))
        first = int(np.floor(time))
        p, alpha = _node((time - first) * self.phases, self.phases + 1)
        shape, columns = self.shape_at(x_m, y_m), lags * self.channels
        table = self.fitted if lags == FIT_LAGS else self.table
        at = [[shape @ table[material, k + i, p + j] for j in (0, 1)] for i in (0, 1)]  # (3, columns) each
        early, late = ((1 - beta) * at[0][j] + beta * at[1][j] for j in (0, 1))
        out = np.empty((6, columns))
        both = (1 - alpha) * early + alpha * late
        out[0], out[1 + X], out[1 + Y] = both
        out[1 + TIME] = (late[0] - early[0]) * self.phases
        slope = [at[1][j][0] - at[0][j][0] for j in (0, 1)]
        out[1 + DURATION] = ((1 - alpha) * slope[0] + alpha * slope[1]) / _LOG_STEP
        out *= np.exp(log_impulse)
        out[1 + IMPULSE] = out[0]
        return first - LEAD, out


_LOG_FIRST = float(np.log(DURATIONS_S[0]))
_LOG_STEP = float(np.log(DURATIONS_S[1] / DURATIONS_S[0]))


def _below(plate: PlateModel, limit_Hz: float) -> PlateModel:
    """The plate's modes below a frequency."""
    kept = plate.frequency_Hz < limit_Hz
    arrays = {name: getattr(plate, name)[..., kept] for name in (
        "frequency_Hz", "damping_ratio", "sensor_shape", "rod_force_N_m", "grid_shape", "frequency_sd", "damping_sd",
        "shape_sd")}
    return replace(plate, **arrays)


def _node(position: float, count: int) -> tuple[int, float]:
    """Node below a position on a grid of `count` nodes, and the share of the next; beyond the ends it stops."""
    position = min(max(position, 0.0), count - 1.0)
    k = min(int(position), count - 2)
    return k, position - k


def _whitened(modal: Floats32, observed: Floats, whitening: Whitening) -> Floats32:
    """Innovations (..., n, LAGS c) of the modes' responses (material, duration, phase, n, LAGS), downwards."""
    by_mode = -np.einsum("dcl,cn->ndl", whitening.response[:, :, :LAGS], observed)
    spectrum = np.fft.rfft(by_mode, 2 * LAGS)
    m, k, p, n, _ = modal.shape
    out = np.empty((m, k, p, n, LAGS * len(observed)), dtype=np.float32)
    for index in np.ndindex(m, k):
        full = np.fft.irfft(np.fft.rfft(modal[index], 2 * LAGS)[:, :, None] * spectrum, 2 * LAGS)[..., :LAGS]
        out[index] = full.swapaxes(-1, -2).reshape(p, n, -1)
    return out


def _shapes(plate: PlateModel, half_m: Floats) -> Floats32:
    axes = [np.arange(-h, h + SHAPE_STEP_M / 2, SHAPE_STEP_M) for h in half_m]
    along_x, along_y = plate._splines
    by_x, by_y = along_x(np.clip(axes[0], -half_m[0], half_m[0])), along_y(np.clip(axes[1], -half_m[1], half_m[1]))
    shape = np.einsum("ai,bj,ijn->abn", by_x, by_y, plate.grid_shape, optimize=True)
    slopes = np.gradient(shape, SHAPE_STEP_M, axis=(0, 1))
    return np.asarray(np.stack([shape, *slopes], axis=2), dtype=np.float32)
