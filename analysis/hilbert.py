"""Hilbert spectrum and marginal spectrum of the IMFs (Huang et al. 1998).

Each IMF c(t) has the analytic signal c + i H[c] = a(t) exp(i phi(t)), with
instantaneous amplitude a and frequency f = (d phi / d t) / (2 pi). The marginal
spectrum of a frequency bin b of width df is

    h(b) = 1/df * sum over IMFs of the integral of a (or a^2) over the time f is in b.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import hilbert

from analysis.emd import Decomposition
from analysis.records import RecordError

#: The Fourier resolution of the paper's window of 0.04 s.
BIN_WIDTH_HZ = 25.0


@dataclass(frozen=True)
class InstantaneousModes:
    """amplitude and frequency_Hz: shape (m, n), of each IMF at each sample."""

    amplitude: np.ndarray
    frequency_Hz: np.ndarray


@dataclass(frozen=True)
class MarginalSpectrum:
    """edges_Hz: shape (bins + 1,); density: shape (bins,), in unit s/Hz (amplitude) or unit^2 s/Hz (energy).

    left_out: share of the integral at frequencies outside the bins (an instantaneous
    frequency may be negative where an IMF is not symmetric).
    """

    edges_Hz: np.ndarray
    density: np.ndarray
    kind: str
    left_out: float

    @property
    def centres_Hz(self) -> np.ndarray:
        return 0.5 * (self.edges_Hz[:-1] + self.edges_Hz[1:])

    @property
    def total(self) -> float:
        """Integral of the density over frequency: independent of the bin width."""
        return float(np.sum(self.density * np.diff(self.edges_Hz)))


def instantaneous(decomposition: Decomposition) -> InstantaneousModes:
    """Instantaneous amplitude and frequency of each IMF by the Hilbert transform.

    The frequency is the central difference of the unwrapped phase (one-sided at the ends).
    """
    analytic = hilbert(decomposition.imfs, axis=1)
    phase = np.unwrap(np.angle(analytic), axis=1)
    frequency_Hz = np.gradient(phase, axis=1) * decomposition.record.rate_Hz / (2 * np.pi)
    return InstantaneousModes(np.abs(analytic), frequency_Hz)


def marginal_spectrum(
    decomposition: Decomposition, *, kind: str = "amplitude", bin_width_Hz: float = BIN_WIDTH_HZ
) -> MarginalSpectrum:
    """Marginal spectrum of all IMFs, from 0 to half the sample rate in equal bins.

    kind: "amplitude" (integral of a) or "energy" (integral of a^2). The last bin is
    widened past half the sample rate if the width does not divide it.
    """
    if kind not in ("amplitude", "energy"):
        raise RecordError(f"kind = {kind!r}; choose amplitude or energy")
    if not bin_width_Hz > 0:
        raise RecordError(f"bin_width_Hz = {bin_width_Hz}; must be > 0")
    modes = instantaneous(decomposition)
    rate_Hz = decomposition.record.rate_Hz
    bins = max(1, int(np.ceil(0.5 * rate_Hz / bin_width_Hz)))
    edges_Hz = np.arange(bins + 1) * bin_width_Hz
    weight = (modes.amplitude if kind == "amplitude" else modes.amplitude**2) / rate_Hz
    sums, _ = np.histogram(modes.frequency_Hz, bins=edges_Hz, weights=weight)
    return MarginalSpectrum(edges_Hz, sums / bin_width_Hz, kind, 1.0 - float(sums.sum() / weight.sum()))
