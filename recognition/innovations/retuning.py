"""Frequencies and damping of the plate's modes, corrected by the ringing in the record itself.

Stones on random places excite all modes alike and independently, since the modes are orthogonal over the plate. The
expected spectrum of the channels is then a sum over the modes,

    S(f) = g(f) sum_j a_j(f) c_j c_j' + noise,    a_j = f^4/((f_j^2 - f^2)^2 + 4 zeta_j^2 f_j^2 f^2),

with c_j the shape of mode j at the sensors and g the smooth spectrum of the forces. Frequencies, damping ratios and g
maximise Whittle's likelihood of the record's spectrum times the prior of the plate model. Noise: coloured_noise.py.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy.optimize import minimize

from recognition.estimation.arrays import Floats
from recognition.innovations.coloured_noise import SensorNoise
from recognition.innovations.signatures import Channels
from recognition.plate.plate_model import PlateModel

HIGHEST_SHARE = 0.42  # of the sample rate: above it the low pass of the record bends the spectrum
SEGMENT_S = 1.0
FORCE_DEGREE = 6  # of log g in the frequency
DAMPING_SD = 0.05  # of log zeta, where the plate model is sure of it
SHIFTS, LEAST_SHIFT = np.linspace(-0.02, 0.02, 17), 2e-3  # of all log frequencies alike; one that is less does no harm
SHIFT_HIGHEST_Hz, LEAST_PERIODS = 3000.0, 5.0  # of the modes by which it is found; of the lowest mode in a record
BINS = 256  # of the spectrum that are worked on at once: more do not fit into a processor's cache, and take longer


@dataclass
class _Spectrum:
    """Whittle's likelihood of a spectrum (bins, c, c) averaged over `count` segments."""

    f_Hz: Floats
    spectrum: Floats
    count: float
    shape: Floats  # (c, n)
    noise: Floats  # (bins, c, c)
    smooth: Floats  # (bins, FORCE_DEGREE + 1)
    start: tuple[Floats, Floats]
    sd: tuple[Floats, Floats]

    def cost(self, x: Floats) -> tuple[float, Floats]:
        """Minus the logarithm of the posterior, and its gradient; x: deviations of log f and log zeta in their
        standard deviations, then the coefficients of log g."""
        n = self.shape.shape[1]
        u, d, level = x[:n], x[n:2 * n], x[2 * n:]
        f_j, zeta = self.start[0] * np.exp(self.sd[0] * u), self.start[1] * np.exp(self.sd[1] * d)
        value, by_f, by_zeta, by_level = 0.0, np.zeros(n), np.zeros(n), np.zeros(len(level))
        for first in range(0, len(self.f_Hz), BINS):
            part = self._of_bins(slice(first, first + BINS), f_j**2, zeta, level)
            value, by_f, by_zeta, by_level = value + part[0], by_f + part[1], by_zeta + part[2], by_level + part[3]
        gradient = np.concatenate([by_f * self.sd[0] + u, by_zeta * self.sd[1] + d, by_level])
        return value + 0.5 * float(u @ u + d @ d), gradient

    def _of_bins(self, bins: slice, b: Floats, zeta: Floats, level: Floats) -> tuple[float, Floats, Floats, Floats]:
        """Minus the log likelihood of some bins, and its slopes by log f, log zeta and log g. b: squares of f."""
        f2, spectrum, smooth = self.f_Hz[bins, None] ** 2, self.spectrum[bins], self.smooth[bins]
        apart, width = b - f2, 4 * zeta**2 * b * f2
        a = f2**2 / (apart**2 + width)
        g, pairs = np.exp(smooth @ level), self._pairs
        modes = (a @ pairs).reshape(spectrum.shape)
        model = g[:, None, None] * modes + self.noise[bins]
        inverse = np.linalg.inv(model)
        slope = self.count * (inverse - inverse @ spectrum @ inverse)  # of the cost, by the model's entries
        value = self.count * float(np.linalg.slogdet(model)[1].sum() + np.sum(inverse * spectrum.swapaxes(1, 2)))
        by_mode = (g[:, None] / f2**2 * slope.reshape(len(slope), -1)) @ pairs.T * a**2
        by_zeta = -2 * np.einsum("kj,kj->j", by_mode, width)
        by_f = by_zeta - 4 * b * np.einsum("kj,kj->j", by_mode, apart)
        return value, by_f, by_zeta, smooth.T @ (g * np.einsum("kcd,kdc->k", slope, modes))

    @cached_property
    def _pairs(self) -> Floats:
        """(n, c c): of each mode, products of its shape at two sensors."""
        return np.asarray(np.einsum("cj,dj->jcd", self.shape, self.shape).reshape(self.shape.shape[1], -1))


def retuned(plate: PlateModel, channels: Channels, values: Floats, rate_Hz: float, noise: SensorNoise) -> PlateModel:
    """The plate with the frequencies and damping ratios that a record (c, samples) of accelerometers shows.

    A mode that the record does not show keeps its values, and all keep their standard deviations.
    """
    kept = np.flatnonzero((plate.frequency_Hz > 0) & (plate.frequency_Hz < 0.5 * rate_Hz))
    problem = _problem(plate, channels, kept, values, rate_Hz, noise)
    n = len(kept)
    x = np.concatenate([np.zeros(2 * n), _first_level(problem)])
    found = minimize(problem.cost, x, jac=True, method="L-BFGS-B", options={"maxiter": 150, "maxcor": 20})
    frequency, damping = plate.frequency_Hz.copy(), plate.damping_ratio.copy()
    frequency[kept] *= np.exp(problem.sd[0] * found.x[:n])
    damping[kept] *= np.exp(problem.sd[1] * found.x[n:2 * n])
    return replace(plate, frequency_Hz=frequency, damping_ratio=damping)


def shifted(plate: PlateModel, channels: Channels, values: Floats, rate_Hz: float, noise: SensorNoise) -> PlateModel:
    """The plate with all frequencies moved by the factor that a record (c, samples) shows: since it was tapped it may
    have become warmer, or be held otherwise. It stays as it is below LEAST_SHIFT, and at the ends of SHIFTS."""
    kept = np.flatnonzero((low := plate.below(SHIFT_HIGHEST_Hz)).frequency_Hz > 0)
    if not kept.size or values.shape[1] < LEAST_PERIODS * rate_Hz / low.frequency_Hz[kept[0]]:
        return plate
    problem = _problem(low, channels, kept, values, rate_Hz, noise, SHIFT_HIGHEST_Hz)
    every = [replace(problem, start=(problem.start[0] * np.exp(shift), problem.start[1])) for shift in SHIFTS]
    costs = [one.cost(np.r_[np.zeros(2 * len(kept)), _first_level(one)])[0] for one in every]
    best = int(np.argmin(costs))
    before, least, after = costs[max(best - 1, 0):][:3] if 0 < best < len(SHIFTS) - 1 else (1.0, 0.0, 1.0)
    shift = SHIFTS[best] + (SHIFTS[1] - SHIFTS[0]) * (before - after) / (before - 2 * least + after) / 2
    inside = LEAST_SHIFT < abs(shift) < SHIFTS[-2]
    return replace(plate, frequency_Hz=plate.frequency_Hz * np.exp(shift)) if inside else plate


def _problem(plate: PlateModel, channels: Channels, kept: np.ndarray, values: Floats, rate_Hz: float,
             noise: SensorNoise, highest_Hz: float = np.inf) -> _Spectrum:
    f_Hz, spectrum, count = _spectrum(values[: len(channels.accelerometers)], rate_Hz)
    inside = (f_Hz > 60) & (f_Hz < min(HIGHEST_SHARE * rate_Hz, highest_Hz))
    f_Hz, spectrum = f_Hz[inside], spectrum[inside]
    shape = plate.sensor_shape[list(channels.accelerometers)][:, kept]
    smooth = legvander(2 * f_Hz / f_Hz[-1] - 1, FORCE_DEGREE)
    damping_sd = np.where(plate.damping_sd[kept] > 0, plate.damping_sd[kept], DAMPING_SD)
    frequency_sd = np.maximum(plate.frequency_sd[kept], 1e-4)
    floor = noise.spectrum(f_Hz, rate_Hz)[:, :len(shape), :len(shape)]
    return _Spectrum(f_Hz, spectrum, count, shape, floor, smooth,
                     (plate.frequency_Hz[kept], plate.damping_ratio[kept]), (frequency_sd, damping_sd))


def _spectrum(values: Floats, rate_Hz: float) -> tuple[Floats, Floats, float]:
    """Frequencies, real parts of one-sided cross spectra (bins, c, c) per Hz, and how many they average."""
    size = min(values.shape[1], round(SEGMENT_S * rate_Hz))
    count = 2 * values.shape[1] // size - 1
    starts = np.linspace(0, values.shape[1] - size, count).astype(int)
    window = np.hanning(size) if count > 1 else np.ones(size)
    total = np.zeros((size // 2 + 1, len(values), len(values)))
    for first in starts:
        z = np.fft.rfft(values[:, first:first + size] * window)
        total += np.real(np.einsum("ck,dk->kcd", z, z.conj()))
    total *= 2 / (rate_Hz * float(window @ window) * count)
    f_Hz = np.arange(size // 2 + 1) * (rate_Hz / size)
    return f_Hz, total, float(count if count == 1 else count / 1.9)


def _first_level(problem: _Spectrum) -> Floats:
    """Coefficients of log g with which the trace of the model is about that of the spectrum."""
    f2, b = problem.f_Hz[:, None] ** 2, problem.start[0] ** 2
    a = f2**2 / ((b - f2) ** 2 + 4 * (3 * problem.start[1]) ** 2 * b * f2)
    model = a @ (problem.shape**2).sum(axis=0)
    noise, both = (np.einsum("kcc->k", values) for values in (problem.noise, problem.spectrum))
    signal = np.maximum(both - noise, 0.1 * noise)
    return np.asarray(np.linalg.lstsq(problem.smooth, np.log(signal / model), rcond=None)[0])
