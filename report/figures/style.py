"""Style and general pictures of the report. Only `report.figures.style*` imports matplotlib.

Each function draws data that others computed and returns a matplotlib Figure.
"""

from __future__ import annotations

import base64
import functools
import io
from collections.abc import Callable
from typing import Any

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure

STYLE: Any = {
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
    "legend.fontsize": 8,
}
WIDTH_IN = 5.0  # about the width of a phone, so that text keeps its size there
COAL, GANGUE, ACCENT, PALE = "#333333", "#b5651d", "#0b6e99", "#999999"
RATIO_LABEL = "gangue mixing ratio, %"


def styled(draw: Callable) -> Callable:
    """Run a drawing function under STYLE, leaving the user's own settings alone."""

    @functools.wraps(draw)
    def drawn(*args, **kwargs):
        with matplotlib.rc_context(STYLE):
            return draw(*args, **kwargs)

    return drawn


def canvas(rows: int, columns: int = 1, *, height_in: float, **layout):
    """A figure of the report's width and its axes, shape (rows, columns)."""
    figure = Figure(figsize=(WIDTH_IN, height_in), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **layout)


def to_uri(figure: Figure, name: str, *, pixels: bool = False) -> str:
    """The figure as a data URI of SVG (or PNG, where thousands of shapes would make SVG large)."""
    with matplotlib.rc_context({**STYLE, "svg.hashsalt": name}):
        buffer = io.BytesIO()
        kind = {"format": "png", "dpi": 200} if pixels else {"format": "svg", "metadata": {"Date": None}}
        figure.savefig(buffer, **kind)
    head = "image/png" if pixels else "image/svg+xml"
    return f"data:{head};base64," + base64.b64encode(buffer.getvalue()).decode()


def ratio_colour(ratio: float):
    """Dark blue (coal) to yellow-green (gangue), the same in every picture."""
    return matplotlib.colormaps["viridis"](0.93 * ratio)


def ratio_bar(figure: Figure, axes) -> None:
    """The scale of `ratio_colour` beside axes."""
    colours = ListedColormap([ratio_colour(r) for r in np.linspace(0, 1, 101)])
    bar = figure.colorbar(ScalarMappable(Normalize(0, 100), colours), ax=axes, fraction=0.03, pad=0.02)
    bar.set_label(RATIO_LABEL)
    bar.outline.set_visible(False)


@styled
def curves(t_s: np.ndarray, panels: list[tuple[str, np.ndarray]], ratios: np.ndarray) -> Figure:
    """Curves of all ratios against time; panels: (label, values of shape (n_runs, n_samples))."""
    figure, axes = canvas(len(panels), height_in=0.6 + 1.6 * len(panels), sharex=True)
    for axis, (label, values) in zip(axes[:, 0], panels, strict=True):
        for ratio, row in zip(ratios, values, strict=True):
            axis.plot(1e3 * t_s, row, color=ratio_colour(ratio), linewidth=0.9)
        axis.set_title(label)
    axes[-1, 0].set_xlabel("time, ms")
    axes[-1, 0].set_xlim(1e3 * t_s[0], 1e3 * t_s[-1])
    ratio_bar(figure, axes)
    return figure


@styled
def contact_forces(lines, label: str, first_ms: float = 1.0) -> Figure:
    """Forces against time, the first collision apart from the rest; lines: (name, colour, t_s, values)."""
    figure, axes = canvas(2, height_in=3.8)
    upper, lower = axes[:, 0]
    for name, colour, t_s, values in lines:
        early = 1e3 * t_s <= first_ms
        upper.plot(1e3 * t_s[early], values[early], color=colour, label=name or None)
        lower.plot(1e3 * t_s[~early], values[~early], color=colour, linewidth=0.8)
    upper.set_title(label + ": first collision")
    lower.set_title("after it")
    lower.set_xlabel("time, ms")
    if any(name for name, *_ in lines):
        upper.legend()
    return figure


@styled
def against_ratio(
    ratios: np.ndarray, panels: list[tuple[str, dict[str, np.ndarray]]], xlabel=RATIO_LABEL
) -> Figure:
    """Values against the mixing ratio; panels: (label, {name of series: values of shape (n,)})."""
    rows = (len(panels) + 1) // 2
    figure, axes = canvas(rows, 2, height_in=0.3 + 1.9 * rows)
    axes = axes.ravel()
    for axis, (label, series) in zip(axes, panels, strict=False):
        for colour, (name, values) in zip((ACCENT, GANGUE, COAL, PALE), series.items(), strict=False):
            axis.plot(100 * ratios, values, "o-", color=colour, markersize=3, label=name)
        axis.set_title(label)
        if len(series) > 1:
            axis.legend()
    for axis in axes[len(panels) :]:
        axis.set_visible(False)
    for axis in axes[max(0, len(panels) - 2) : len(panels)]:
        axis.set_xlabel(xlabel)
    return figure
