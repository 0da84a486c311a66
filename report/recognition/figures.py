"""Figures of recognition (Figures 24 to 38)."""

from __future__ import annotations

from itertools import cycle

import numpy as np
from matplotlib.figure import Figure

from report.drawing.style import (
    ACCENT,
    COAL,
    GANGUE,
    GREEN,
    PALE,
    RATIO_LABEL,
    ROSE,
    VIOLET,
    YELLOW,
    canvas,
    styled,
)


@styled
def q_against_ratio(ratios: np.ndarray, q: np.ndarray, coefficients: np.ndarray) -> Figure:
    """Draw Q of each run with its fitted polynomial (Figure 24). coefficients: lowest power first."""
    figure, axes = canvas(1, height_in=2.8)
    axis = axes[0, 0]
    fine = np.linspace(0, 1, 101)
    axis.plot(100 * fine, np.polynomial.polynomial.polyval(fine, coefficients), color=ACCENT, label="fitted")
    axis.plot(100 * ratios, q, "o", color=GANGUE, label="runs")
    axis.set_xlabel(RATIO_LABEL)
    axis.set_ylabel("fused parameter Q")
    axis.legend()
    return figure


@styled
def before_after(t_s: np.ndarray, panels: list[tuple[str, np.ndarray, np.ndarray]]) -> Figure:
    """Draw responses of one run before and after the Kalman filter (Figure 25). panels: (label, before, after)."""
    rows = -(-len(panels) // 2)
    figure, axes = canvas(rows, 2, height_in=1.6 * rows + 0.3, sharex=True)
    for axis, (label, before, after) in zip(axes.ravel(), panels, strict=False):
        axis.plot(1e3 * t_s, before, color=PALE, linewidth=0.8, label="before")
        axis.plot(1e3 * t_s, after, color=ACCENT, linewidth=1.0, label="after")
        axis.set_title(label)
    for axis in axes[-1]:
        axis.set_xlabel("time, ms")
    return figure


@styled
def fusion_process(t_s: np.ndarray, panels: list[tuple[str, dict[str, np.ndarray], np.ndarray]]) -> Figure:
    """Draw normalised responses of one run and what the filter makes of them (Figures 29 to 32).

    panels: (fusion, {response: shape (samples,)}, fused of shape (samples,)).
    """
    figure, axes = canvas(len(panels) + 1, height_in=1.4 * len(panels) + 1.4, sharex=True)
    names = dict.fromkeys(name for _, responses, _ in panels for name in responses)
    colours = dict(zip(names, cycle((GANGUE, PALE, GREEN, ROSE, VIOLET, YELLOW, ACCENT)), strict=False))
    *drawn, below = axes[:, 0]
    for axis, (kind, responses, fused) in zip(drawn, panels, strict=True):
        for name, values in responses.items():
            axis.plot(1e3 * t_s, values, color=colours[name], linewidth=0.6, label=name)
        axis.plot(1e3 * t_s, fused, color="black", linewidth=1.2, label="fused")
        axis.set_title(f"{kind} fusion")
    drawn[-1].set_xlabel("time, ms")
    drawn[-1].tick_params(labelbottom=True)
    below.set_axis_off()
    known = {line.get_label(): line for axis in drawn for line in axis.get_lines()}
    below.legend(known.values(), known, ncols=3, loc="center")
    return figure


@styled
def worked_example(true_ratio: float, methods: dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]) -> Figure:
    """Draw the mean difference of every candidate ratio of one record (Figure 37).

    methods: {method: (candidate ratios, mean differences, whether enough points support each), shape (c,) each}.
    """
    figure, axes = canvas(len(methods), height_in=2.0 * len(methods) + 0.4, sharex=True)
    for axis, (name, (ratio, difference, allowed)) in zip(axes[:, 0], methods.items(), strict=True):
        axis.plot(100 * ratio, difference, ".", color=PALE, markersize=3, label="not enough usable points")
        axis.plot(100 * ratio[allowed], difference[allowed], ".", color=ACCENT, markersize=3, label="candidates")
        if allowed.any():
            best = int(np.argmin(np.where(allowed, difference, np.inf)))
            axis.plot(100 * ratio[best], difference[best], "o", color=GANGUE,
                      label=f"answer {100 * ratio[best]:.2f} %")  # fmt: skip
        axis.axvline(100 * true_ratio, color="black", linewidth=0.8)
        axis.set_title(name)
        axis.set_ylabel("mean difference")
        axis.yaxis.set_major_formatter("{x:.3g}")
        axis.legend()
    axes[-1, 0].set_xlabel(f"candidate ratio, % (line: true, {100 * true_ratio:.0f} %)")
    return figure


@styled
def function_space(
    ratios: np.ndarray, measured: np.ndarray, t_s: np.ndarray, fine_ratios: np.ndarray, fitted: np.ndarray
) -> Figure:
    """Draw QQ against the ratio at up to six moments with the fitted functions.

    measured: shape (moments, runs). t_s: shape (moments,). fitted: at fine_ratios (n,), shape (moments, n).
    """
    figure, axes = canvas(1, height_in=2.8)
    axis = axes[0, 0]
    colours = (COAL, ACCENT, GANGUE, PALE, GREEN, ROSE)
    for colour, moment_s, points, line in zip(colours, t_s, measured, fitted, strict=False):
        axis.plot(100 * fine_ratios, line, color=colour)
        axis.plot(100 * ratios, points, "o", color=colour, markersize=3, label=f"{1e3 * moment_s:.1f} ms")
    axis.set_xlabel(RATIO_LABEL)
    axis.set_ylabel("fusion parameter QQ")
    axis.legend(ncols=2)
    return figure


@styled
def recognised_against_true(
    ratios: np.ndarray, with_interval: dict[str, np.ndarray], others: dict[str, np.ndarray]
) -> Figure:
    """Draw recognised against true ratio, with 90 % intervals where a method gives them.

    with_interval: {method: recognised, low, high of shape (runs, 3)}, the leading method first. others: {method:
    recognised of shape (runs,)}. NaN where there is no answer or no interval.
    """
    figure, axes = canvas(1, height_in=3.7)
    axis = axes[0, 0]
    axis.plot([0, 100], [0, 100], color=PALE, linewidth=0.9, label="_true")
    for mark, colour, (name, recognised) in zip("sv", (COAL, GREEN), others.items(), strict=False):
        axis.plot(100 * ratios - 1.2, 100 * recognised, mark, color=colour, markersize=4.5, fillstyle="none",
                  label=name)  # fmt: skip
    marks = zip((1.2, 0.0), "Do", (GANGUE, ACCENT), reversed(with_interval.items()), strict=False)
    for aside, mark, colour, (name, answers) in marks:
        at = 100 * ratios + aside
        middle, low, high = 100 * answers.T
        if np.isnan(middle).all():
            continue
        axis.vlines(at, low, high, color=colour, linewidth=4, alpha=0.35)
        axis.plot(at, middle, mark, color=colour, markersize=5, label=f"{name}, 90 % interval")
    axis.set_xlabel("true " + RATIO_LABEL)
    axis.set_ylabel("recognised, %")
    axis.set_xlim(-4, 104)
    axis.legend(loc="upper left")
    return figure


@styled
def recognition_errors(ratios: np.ndarray, answers: dict[str, dict[str, list[float | None]]]) -> Figure:
    """Draw the error of recognition against the true ratio, in points.

    answers: {training: {method: recognised ratio of each run, or None}}; the first five methods are drawn.
    """
    figure, axes = canvas(len(answers), height_in=2.0 * len(answers) + 0.4, sharex=True, sharey=True)
    for axis, (training, methods) in zip(axes[:, 0], answers.items(), strict=True):
        axis.axhline(0, color=PALE, linewidth=0.8)
        for mark, colour, (name, values) in zip("os^Dv", (ACCENT, GANGUE, COAL, PALE, GREEN), methods.items(),
                                                strict=False):  # fmt: skip
            points = [(100 * r, 100 * (v - r)) for r, v in zip(ratios, values, strict=True) if v is not None]
            if points:
                axis.plot(*zip(*points, strict=True), mark, color=colour, markersize=4, label=name)
        axis.set_title(training)
        axis.set_ylabel("error, points")
    axes[0, 0].legend()
    axes[-1, 0].set_xlabel("true " + RATIO_LABEL)
    return figure
