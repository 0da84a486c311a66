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
    panels = {f"{100 * results.ratios[i]:.0f} %": results.signals.decompositions[i].imfs for i in shown}
    return figures.imfs(results.t_s, panels)


def hilbert(results: SweepResults) -> Drawn:
    decompositions = results.signals.decompositions
    spectrum = hilbert_spectrum(decompositions[-1], bin_width_Hz=50.0, times=134)
    marginal = {r: marginal_spectrum(d) for r, d in zip(results.ratios, decompositions, strict=True)}
    return figures.hilbert_map(spectrum, marginal)


def parameters(results: SweepResults) -> Drawn:
    energies = results.signals.imf_energies[:, :3].T
    panels = [("energy of IMF 1-3, (m/s²)² s", {f"IMF {k}": row for k, row in enumerate(energies, 1)})]
    panels += [(label, {label: results.signals.parameters[name]}) for name, label in PARAMETER_LABELS.items()]
    return against_ratio(results.ratios, panels)


SIGNAL_FIGURES = [
    FigureSpec(
        key="fig-22",
        title="IMFs of the acceleration (Figure 22)",
        in_paper="Their number differs from ratio to ratio; the maxima of IMF 1 rise, the others show no pattern.",
        caption="Lowest and highest ratio. Rule: ten siftings an IMF.",
        draw=imfs,
    ),
    FigureSpec(
        key="fig-hilbert",
        title="Hilbert and marginal spectrum",
        in_paper="Used for the marginal spectrum's energy in Figure 23.",
        caption="Above: highest ratio. Below: all ratios, bins of 25 Hz.",
        draw=hilbert,
    ),
    FigureSpec(
        key="fig-23",
        title="Time-frequency parameters (Figure 23)",
        in_paper=(
            "Square root amplitude, absolute mean, variance, peak to peak, RMS and marginal spectrum rise; skewness"
            " and margin index fall; IMF energies, mean, waveform and kurtosis index are disorderly."
        ),
        caption="Formulas: docs/analysis.md.",
        draw=parameters,
    ),
]
