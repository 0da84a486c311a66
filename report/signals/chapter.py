"""The chapter of signal analysis: Figures 22 and 23 of the paper."""

from __future__ import annotations

from analysis.signals.hilbert import hilbert_spectrum, marginal_spectrum
from report.drawing.figure_spec import Drawn, FigureSpec
from report.drawing.lines import against_ratio
from report.signals import figures
from report.sweep_results import SweepResults

PARAMETER_LABELS = {
    "square_root_amplitude": "square root amplitude, m/s²",
    "absolute_mean": "absolute mean, m/s²",
    "mean": "mean, m/s²",
    "variance": "variance, (m/s²)²",
    "peak_to_peak": "peak to peak, m/s²",
    "rms": "RMS, m/s²",
    "waveform_index": "waveform index",
    "kurtosis_index": "kurtosis index",
    "skewness_raw": "skewness (raw), (m/s²)³",
    "margin_index": "margin index",
    "marginal_spectrum_energy": "marginal spectrum, (m/s²)² s",
}


def imfs(results: SweepResults) -> Drawn:
    shown = sorted({0, len(results.runs) - 1})
    note = "Lowest and highest ratio." if len(shown) > 1 else ""
    found = {float(results.ratios[i]): results.signals.decompositions[i].imfs for i in shown}
    return figures.imfs(results.t_s, found), note


def hilbert(results: SweepResults) -> Drawn:
    decompositions = results.signals.decompositions
    spectrum = hilbert_spectrum(decompositions[-1], bin_width_Hz=50.0, times=134)
    marginal = {r: marginal_spectrum(d) for r, d in zip(results.ratios, decompositions, strict=True)}
    note = "Above: highest ratio; below: each ratio." if len(marginal) > 1 else ""
    return figures.hilbert_map(spectrum, marginal), note


def parameters(results: SweepResults) -> Drawn:
    energies = results.signals.imf_energies[:, :3].T
    panels = [("energy of IMF 1-3, (m/s²)² s", {f"IMF {k}": row for k, row in enumerate(energies, 1)})]
    panels += [(label, {label: results.signals.parameters[name]}) for name, label in PARAMETER_LABELS.items()]
    return against_ratio(results.ratios, panels)


SIGNAL_FIGURES = [
    FigureSpec("fig-22", "IMFs of the acceleration", "Ten siftings an IMF.", imfs),
    FigureSpec("fig-hilbert", "Hilbert and marginal spectrum", "Marginal spectrum in bins of 25 Hz.", hilbert),
    FigureSpec("fig-23", "Time-frequency parameters",
               "Of the acceleration of the plate's centre of mass.", parameters, ratios=2),
]
