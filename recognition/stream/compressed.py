"""Signatures of stones that arrive almost at once, in the few directions in which they differ.

All signatures of a volley, whatever its places, times and forms, lie nearly in a space of some 190 dimensions, since
the plate has so many modes. Data and signatures are projected on it. Its axes are turned so that the plate model's own
error, which is that of its modes' shapes and phases, is independent from axis to axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.plate.plate_model import PlateModel
from recognition.stream.bank import HIGHEST_SHARE, LAGS, PARAMETERS, Bank, below, whitened
from recognition.stream.prior import StonePrior
from recognition.stream.signatures import DURATIONS_S, FINE_S, LEAD, Channels, Floats32, low_passed, modal_motion
from recognition.stream.whitening import Whitening

SPREAD = 6  # samples within which the forces of a volley have their centres
LOST = 3e-5  # of the energy of signatures, that the axes leave out
GRID_M, GRID_PHASES = 0.025, 6  # of the places and fine times at which stones are tried
DRAWN = 1500  # signatures from which the axes are found
BEYOND = 0.1  # of log duration, that the table reaches beyond what is expected
PHASE_TIME_S = 2e-3  # after which an error of a frequency has become an error of the phase
ERROR_PHASES = 4  # arrivals at which the response of a mode that is wrongly known is taken
LOG_FIRST, LOG_STEP = float(np.log(DURATIONS_S[0])), float(np.log(DURATIONS_S[1] / DURATIONS_S[0]))
SAMPLES = LAGS + SPREAD  # of a window; a force at its time 0 has its centre at sample LEAD


@dataclass(frozen=True)
class Atoms:
    """signatures (a, r) of stones (a, 6)."""

    signatures: Floats32
    stones: Floats

    @cached_property
    def energy(self) -> Floats32:
        return np.einsum("ij,ij->i", self.signatures, self.signatures)


@dataclass(frozen=True)
class Compressed:
    """axes (SAMPLES c, r), orthonormal. table (duration, arrival, n, 4 r): responses of modes to unit impulses, their
    slopes by time (samples) and log duration, and those of the second form. error (r,): variance of the model's error
    for an impulse of 1 N s. energy: mean square of a signature of 1 N s."""

    bank: Bank
    axes: Floats32
    table: Floats32
    error: Floats
    energy: float
    first_duration: int

    @classmethod
    def of(cls, bank: Bank, prior: StonePrior, plate: PlateModel, channels: Channels,
           whitening: Whitening) -> Compressed:
        """plate: with the standard deviations that its taps left."""
        plate = below(plate, HIGHEST_SHARE * bank.rate_Hz)
        durations = _durations(prior)
        rows = _drawn(bank, durations)
        energy = float(np.mean(np.sum(rows**2, axis=1)))
        axes = _main_axes(rows)
        found = _model_error(plate, channels, prior, whitening, bank.rate_Hz, axes)
        error, turned = np.linalg.eigh(found)
        axes = np.ascontiguousarray(axes @ turned.astype(np.float32))
        return cls(bank, axes, _table(bank, durations, axes), np.maximum(error, 0.0), energy, durations[0])

    @cached_property
    def atoms(self) -> Atoms:
        """Stones of unit impulse and one duration on a grid of places and times."""
        axes = [np.arange(-h + GRID_M / 2, h, GRID_M) for h in self.bank.half_m]
        places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        shape = np.array([self.bank.shape_at(x, y)[0] for x, y in places], dtype=np.float32)
        k, r = len(self.table) // 2, self.axes.shape[1]
        signatures, stones = [], []
        for t in range(0, self.table.shape[1], GRID_PHASES):
            signatures.append(shape @ self.table[k, t, :, :r])
            fixed = [t / self.bank.phases, LOG_FIRST + (k + self.first_duration) * LOG_STEP]
            stones.append(np.hstack([np.tile(fixed, (len(places), 1)), places, np.zeros((len(places), 2))]))
        return Atoms(np.vstack(signatures), np.vstack(stones))

    def project(self, values: Floats) -> Floats:
        """(r,) of a window (c, SAMPLES)."""
        return np.asarray(values.T.ravel() @ self.axes, dtype=float)

    def signature(self, stone: Floats) -> Floats:
        """(7, r): signature of a stone, whose time counts from that of the window, and its derivatives."""
        time, log_duration, x_m, y_m, breaking, log_impulse = stone.tolist()
        bank, last = self.bank, self.table.shape[1] - 1
        t = min(max(round(time * bank.phases), 0), last)
        position = (log_duration - LOG_FIRST) / LOG_STEP
        k = min(max(round(position), self.first_duration), self.first_duration + len(self.table) - 1)
        (i, x_off_m), (j, y_off_m) = bank.grid_node(0, x_m), bank.grid_node(1, y_m)
        about = (bank.shapes[i, j] @ self.table[k - self.first_duration, t]).reshape(12, -1)
        at = np.array([1.0, x_off_m, y_off_m])
        of = np.array([1.0, time - t / bank.phases, (position - k) * LOG_STEP, breaking])
        weights = np.zeros((PARAMETERS + 1, 3, 4))
        weights[0] = weights[6] = at[:, None] * of
        weights[1, :, 1] = weights[2, :, 2] = weights[5, :, 3] = at
        weights[3, 1] = weights[4, 2] = of
        return np.asarray(math.exp(log_impulse) * (weights.reshape(-1, 12) @ about))


def _durations(prior: StonePrior) -> list[int]:
    logs = prior.means[:, :, 0]
    low = math.floor((logs.min() - BEYOND - LOG_FIRST) / LOG_STEP)
    high = math.ceil((logs.max() + BEYOND - LOG_FIRST) / LOG_STEP)
    return list(range(max(low, 0), min(high, len(DURATIONS_S) - 1) + 1))


def _drawn(bank: Bank, durations: list[int]) -> Floats32:
    """Signatures (DRAWN, SAMPLES c) of stones anywhere in the window; always the same."""
    rng, c = np.random.default_rng(0), bank.channels
    rows = np.zeros((DRAWN, SAMPLES * c), dtype=np.float32)
    for row in rows:
        shape = bank.shape_at(*(rng.uniform(-1, 1, 2) * bank.half_m))[0]
        k, p, first = rng.choice(durations), rng.integers(bank.phases), rng.integers(SPREAD)
        of = bank.table[0, k, p] + np.float32(rng.standard_normal()) * bank.table[1, k, p]
        row[first * c:(first + LAGS) * c] = shape @ of
    return rows


def _main_axes(rows: Floats32) -> Floats32:
    unit = rows / np.linalg.norm(rows, axis=1)[:, None]
    power, directions = np.linalg.eigh(unit.T @ unit)
    return np.ascontiguousarray(directions[:, int(np.searchsorted(np.cumsum(power), LOST * power.sum())):])


def _table(bank: Bank, durations: list[int], axes: Floats32) -> Floats32:
    c, phases, n = bank.channels, bank.phases, bank.table.shape[3]
    values = np.empty((2, len(durations), SPREAD * phases + 1, n, axes.shape[1]), dtype=np.float32)
    for first in range(SPREAD):
        part = axes[first * c:(first + LAGS) * c]
        for form in (0, 1):
            for i, k in enumerate(durations):
                values[form, i, first * phases:(first + 1) * phases + 1] = bank.table[form, k] @ part
    by_time = np.gradient(values[0], 1 / phases, axis=1)
    by_duration = np.gradient(values[0], LOG_STEP, axis=0)
    found = np.stack([values[0], by_time, by_duration, values[1]], axis=3)
    return np.ascontiguousarray(found.reshape(*found.shape[:3], -1))


def _model_error(plate: PlateModel, channels: Channels, prior: StonePrior, whitening: Whitening, rate_Hz: float,
                 axes: Floats32) -> Floats:
    """Covariance (r, r) of what the error of the model makes of a stone of 1 N s: each mode has an error of its shape
    where the stone falls, and one at each sensor; a frequency that is off counts as such an error too."""
    phase = 2 * np.pi * plate.frequency_Hz * plate.frequency_sd * PHASE_TIME_S
    relative = np.hypot(plate.shape_sd, np.minimum(phase, 1.0))
    modal = _typical_responses(plate, prior, rate_Hz)
    rms, c = plate.rms_shape, len(channels.accelerometers) + len(channels.rods)
    acceleration, _ = channels.observed(replace(plate, sensor_shape=np.ones_like(plate.sensor_shape)))
    seen = [channels.observed(plate)[0]] + [rms * acceleration * (np.arange(c) == j)[:, None] for j in range(c)]
    first = SPREAD // 2
    part, found = axes[first * c:(first + LAGS) * c], np.zeros((axes.shape[1],) * 2)
    for observed in seen:
        rows = whitened(modal, observed, whitening)[0, 0] * (relative * rms)[:, None].astype(np.float32)
        projected = (rows @ part).reshape(-1, axes.shape[1]).astype(float)
        found += projected.T @ projected / ERROR_PHASES
    return found


def _typical_responses(plate: PlateModel, prior: StonePrior, rate_Hz: float) -> Floats32:
    """(1, 1, ERROR_PHASES, n, LAGS): accelerations of the modes under a unit impulse of typical duration, half a sample
    apart."""
    factor = round(1 / (rate_Hz * FINE_S))
    t_s: Floats = (np.arange((LAGS + LEAD) * factor, dtype=float) + 0.5) * FINE_S
    out = []
    for k in range(ERROR_PHASES):
        centre_s = (LEAD + 0.5 * k) / rate_Hz
        pulse = prior.forces.pulse(0, math.exp(prior.typical[0]), t_s - centre_s)
        motion = modal_motion(plate, np.tile(pulse, (len(plate.frequency_Hz), 1)), FINE_S)
        out.append(low_passed(motion, factor)[:, :LAGS])
    return np.asarray(np.array(out)[None, None], dtype=np.float32)
