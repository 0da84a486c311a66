"""Offset and hum of the mains in a record of accelerations.

Below its first bending mode a plate hardly accelerates: there the offset and the hum stand alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recognition.estimation.arrays import Floats

MAINS_Hz = (50.0, 60.0)
HARMONICS = 5
BELOW_MODE = 0.6  # of the first bending mode: harmonics are sought up to here in a record that is not still
LEAST_PERIODS = 2.0  # of the mains, that a record or its silence must have


@dataclass(frozen=True)
class Hum:
    """offset (s,), m/s^2; mains_Hz: 50 or 60; amplitude (s,), m/s^2: root of the sum of squared harmonics; sum (s, n):
    offset and hum over the record."""

    offset: Floats
    mains_Hz: float
    amplitude: Floats
    sum: Floats


def hum_of(signals: Floats, rate_Hz: float, quiet: int, first_mode_Hz: float) -> Hum:
    """Offset and hum of signals (s, n), by least squares.

    From the first `quiet` samples with all harmonics, where these last two periods of the mains; else from the whole
    record under Hann's window, with the harmonics well below the plate's first bending mode. A record of less than two
    periods has an offset only.
    """
    n = signals.shape[1]
    still = quiet / rate_Hz >= LEAST_PERIODS / min(MAINS_Hz)
    highest_Hz = rate_Hz / 4 if still else BELOW_MODE * first_mode_Hz
    used = quiet if still else n
    weight = np.ones(used) if still else np.hanning(used)
    fits = []
    for mains in MAINS_Hz:
        long_enough = used / rate_Hz >= LEAST_PERIODS / mains * (1 - 1e-9)
        orders = [k for k in range(1, HARMONICS + 1) if k * mains < highest_Hz and long_enough]
        columns = _columns(mains, orders, n, rate_Hz)
        found = np.linalg.lstsq(columns[:used] * weight[:, None], (signals[:, :used] * weight).T, rcond=None)[0]
        left = float(np.sum(((signals[:, :used].T - columns[:used] @ found) * weight[:, None]) ** 2))
        fits.append((left, mains, columns, found))
    _, mains, columns, found = min(fits, key=lambda fit: fit[0])
    amplitude = np.sqrt(np.sum(found[1:] ** 2, axis=0))
    return Hum(found[0], mains, amplitude, (columns @ found).T)


def _columns(mains_Hz: float, orders: list[int], n: int, rate_Hz: float) -> Floats:
    phase = 2 * np.pi * mains_Hz * np.arange(n)[:, None] / rate_Hz * np.array(orders, float)
    return np.hstack([np.ones((n, 1)), np.cos(phase), np.sin(phase)])
