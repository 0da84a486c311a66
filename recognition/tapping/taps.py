"""Records of taps at known places, and their Laplace transforms: Fourier transforms under a decaying exponential.

At s = alpha + i omega a decaying window exp(-alpha t) is exact for both a record and its model, so that a record may
end before the plate is still. A large alpha broadens every resonance, which lets a fit find frequencies that begin far
off; a small one gives the finest resolution.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError

#: Where a record first exceeds so much of its largest sample, and so many standard deviations of its first samples (but
#: no more than the last share), the tap has begun.
ONSET_SHARE, ONSET_DEVIATIONS, ONSET_AT_MOST, FIRST_SAMPLES = 0.05, 6.0, 0.3, 40
SILENT = 1e-30  # no sample of a tap is as small, in any unit
LEAST_SILENCE = 30  # samples before the tap from which the sensors' noise is taken
BINS_PER_WIDTH = 1.0  # bins kept for the width alpha / pi of the window
BAND = 0.05  # half width of the band over which power is averaged, as a share of the frequency
LEAST_BAND_BINS = 8
LEAST_PERIODS = 8  # of the highest frequency, that a record has after the tap
MOST_ELEMENTS = 5e7  # of the matrices of modes at all frequencies, which take 16 bytes each


@dataclass(frozen=True)
class Tap:
    """One tap. place_m (2,); acceleration (s, t), m/s^2 upwards, of each sensor; force_N (t,), downwards, sampled at
    the same instants, None where it was not measured. The plate is at rest when the record begins.

    Raises RecognitionError for records that are empty, not finite or do not fit each other.
    """

    place_m: Floats
    acceleration: Floats
    rate_Hz: float
    force_N: Floats | None = None
    name: str = "tap"

    def __post_init__(self) -> None:
        signals = [self.acceleration] + ([] if self.force_N is None else [self.force_N])
        if not all(np.isfinite(signal).all() for signal in signals):
            raise RecognitionError(f"{self.name}: a sample is not finite")
        if self.force_N is not None and self.force_N.shape != self.acceleration.shape[1:]:
            raise RecognitionError(f"{self.name}: {self.force_N.size} samples of force; needs those of acceleration")
        if not all((abs(np.atleast_2d(signal)).max(axis=1, initial=0) > SILENT).all() for signal in signals):
            raise RecognitionError(f"{self.name}: all samples of a sensor are zero; needs a tap")

    @cached_property
    def onset(self) -> int:
        """First sample of the tap, by the force where there is one."""
        signal = abs(self.acceleration if self.force_N is None else self.force_N[None])
        largest = signal.max(axis=1, keepdims=True)
        quiet = ONSET_DEVIATIONS * np.sqrt(np.mean(signal[:, :FIRST_SAMPLES] ** 2, axis=1, keepdims=True))
        level = np.clip(quiet, ONSET_SHARE * largest, ONSET_AT_MOST * largest)
        return int((signal > level).any(axis=0).argmax())

    @cached_property
    def noise(self) -> Floats:
        """(s,): standard deviation of each sensor's noise, from before the tap; zero where that is too short to say."""
        silence = self.acceleration[:, : self.onset * 4 // 5]
        return silence.std(axis=1) if silence.shape[1] >= LEAST_SILENCE else np.zeros(len(self.acceleration))


@dataclass(frozen=True)
class Spectra:
    """s (n,): points of the Laplace plane, 1/s; acceleration (s, n), force (n,) or None: transforms of a tap, whose
    onset is the origin of time; noise (s,): expected |transform|^2 of the sensors' noise; independent: share of the
    bins that are independent of each other in noise."""

    s: np.ndarray
    acceleration: np.ndarray
    force: np.ndarray | None
    noise: Floats
    independent: float

    @cached_property
    def frequency_Hz(self) -> Floats:
        return np.asarray(self.s.imag / (2 * np.pi), float)


def samples_of(taps: Sequence[Tap], lead_s: float) -> int:
    """How many samples all taps have from lead_s before their onset on."""
    return min(tap.acceleration.shape[1] - _start(tap, lead_s) for tap in taps)


def check_taps(taps: Sequence[Tap], sensors: int, highest_Hz: float, modes: int, lead_s: float) -> None:
    """Raises RecognitionError for taps that cannot be fitted together, that do not hold the frequencies of a fit of
    `modes` modes, or are too long for it."""
    if not taps:
        raise RecognitionError("no taps; needs at least one")
    first = taps[0]
    for tap in taps:
        if tap.acceleration.shape[0] != sensors:
            raise RecognitionError(f"{tap.name}: {tap.acceleration.shape[0]} accelerometers; the plate has {sensors}")
        if not np.isclose(tap.rate_Hz, first.rate_Hz, rtol=1e-6):
            raise RecognitionError(f"{tap.name}: {tap.rate_Hz:g} Hz; needs {first.rate_Hz:g} as {first.name}")
    for tap in taps:
        after_s, most_s = samples_of([tap], lead_s) / tap.rate_Hz, MOST_ELEMENTS / modes**2 / highest_Hz
        if tap.rate_Hz < 2 * highest_Hz:
            raise RecognitionError(f"{tap.name}: {tap.rate_Hz:g} samples a second; a fit up to {highest_Hz:g} Hz needs "
                                   f"at least {2 * highest_Hz:g}")
        if after_s * highest_Hz < LEAST_PERIODS:
            raise RecognitionError(f"{tap.name}: ends {1e3 * after_s:.3g} ms after the tap; a fit up to {highest_Hz:g} "
                                   f"Hz needs at least {1e3 * LEAST_PERIODS / highest_Hz:.3g} ms")
        if after_s > most_s:
            raise RecognitionError(f"{tap.name}: lasts {after_s:.3g} s after the tap; a fit of {modes} modes up to "
                                   f"{highest_Hz:g} Hz takes at most {most_s:.3g} s, so cut it")
    for tap in taps:
        start = _start(tap, lead_s)
        if not np.ptp(tap.acceleration[:, start:start + samples_of(taps, lead_s)], axis=1).all():
            raise RecognitionError(f"{tap.name}: a sensor shows nothing after the tap")


def spectra(tap: Tap, alpha: float, highest_Hz: float, lead_s: float, samples: int) -> Spectra:
    """Transforms of a tap's `samples` from lead_s before its onset on, up to highest_Hz."""
    start = _start(tap, lead_s)
    part, t_s = slice(start, start + samples), (np.arange(start, start + samples) - tap.onset) / tap.rate_Hz
    duration_s = samples / tap.rate_Hz
    step = max(1, round(alpha * duration_s / np.pi / BINS_PER_WIDTH))
    bins = np.arange(1, int(highest_Hz * duration_s) + 1, step)
    s = alpha + 2j * np.pi * bins / duration_s
    shift = np.exp(-1j * s.imag * t_s[0]) / tap.rate_Hz

    def transform(values: Floats) -> np.ndarray:
        return np.asarray(np.fft.rfft(values[..., part] * np.exp(-alpha * t_s))[..., bins] * shift)

    lags = np.arange(-1000, 1001) * step
    correlation = 1 / (1 + (np.pi * lags / (alpha * duration_s)) ** 2)  # squared, of two bins so far apart
    force = None if tap.force_N is None else transform(tap.force_N)
    noise = np.asarray(tap.noise**2 * np.sum(np.exp(-2 * alpha * t_s)) / tap.rate_Hz**2, float)
    return Spectra(s, transform(tap.acceleration), force, noise, 1 / float(correlation.sum()))


def _start(tap: Tap, lead_s: float) -> int:
    return max(0, tap.onset - round(lead_s * tap.rate_Hz))


def band_power(values: np.ndarray, frequency_Hz: Floats) -> Floats:
    """Mean of |values|^2 (..., n) over a band about each frequency (n,)."""
    low = np.searchsorted(frequency_Hz, (1 - BAND) * frequency_Hz)
    high = np.searchsorted(frequency_Hz, (1 + BAND) * frequency_Hz)
    middle = np.arange(frequency_Hz.size)
    low = np.maximum(np.minimum(low, middle - LEAST_BAND_BINS // 2), 0)
    high = np.minimum(np.maximum(high, middle + LEAST_BAND_BINS // 2), frequency_Hz.size)
    total = np.concatenate([np.zeros((*values.shape[:-1], 1)), np.cumsum(abs(values) ** 2, axis=-1)], axis=-1)
    return np.asarray((total[..., high] - total[..., low]) / (high - low), float)
