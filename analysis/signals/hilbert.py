"""Hilbert spectrum and marginal spectrum of the IMFs (Huang et al. 1998).

Each IMF c(t) has the analytic signal c + i H[c] = a(t) exp(i phi(t)), with the instantaneous amplitude a and the
frequency f = (d phi / d t) / (2 pi). The marginal spectrum of a frequency bin b of width df is

    h(b) = 1/df * sum over IMFs of the integral of a (or a^2) over the time f is in b.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.fft import fft, ifft

from analysis.signals.emd import Decomposition, decompose
from analysis.signals.records import Record, RecordError, Signal
from common.by_value import ByValue

#: The Fourier resolution of the paper's window of 0.04 s.
BIN_WIDTH_HZ = 25.0
MOST_BINS = 1e7


@dataclass(frozen=True, eq=False)
class HilbertSpectrum(ByValue):
    """Amplitude (bins, times) on cells between edges_Hz (bins + 1,) and edges_s (times + 1,), in the record's unit.

    It is the mean over a cell of the sum over the IMFs of a.

    >>> spectrum = hilbert_spectrum(decompose(read_record("runs/paper/ratio_030")), times=50)
    >>> spectrum.amplitude.shape == (spectrum.edges_Hz.size - 1, 50)
    True
    """

    edges_s: np.ndarray
    edges_Hz: np.ndarray
    amplitude: np.ndarray


@dataclass(frozen=True, eq=False)
class MarginalSpectrum(ByValue):
    """Density (bins,) between edges_Hz (bins + 1,), in unit s/Hz (kind "amplitude") or unit^2 s/Hz (kind "energy").

    `left_out` is the share of the integral at frequencies outside the bins: an instantaneous frequency may be negative
    where an IMF is not symmetric.

    >>> MarginalSpectrum(np.array([0.0, 25.0, 50.0]), np.array([0.1, 0.3]), "amplitude", left_out=0.0).total
    10.0
    """

    edges_Hz: np.ndarray
    density: np.ndarray
    kind: str
    left_out: float

    @property
    def centres_Hz(self) -> np.ndarray:
        """Middle of each bin (bins,)."""
        return 0.5 * (self.edges_Hz[:-1] + self.edges_Hz[1:])

    @property
    def total(self) -> float:
        """Integral of the density over frequency, which does not depend on the width of the bins."""
        return float(np.sum(self.density * np.diff(self.edges_Hz)))


def analytic_signal(values: np.ndarray) -> np.ndarray:
    """Return c + i H[c] (n,) of a signal c (n,): its Fourier series without the negative frequencies, twice. It is
    scipy.signal.hilbert, whose module takes longer to import than a short record to analyse."""
    n = len(values)
    spectrum = fft(values)
    spectrum[1 : (n + 1) // 2] *= 2
    spectrum[n // 2 + 1 :] = 0
    return ifft(spectrum)


def instantaneous(imf: np.ndarray, rate_Hz: float) -> tuple[np.ndarray, np.ndarray]:
    """Return amplitude (n,) and frequency (n,) in Hz of one IMF at each sample.

    The frequency is the central difference of the unwrapped phase, one-sided at the ends. Raises RecordError for
    what is no `Record`.

    >>> amplitude, frequency_Hz = instantaneous(2 * np.cos(2 * np.pi * 50 * np.arange(1000) / 1e3), rate_Hz=1000.0)
    >>> round(float(amplitude[500]), 6), round(float(frequency_Hz[500]), 6)
    (2.0, 50.0)
    """
    analytic = analytic_signal(Record(imf, rate_Hz, name="imf").values)
    # The step of phase between neighbours is taken within (-pi, pi], which is what unwrapping does.
    step = np.angle(analytic[1:] * np.conj(analytic[:-1]))
    central = np.concatenate([step[:1], 0.5 * (step[1:] + step[:-1]), step[-1:]])
    return np.abs(analytic), central * rate_Hz / (2 * np.pi)


def frequency_edges_Hz(rate_Hz: float, bin_width_Hz: float) -> np.ndarray:
    """Return the edges of equal bins from 0 to at least half the sample rate. Raises RecordError for no width, or one
    with too many bins."""
    if not 0 < bin_width_Hz < np.inf or rate_Hz / bin_width_Hz > MOST_BINS:
        raise RecordError(f"bin_width_Hz = {bin_width_Hz}; must be finite, > 0, and give at most {MOST_BINS:.0e} bins")
    return np.arange(max(1, int(np.ceil(0.5 * rate_Hz / bin_width_Hz))) + 1) * bin_width_Hz


def _decomposed(signal: Decomposition | Signal) -> Decomposition:
    return signal if isinstance(signal, Decomposition) else decompose(signal)


def marginal_spectrum(signal: Decomposition | Signal, *, kind: str = "amplitude",
                      bin_width_Hz: float = BIN_WIDTH_HZ) -> MarginalSpectrum:
    """Return the marginal spectrum of all IMFs of a decomposition or a signal, from 0 to half the sample rate in equal
    bins.

    The kind is "amplitude" (integral of a) or "energy" (integral of a^2). The last bin reaches past half the sample
    rate if the width does not divide it. Raises RecordError for another kind, or a width not > 0.

    >>> spectrum = marginal_spectrum(decompose(Record(np.cos(2 * np.pi * 60 * np.arange(1000) / 1e3), rate_Hz=1000.0)))
    >>> float(spectrum.centres_Hz[spectrum.density.argmax()])
    62.5
    """
    if kind not in ("amplitude", "energy"):
        raise RecordError(f"kind = {kind!r}; choose amplitude or energy")
    decomposition = _decomposed(signal)
    rate_Hz = decomposition.record.rate_Hz
    edges_Hz = frequency_edges_Hz(rate_Hz, bin_width_Hz)
    sums, everything = np.zeros(edges_Hz.size - 1), 0.0
    for imf in decomposition.imfs:
        amplitude, frequency_Hz = instantaneous(imf, rate_Hz)
        weight = amplitude if kind == "amplitude" else amplitude**2
        number = np.floor(frequency_Hz / bin_width_Hz).astype(int)
        inside = (number >= 0) & (number < sums.size)
        sums += np.bincount(number[inside], weight[inside], minlength=sums.size)
        everything += weight.sum()
    left_out = 1.0 - float(sums.sum() / everything) if everything > 0 else 0.0
    return MarginalSpectrum(edges_Hz, sums / (rate_Hz * bin_width_Hz), kind, left_out)


def hilbert_spectrum(signal: Decomposition | Signal, *, bin_width_Hz: float = BIN_WIDTH_HZ,
                     times: int = 100) -> HilbertSpectrum:
    """Return the Hilbert spectrum, of a decomposition or a signal, on equal cells of frequency and time. Raises
    RecordError for a width that is not > 0, and no times. There are at most as many times as samples.

    >>> record = Record(np.cos(2 * np.pi * 70 * np.arange(1000) / 1e3), rate_Hz=1000.0)
    >>> spectrum = hilbert_spectrum(decompose(record), bin_width_Hz=20.0, times=4)
    >>> spectrum.amplitude.argmax(axis=0).tolist()  # the bin of 60 to 80 Hz at each time
    [3, 3, 3, 3]
    """
    if times < 1:
        raise RecordError(f"times = {times}; must be at least 1")
    decomposition = _decomposed(signal)
    record = decomposition.record
    times = min(times, record.values.size)
    cell = np.arange(record.values.size) * times // record.values.size  # of each sample, whatever times are rounded to
    edges_Hz = frequency_edges_Hz(record.rate_Hz, bin_width_Hz)
    edges_s = record.t0_s + np.linspace(0, record.values.size / record.rate_Hz, times + 1)
    total = np.zeros((edges_Hz.size - 1, times))
    for imf in decomposition.imfs:
        amplitude, frequency_Hz = instantaneous(imf, record.rate_Hz)
        total += np.histogram2d(frequency_Hz, cell, bins=(edges_Hz, np.arange(times + 1)), weights=amplitude)[0]
    return HilbertSpectrum(edges_s, edges_Hz, total / np.bincount(cell))
