"""Pictures of signal analysis and recognition (Figures 22-38)."""

from __future__ import annotations

import numpy as np
from matplotlib.ticker import LogLocator

from analysis.hilbert import MarginalSpectrum
from recognition.paper.strategy import Candidates
from report.figures.style import ACCENT, COAL, GANGUE, PALE, RATIO_LABEL, canvas, styled


@styled
def imfs(t_s: np.ndarray, panels: dict[str, np.ndarray], most: int = 6):
    """IMFs of the acceleration (Figure 22); panels: {label of the run: IMFs of shape (m, n)}."""
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
def hilbert_map(spectrum, marginal: dict[float, MarginalSpectrum], colour):
    """Hilbert spectrum of one run, and marginal spectra of all; colour: of a ratio."""
    figure, axes = canvas(2, height_in=4.6)
    upper, lower = axes[:, 0]
    field = np.ma.masked_equal(spectrum.amplitude, 0)
    image = upper.pcolormesh(
        1e3 * spectrum.edges_s, 1e-3 * spectrum.edges_Hz, field, cmap="viridis", rasterized=True
    )
    figure.colorbar(image, ax=upper, label="amplitude, m/s²", fraction=0.05)
    upper.set_xlabel("time, ms")
    upper.set_ylabel("frequency, kHz")
    upper.grid(False)
    for ratio, found in marginal.items():
        lower.plot(1e-3 * found.centres_Hz, found.density, color=colour(ratio), linewidth=0.8)
    lower.set_xlabel("frequency, kHz")
    lower.set_ylabel("marginal spectrum, m/s² s/Hz")
    return figure


@styled
def rule_costs(costs):
    """Error against time of the EMD stopping rules; costs: list of `RuleCost`."""
    figure, axes = canvas(1, height_in=2.6)
    axis = axes[0, 0]
    colours = dict(zip(dict.fromkeys(c.rule for c in costs), (ACCENT, GANGUE, COAL), strict=True))
    marks = dict(zip(dict.fromkeys(c.samples for c in costs), "os^", strict=True))
    for c in costs:
        axis.loglog(1e3 * c.seconds, 100 * c.error, marks[c.samples], color=colours[c.rule])
    for rule, colour in colours.items():
        axis.plot([], [], color=colour, linewidth=4, label=rule)
    for samples, mark in marks.items():
        axis.plot([], [], mark, color=PALE, label=f"{samples} samples")
    axis.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.yaxis.set_major_formatter("{x:g}")
    axis.minorticks_off()
    axis.set_ylabel("error of the first IMF, %")
    axis.set_xlabel("time of one decomposition, ms")
    axis.legend(ncols=2, loc="center left")
    return figure


@styled
def q_against_ratio(ratios: np.ndarray, q: np.ndarray, coefficients: np.ndarray, note: str):
    """Q of each run with its fitted polynomial (Figure 24)."""
    figure, axes = canvas(1, height_in=2.8)
    axis = axes[0, 0]
    fine = np.linspace(0, 1, 101)
    axis.plot(100 * fine, np.polynomial.polynomial.polyval(fine, coefficients), color=ACCENT, label=note)
    axis.plot(100 * ratios, q, "o", color=GANGUE, label="runs")
    axis.set_xlabel(RATIO_LABEL)
    axis.set_ylabel("fused parameter Q")
    axis.legend()
    return figure


@styled
def before_after(t_s: np.ndarray, panels: list[tuple[str, np.ndarray, np.ndarray]]):
    """Responses of one run before and after the Kalman filter (Figure 25); panels: (label, before, after)."""
    rows = -(-len(panels) // 2)
    figure, axes = canvas(rows, 2, height_in=1.6 * rows + 0.3, sharex=True)
    for axis, (label, before, after) in zip(axes.ravel(), panels, strict=False):
        axis.plot(1e3 * t_s, before, color=PALE, linewidth=0.8, label="before")
        axis.plot(1e3 * t_s, after, color=ACCENT, linewidth=1.0, label="after")
        axis.set_title(label)
        axis.tick_params(labelsize=7)
    axes[0, 0].legend()
    for axis in axes[-1]:
        axis.set_xlabel("time, ms")
    return figure


@styled
def fusion_process(t_s: np.ndarray, panels: list[tuple[str, dict[str, np.ndarray], np.ndarray]]):
    """Normalised responses and what the filter makes of them (Figures 29-32); panels: (kind, parts, fused)."""
    figure, axes = canvas(len(panels), height_in=1.7 * len(panels) + 0.4, sharex=True)
    colours = (GANGUE, PALE, "#88b04b", "#c06c84", "#6c5b7b", "#f2b134")
    for axis, (kind, parts, fused) in zip(axes[:, 0], panels, strict=True):
        for colour, (name, values) in zip(colours, parts.items(), strict=False):
            axis.plot(1e3 * t_s, values, color=colour, linewidth=0.6, label=name)
        axis.plot(1e3 * t_s, fused, color="black", linewidth=1.2, label="fused")
        axis.set_title(kind)
        axis.legend(fontsize=6, ncols=4, loc="upper right")
    axes[-1, 0].set_xlabel("time, ms")
    return figure


@styled
def worked_example(ratio: float, tables: dict[str, Candidates]):
    """Figure 37 by example: mean difference of every candidate ratio; tables: {strategy: Candidates}."""
    figure, axes = canvas(len(tables), height_in=2.0 * len(tables) + 0.4, sharex=True)
    for axis, (name, found) in zip(axes[:, 0], tables.items(), strict=True):
        axis.plot(
            100 * found.ratio, found.score, ".", color=PALE, markersize=3, label="not enough usable points"
        )
        ok = found.allowed
        axis.plot(100 * found.ratio[ok], found.score[ok], ".", color=ACCENT, markersize=3, label="candidates")
        if ok.any():
            best = int(np.argmin(np.where(ok, found.score, np.inf)))
            axis.plot(100 * found.ratio[best], found.score[best], "o", color=GANGUE,
                      label=f"answer {100 * found.ratio[best]:.2f} %")  # fmt: skip
        axis.axvline(100 * ratio, color="black", linewidth=0.8)
        axis.set_title(name)
        axis.set_ylabel("mean difference")
        axis.legend(fontsize=7)
    axes[-1, 0].set_xlabel(f"candidate ratio, % (line: true, {100 * ratio:.0f} %)")
    return figure


@styled
def function_space(ratios: np.ndarray, curves: np.ndarray, space, t_s: np.ndarray):
    """QQ against the ratio at some moments with the fitted functions (a `FunctionSpace`)."""
    figure, axes = canvas(1, height_in=2.8)
    axis = axes[0, 0]
    fine = np.linspace(0, 1, 51)
    chosen = np.linspace(0, space.moments.size - 1, 7).astype(int)[1:]
    for colour, k in zip((COAL, ACCENT, GANGUE, PALE, "#88b04b", "#c06c84"), chosen, strict=False):
        axis.plot(100 * fine, space(np.full(fine.size, k), fine), color=colour)
        axis.plot(100 * ratios, curves[:, space.moments[k]], "o", color=colour, markersize=3,
                  label=f"{1e3 * t_s[space.moments[k]]:.1f} ms")  # fmt: skip
    axis.set_xlabel(RATIO_LABEL)
    axis.set_ylabel("fusion parameter QQ")
    axis.legend(ncols=2)
    return figure


@styled
def recognised(ratios: np.ndarray, answers: dict[str, dict[str, list[float | None]]]):
    """Error of recognition against the true ratio, points; answers: {training: {method: ratios or None}}."""
    figure, axes = canvas(len(answers), height_in=2.0 * len(answers) + 0.4, sharex=True, sharey=True)
    for axis, (trained, methods) in zip(axes[:, 0], answers.items(), strict=True):
        axis.axhline(0, color=PALE, linewidth=0.8)
        for mark, colour, (name, values) in zip("os^Dv", (ACCENT, GANGUE, COAL, PALE, "#88b04b"), methods.items(),
                                                strict=False):  # fmt: skip
            points = [(100 * r, 100 * (v - r)) for r, v in zip(ratios, values, strict=True) if v is not None]
            if points:
                axis.plot(*zip(*points, strict=True), mark, color=colour, markersize=4, label=name)
        axis.set_title(trained)
        axis.set_ylabel("error, points")
    axes[0, 0].legend(fontsize=7)
    axes[-1, 0].set_xlabel("true " + RATIO_LABEL)
    return figure
