"""Laplace transforms of records: Fourier transforms under a decaying exponential.

At s = alpha + i omega a decaying window exp(-alpha t) is exact for both a record and its model, so that a record may
end before the plate is still. A large alpha broadens every resonance, which lets a fit find frequencies that begin far
off; a small one gives the finest resolution.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.tapping.taps import Tap

BINS_PER_WIDTH = 2.0  # bins kept for the width alpha / pi of the window
BAND = 0.05  # half width of the band over which power is averaged, as a share of the frequency
LEAST_BAND_BINS = 8


@dataclass(frozen=True)
class Spectra:
    """s (n,): points of the Laplace plane, 1/s; acceleration (s, n), force (n,) or None: transforms of a tap, whose
    onset is the origin of time; independent: share of the bins that are independent of each other in noise."""

    s: np.ndarray
    acceleration: np.ndarray
    force: np.ndarray | None
    independent: float


def spectra(tap: Tap, alpha: float, highest_Hz: float, lead_s: float) -> Spectra:
    """Transforms of a tap from lead_s before its onset on, up to highest_Hz."""
    start = max(0, tap.onset - round(lead_s * tap.rate_Hz))
    t_s = (np.arange(tap.acceleration.shape[1]) - tap.onset)[start:] / tap.rate_Hz
    duration_s = t_s.size / tap.rate_Hz
    step = max(1, int(alpha * duration_s / np.pi / BINS_PER_WIDTH))
    bins = np.arange(1, int(highest_Hz * duration_s) + 1, step)
    s = alpha + 2j * np.pi * bins / duration_s
    shift = np.exp(-1j * s.imag * t_s[0]) / tap.rate_Hz

    def transform(values: Floats) -> np.ndarray:
        return np.asarray(np.fft.rfft(values[..., start:] * np.exp(-alpha * t_s))[..., bins] * shift)

    lags = np.arange(-1000, 1001) * step
    correlation = 1 / (1 + (np.pi * lags / (alpha * duration_s)) ** 2)  # squared, of two bins so far apart
    force = None if tap.force_N is None else transform(tap.force_N)
    return Spectra(s, transform(tap.acceleration), force, 1 / float(correlation.sum()))


def noise_power(tap: Tap, alpha: float, lead_s: float) -> Floats:
    """(s,): expected |transform|^2 of the sensors' noise under the window."""
    start = max(0, tap.onset - round(lead_s * tap.rate_Hz))
    t_s = (np.arange(tap.acceleration.shape[1]) - tap.onset)[start:] / tap.rate_Hz
    return np.asarray(tap.noise**2 * np.sum(np.exp(-2 * alpha * t_s)) / tap.rate_Hz**2, float)


def band_power(values: np.ndarray, frequency_Hz: Floats) -> Floats:
    """Mean of |values|^2 (..., n) over a band about each frequency (n,)."""
    low = np.searchsorted(frequency_Hz, (1 - BAND) * frequency_Hz)
    high = np.searchsorted(frequency_Hz, (1 + BAND) * frequency_Hz)
    middle = np.arange(frequency_Hz.size)
    low = np.maximum(np.minimum(low, middle - LEAST_BAND_BINS // 2), 0)
    high = np.minimum(np.maximum(high, middle + LEAST_BAND_BINS // 2), frequency_Hz.size)
    total = np.concatenate([np.zeros((*values.shape[:-1], 1)), np.cumsum(abs(values) ** 2, axis=-1)], axis=-1)
    return np.asarray((total[..., high] - total[..., low]) / (high - low), float)
