"""The figures of signal analysis: Figures 22 and 23 of the paper."""

import numpy as np

from analysis.signals.hilbert import hilbert_spectrum, marginal_spectrum
from report.drawing.figure_spec import Drawn, figure
from report.drawing.lines import against_ratio
from report.drawing.style import bar_axes, canvas, ratio_colours
from report.sweep_results import SweepResults

MOST_IMFS = 5
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


@figure("fig-22", "IMFs of the acceleration", "Ten siftings an IMF.")
def imfs(results: SweepResults) -> Drawn:
    shown = sorted({0, len(results.runs) - 1})
    found = {float(results.ratios[i]): results.signals.decompositions[i].imfs for i in shown}
    rows = min(MOST_IMFS, max(len(imf) for imf in found.values()))
    figure, axes = canvas(rows, height_in=1.0 * rows + 0.5, sharex=True)
    for k, axis in enumerate(axes[:, 0]):
        axis.set_title(f"IMF {k + 1}, m/s²")
        for (ratio, of_run), colour in zip(found.items(), ratio_colours(found), strict=True):
            if k < len(of_run):
                axis.plot(1e3 * results.t_s, of_run[k], color=colour, linewidth=0.8, label=f"{100 * ratio:.0f} %")
    if len(found) > 1:
        axes[0, 0].legend(ncols=2, loc="upper right")
    axes[-1, 0].set_xlabel("time, ms")
    return figure, "Lowest and highest ratio." if len(shown) > 1 else ""


@figure("fig-hilbert", "Hilbert and marginal spectrum", "Marginal spectrum in bins of 25 Hz.")
def hilbert(results: SweepResults) -> Drawn:
    decompositions = results.signals.decompositions
    spectrum = hilbert_spectrum(decompositions[-1], bin_width_Hz=50.0, times=134)
    marginal = {r: marginal_spectrum(d) for r, d in zip(results.ratios, decompositions, strict=True)}
    figure, axes = canvas(2, height_in=4.6, bar="right")
    upper, lower = axes[:, 0]
    field = np.ma.masked_equal(spectrum.amplitude, 0)
    image = upper.pcolormesh(1e3 * spectrum.edges_s, 1e-3 * spectrum.edges_Hz, field, cmap="viridis", rasterized=True)
    figure.colorbar(image, cax=bar_axes(figure), label="amplitude in the map, m/s²")
    upper.set_xlabel("time, ms")
    upper.set_title("frequency, kHz")
    upper.grid(False)
    for (ratio, found), colour in zip(marginal.items(), ratio_colours(marginal), strict=True):
        lower.plot(1e-3 * found.centres_Hz, found.density, color=colour, linewidth=0.8, label=f"_{100 * ratio:.0f} %")
    lower.set_xlabel("frequency, kHz")
    lower.set_title("marginal spectrum, m/s² s/Hz")
    return figure, "Above: highest ratio; below: each ratio." if len(marginal) > 1 else ""


@figure("fig-23", "Time-frequency parameters", "Of the acceleration of the plate's centre of mass.", ratios=2)
def parameters(results: SweepResults) -> Drawn:
    energies = results.signals.imf_energies[:, :3].T
    panels = [("energy of IMF 1-3, (m/s²)² s", {f"IMF {k}": row for k, row in enumerate(energies, 1)})]
    panels += [(label, {label: results.signals.parameters[name]}) for name, label in PARAMETER_LABELS.items()]
    return against_ratio(results.ratios, panels)


SIGNAL_FIGURES = [imfs, hilbert, parameters]
