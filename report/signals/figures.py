"""Figures of signal analysis (Figures 22 and 23)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from analysis.signals.hilbert import HilbertSpectrum, MarginalSpectrum
from report.drawing.style import bar_axes, canvas, ratio_colours, styled


@styled
def imfs(t_s: np.ndarray, found: dict[float, np.ndarray], most: int = 5) -> Figure:
    """Draw the first IMFs of the acceleration of some runs. found: {mixing ratio: IMFs of shape (m, samples)}."""
    rows = min(most, max(len(imf) for imf in found.values()))
    figure, axes = canvas(rows, height_in=1.0 * rows + 0.5, sharex=True)
    for k, axis in enumerate(axes[:, 0]):
        axis.set_title(f"IMF {k + 1}, m/s²")
        for (ratio, of_run), colour in zip(found.items(), ratio_colours(found), strict=True):
            if k < len(of_run):
                axis.plot(1e3 * t_s, of_run[k], color=colour, linewidth=0.8, label=f"{100 * ratio:.0f} %")
    if len(found) > 1:
        axes[0, 0].legend(ncols=2, loc="upper right")
    axes[-1, 0].set_xlabel("time, ms")
    return figure


@styled
def hilbert_map(spectrum: HilbertSpectrum, marginal: dict[float, MarginalSpectrum]) -> Figure:
    """Draw the Hilbert spectrum of one run, and the marginal spectra of all. marginal: {mixing ratio: spectrum}."""
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
    return figure
