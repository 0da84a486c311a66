"""Pictures of the report. The only module of `analysis` and `recognition` that imports matplotlib.

Each function draws data that others computed and returns a matplotlib Figure.
"""

from __future__ import annotations

import base64
import io

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

STYLE = {
    "svg.fonttype": "none",  # text stays text: small files, sharp in print
    "font.size": 9,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "lines.linewidth": 1.1,
    "legend.frameon": False,
}
WIDTH_IN = 5.0  # about the width of a phone, so that text keeps its size there
COAL, GANGUE, ACCENT = "#333333", "#b5651d", "#0b6e99"


def styled(draw):
    """Run a drawing function under STYLE, leaving the user's own settings alone."""

    def drawn(*args, **kwargs):
        with matplotlib.rc_context(STYLE):
            return draw(*args, **kwargs)

    drawn.__name__, drawn.__doc__ = draw.__name__, draw.__doc__
    return drawn


def to_svg_uri(figure: Figure, name: str) -> str:
    """The figure as a data URI of SVG, to stand in an <img> without any other file."""
    with matplotlib.rc_context({**STYLE, "svg.hashsalt": name}):
        buffer = io.BytesIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None}, bbox_inches="tight")
    return "data:image/svg+xml;base64," + base64.b64encode(buffer.getvalue()).decode()


def ratio_colour(ratio: float):
    """Dark blue (coal) to yellow-green (gangue), the same in every picture."""
    return matplotlib.colormaps["viridis"](0.93 * ratio)


def _ratio_bar(figure: Figure, axes) -> None:
    colours = matplotlib.colors.ListedColormap([ratio_colour(r) for r in np.linspace(0, 1, 101)])
    bar = figure.colorbar(ScalarMappable(Normalize(0, 100), colours), ax=axes, fraction=0.03, pad=0.02)
    bar.set_label("gangue mixing ratio, %")
    bar.outline.set_visible(False)


@styled
def curves(t_s: np.ndarray, panels: list[tuple[str, np.ndarray]], ratios: np.ndarray) -> Figure:
    """Curves of all ratios against time; panels: (label, values of shape (n_runs, n_samples))."""
    figure = Figure(figsize=(WIDTH_IN, 0.6 + 1.9 * len(panels)), layout="constrained")
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axis, (label, values) in zip(axes, panels, strict=True):
        for ratio, row in zip(ratios, values, strict=True):
            axis.plot(1e3 * t_s, row, color=ratio_colour(ratio))
        axis.set_ylabel(label)
    axes[-1].set_xlabel("time, ms")
    axes[-1].set_xlim(1e3 * t_s[0], 1e3 * t_s[-1])
    _ratio_bar(figure, axes)
    return figure


@styled
def against_ratio(ratios: np.ndarray, panels: list[tuple[str, dict[str, np.ndarray]]]) -> Figure:
    """Values against the mixing ratio; panels: (label, {name of series: values of shape (n,)})."""
    rows = (len(panels) + 1) // 2
    figure = Figure(figsize=(WIDTH_IN, 0.3 + 2.1 * rows), layout="constrained")
    axes = figure.subplots(rows, 2, squeeze=False).ravel()
    for axis, (label, series) in zip(axes, panels, strict=False):
        for colour, (name, values) in zip((ACCENT, GANGUE, COAL), series.items(), strict=False):
            axis.plot(100 * ratios, values, "o-", color=colour, markersize=3.5, label=name)
        axis.set_title(label)
        if len(series) > 1:
            axis.legend(fontsize=8)
    for axis in axes[len(panels) :]:
        axis.set_visible(False)
    for axis in axes[max(0, len(panels) - 2) : len(panels)]:
        axis.set_xlabel("gangue mixing ratio, %")
    return figure


@styled
def q_against_ratio(ratios: np.ndarray, q: np.ndarray, coefficients: np.ndarray, note: str) -> Figure:
    """Q of each run with its fitted polynomial (Figure 24)."""
    figure = Figure(figsize=(WIDTH_IN, 3.2), layout="constrained")
    axis = figure.subplots()
    fine = np.linspace(0, 1, 101)
    axis.plot(100 * fine, np.polynomial.polynomial.polyval(fine, coefficients), color=ACCENT, label=note)
    axis.plot(100 * ratios, q, "o", color=GANGUE, label="runs")
    axis.set_xlabel("gangue mixing ratio, %")
    axis.set_ylabel("fused parameter Q")
    axis.legend()
    return figure


@styled
def recognised(ratios: np.ndarray, answers: dict[str, list[float | None]]) -> Figure:
    """Recognised against true ratio; None where a method gave no answer."""
    figure = Figure(figsize=(WIDTH_IN, 3.6), layout="constrained")
    axis = figure.subplots()
    axis.plot([0, 100], [0, 100], color="#999999", linewidth=0.8)
    shapes, colours = "os^", (ACCENT, GANGUE, COAL)
    for i, (name, values) in enumerate(answers.items()):
        shape, colour, fill = shapes[i % 3], colours[i % 3], "full" if i < 3 else "none"
        points = [(100 * r, 100 * v) for r, v in zip(ratios, values, strict=True) if v is not None]
        if points:
            axis.plot(
                *zip(*points, strict=True), shape, fillstyle=fill, color=colour, markersize=6, label=name
            )
    axis.set_xlabel("true gangue mixing ratio, %")
    axis.set_ylabel("recognised, %")
    axis.legend(fontsize=8)
    return figure
