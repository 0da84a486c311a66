"""Noise of a running machine, in channels that are correlated: of unit rms each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

from recognition.estimation.arrays import Floats

SOURCES = 6  # independent ones, which each channel hears with other gains
OWN = 0.05  # of the power: white noise of each sensor itself
#: Generator of one source: (samples, rate_Hz, rng) gives (samples,).
Source = Callable[[int, float, np.random.Generator], Floats]


def noise(kind: str, shape: tuple[int, ...], rate_Hz: float, rng: np.random.Generator) -> Floats:
    """Channels (c, samples), each of unit rms. kind: one of KINDS."""
    channels, samples = shape
    sources = np.array([KINDS[kind](samples, rate_Hz, rng) for _ in range(SOURCES)])
    mixed = rng.standard_normal((channels, SOURCES)) @ (sources / sources.std(axis=1, keepdims=True))
    mixed /= mixed.std(axis=1, keepdims=True)
    mixed = np.sqrt(1 - OWN) * mixed + np.sqrt(OWN) * rng.standard_normal(mixed.shape)
    return np.asarray(mixed)


def pink(n: int, rate_Hz: float, rng: np.random.Generator) -> Floats:
    """Power over frequency as 1/f above 5 Hz."""
    f_Hz = np.maximum(np.fft.rfftfreq(n, 1 / rate_Hz), 5.0)
    white = rng.standard_normal((2, len(f_Hz)))
    return np.asarray(np.fft.irfft((white[0] + 1j * white[1]) / np.sqrt(f_Hz), n))


def tones(n: int, rate_Hz: float, rng: np.random.Generator) -> Floats:
    """Three sines between 80 Hz and 4 kHz."""
    return _sines(np.geomspace(80, 4000, 3) * rng.uniform(0.9, 1.1, 3), n, rate_Hz, rng)


def drifting(n: int, rate_Hz: float, rng: np.random.Generator) -> Floats:
    """Three sines whose frequencies rise and fall by 1 % within three seconds."""
    slow = np.sin(2 * np.pi * (np.arange(n) / (3 * rate_Hz) + rng.random()))
    return _sines(np.geomspace(80, 4000, 3) * rng.uniform(0.9, 1.1, 3), n, rate_Hz, rng, 0.005 * slow)


def gear(n: int, rate_Hz: float, rng: np.random.Generator) -> Floats:
    """21 harmonics of a meshing gear, those next to the 7th strongest."""
    order = np.arange(1.0, 22.0)
    return _sines(rng.uniform(150, 300) * order, n, rate_Hz, rng, None, 1 / (1.0 + abs(order - 7)))


def shaker(n: int, rate_Hz: float, rng: np.random.Generator) -> Floats:
    """Hum of bands 100 Hz wide, as resonances of a frame, over pink noise."""
    total = 0.5 * pink(n, rate_Hz, rng) / 1.0
    total /= total.std()
    for f_Hz in rng.uniform(200, 6000, 4):
        radius = np.exp(-np.pi * 100 / rate_Hz)
        band = lfilter([1.0], [1, -2 * radius * np.cos(2 * np.pi * f_Hz / rate_Hz), radius**2], rng.standard_normal(n))
        total += band / band.std()
    return np.asarray(total)


def bursts(n: int, rate_Hz: float, rng: np.random.Generator) -> Floats:
    """Pink noise whose level doubles for 50 ms, about five times a second."""
    level, size = np.ones(n), round(0.05 * rate_Hz)
    for first in np.flatnonzero(rng.random(n) < 5 / rate_Hz):
        level[first:first + size] = 2.0
    return level * pink(n, rate_Hz, rng)


def mixture(n: int, rate_Hz: float, rng: np.random.Generator) -> Floats:
    parts = [source(n, rate_Hz, rng) for source in (pink, tones, gear, shaker)]
    return np.asarray(sum(part / part.std() for part in parts))


def _sines(f_Hz: Floats, n: int, rate_Hz: float, rng: np.random.Generator, drift: Floats | None = None,
           size: Floats | None = None) -> Floats:
    phase = 2 * np.pi / rate_Hz * np.cumsum(np.ones(n) if drift is None else 1 + drift)
    size = np.ones(len(f_Hz)) if size is None else size
    return np.asarray(sum(a * np.sin(f * phase + rng.uniform(0, 2 * np.pi)) for a, f in zip(size, f_Hz, strict=True)))


KINDS: dict[str, Source] = {"pink": pink, "tones": tones, "drifting tones": drifting, "gear": gear, "shaker": shaker,
                            "bursts": bursts, "mixture": mixture}
