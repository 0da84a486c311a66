"""Exact motion of modes under forces that are constant over each sample interval."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy.signal import lfilter

from recognition.estimation.arrays import Floats


class Modes(Protocol):
    """frequency_Hz, damping_ratio (m,)."""

    @property
    def frequency_Hz(self) -> Floats: ...
    @property
    def damping_ratio(self) -> Floats: ...


def modal_steps(modes: Modes, force: Floats, sample_rate_Hz: float) -> tuple[Floats, Floats, Floats]:
    """Amplitude, rate and acceleration (m, t) under modal forces (m, t), N kg^-1/2, from rest.

    Force k lasts from k to k + 1 sample intervals; results k belong to k intervals. Where the force jumps the
    acceleration is the mean of both sides.
    """
    amplitude, rate = np.empty_like(force), np.empty_like(force)
    omega = 2 * np.pi * modes.frequency_Hz
    for k, (w, zeta) in enumerate(zip(omega, modes.damping_ratio, strict=True)):
        step = _rigid if w == 0 else _ringing
        amplitude[k], rate[k] = step(force[k], w, zeta, 1 / sample_rate_Hz)
    before = np.concatenate([np.zeros((len(force), 1)), force[:, :-1]], axis=1)
    decay = 2 * (modes.damping_ratio * omega)[:, None]
    return amplitude, rate, (force + before) / 2 - decay * rate - omega[:, None] ** 2 * amplitude


def _ringing(force: Floats, omega: float, zeta: float, step_s: float) -> tuple[Floats, Floats]:
    """q'' + 2 zeta omega q' + omega^2 q = f. With p = omega (-zeta + i sqrt(1 - zeta^2)), z = q' - conj(p) q obeys
    z' = p z + f, and q = Im z / Im p."""
    pole = omega * complex(-zeta, np.sqrt(1 - zeta**2))
    turn = np.exp(pole * step_s)
    z = lfilter([0, np.expm1(pole * step_s) / pole], [1, -turn], force.astype(complex))
    amplitude = z.imag / pole.imag
    return amplitude, z.real + pole.real * amplitude


def _rigid(force: Floats, _omega: float, _zeta: float, step_s: float) -> tuple[Floats, Floats]:
    before = np.concatenate([[0.0], force[:-1]]) * step_s
    rate = np.cumsum(before)
    return np.cumsum(rate - before / 2) * step_s, rate
