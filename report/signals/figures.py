"""Figures of signal analysis (Figures 22 and 23)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from analysis.signals.hilbert import HilbertSpectrum, MarginalSpectrum
from analysis.signals.pictures import plot_hilbert
from report.drawing.style import ACCENT, canvas, ratio_colour, styled


@styled
def imfs(t_s: np.ndarray, panels: dict[str, np.ndarray], most: int = 6) -> Figure:
    """Draw the first IMFs of the acceleration (Figure 22). panels: {label of the run: IMFs of shape (m, samples)}."""
    rows = min(most, max(len(p) for p in panels.values()))
    figure, axes = canvas(rows, len(panels), height_in=1.05 * rows + 0.6, sharex=True)
    for column, (label, found) in zip(axes.T, panels.items(), strict=True):
        column[0].set_title(label)
        for k, axis in enumerate(column):
            if k < len(found):
                axis.plot(1e3 * t_s, found[k], color=ACCENT, linewidth=0.7)
                axis.set_ylabel(f"{k + 1}", rotation=0, labelpad=6)
            else:
                axis.set_axis_off()
            axis.tick_params(labelsize=7)
        column[-1].set_xlabel("time, ms")
    figure.supylabel("IMF, m/s²", fontsize=9)
    return figure


@styled
def hilbert_map(spectrum: HilbertSpectrum, marginal: dict[float, MarginalSpectrum]) -> Figure:
    """Draw the Hilbert spectrum of one run, and the marginal spectra of all. marginal: {mixing ratio: spectrum}."""
    figure, axes = canvas(2, height_in=4.6)
    upper, lower = axes[:, 0]
    plot_hilbert(spectrum, upper, "m/s²")
    for ratio, found in marginal.items():
        lower.plot(1e-3 * found.centres_Hz, found.density, color=ratio_colour(ratio), linewidth=0.8,
                   label=f"_{100 * ratio:.0f} %")  # fmt: skip
    lower.set_xlabel("frequency, kHz")
    lower.set_ylabel("marginal spectrum, m/s² s/Hz")
    return figure
