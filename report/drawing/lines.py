"""What many chapters draw: curves over time, thinned to what a screen can show, and values against the mixing ratio."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from report.drawing.style import ACCENT, COAL, GANGUE, PALE, RATIO_LABEL, add_ratio_bar, canvas, ratio_colours

RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def curves(t_s: np.ndarray, panels: list[tuple[str, np.ndarray]], ratios: np.ndarray) -> Figure:
    """Draw curves of all ratios over time. panels: (label, values of shape (runs, samples))."""
    figure, axes = canvas(len(panels), height_in=0.5 + 1.5 * len(panels), sharex=True,
                          bar="right" if len(ratios) > 1 else "")
    for axis, (label, values) in zip(axes[:, 0], panels, strict=True):
        for ratio, colour, row in zip(ratios, ratio_colours(ratios), values, strict=True):
            axis.plot(1e3 * t_s, row, color=colour, linewidth=0.9, label=f"_{100 * ratio:.0f} %")
        axis.set_title(label)
    axes[-1, 0].set_xlabel("time, ms")
    axes[-1, 0].set_xlim(1e3 * t_s[0], 1e3 * t_s[-1])
    if len(ratios) > 1:
        add_ratio_bar(figure)
    return figure


def against_ratio(ratios: np.ndarray, panels: list[tuple[str, dict[str, np.ndarray]]]) -> Figure:
    """Draw values against the mixing ratio. panels: (label, {name of the series: values of shape (runs,)})."""
    rows = (len(panels) + 1) // 2
    figure, grid = canvas(rows, 2, height_in=0.3 + 1.9 * rows)
    axes = grid.ravel()
    for axis, (label, series) in zip(axes, panels, strict=False):
        most = max((float(np.nanmax(np.abs(values), initial=0.0)) for values in series.values()), default=0.0)
        power = 3 * int(np.log10(most) // 3) if most >= 1e5 or 0 < most < 1e-2 else 0  # what ticks have no room for
        label = f"{label} / 10{str(power).translate(RAISED)}" if power else label
        for colour, (name, values) in zip((ACCENT, GANGUE, COAL, PALE), series.items(), strict=False):
            with_spread(axis, ratios, values / 10.0**power, colour, name)
        axis.set_title(label)
        if len(series) > 1:
            axis.legend()
    for axis in axes[len(panels) :]:
        axis.set_visible(False)
    for axis in axes[max(0, len(panels) - 2) : len(panels)]:
        axis.set_xlabel(RATIO_LABEL)
    return figure


def with_spread(axis: Axes, ratios: np.ndarray, values: np.ndarray, colour: str, name: str) -> None:
    """Draw values against the mixing ratio; where a ratio has several, their mean, dotted a deviation below and
    above it."""
    each = np.unique(ratios)
    found = [values[ratios == ratio] for ratio in each]
    mean = np.array([own.mean() for own in found])
    axis.plot(100 * each, mean, "o-", color=colour, markersize=3, label=name)
    if len(each) < len(ratios):
        deviation = np.array([own.std(ddof=1) if own.size > 1 else np.nan for own in found])
        for sign in "-+":
            axis.plot(100 * each, mean + float(f"{sign}1") * deviation, ":", color=colour, label=f"_{name} {sign} sd")


def make_logarithmic(scale: Any) -> None:
    """Marks of an XAxis or a YAxis at 1, 2 and 5 times powers of ten, as plain numbers."""
    scale._set_axes_scale("log")
    scale.set_major_locator(LogLocator(subs=(1, 2, 5), numticks=12))
    scale.set_major_formatter("{x:g}")
    scale.set_minor_formatter(NullFormatter())


def envelope(t_s: np.ndarray, values: np.ndarray, points: int) -> tuple[np.ndarray, np.ndarray]:
    """A curve (samples,) thinned to about `points` points that keeps every extreme wide enough to be seen: of each of
    points/2 stretches the least and the largest value remain, in their order."""
    bins = points // 2
    if t_s.size <= points:
        return t_s, values
    edges = np.linspace(0, t_s.size, bins + 1).astype(int)
    low = np.array([a + int(np.argmin(values[a:b])) for a, b in zip(edges, edges[1:], strict=False)])
    high = np.array([a + int(np.argmax(values[a:b])) for a, b in zip(edges, edges[1:], strict=False)])
    chosen = np.unique(np.concatenate([[0], low, high, [t_s.size - 1]]))
    return t_s[chosen], values[chosen]
