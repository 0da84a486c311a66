"""The figures of recognition, Figures 24 to 38 of the paper, and its tables."""

from itertools import cycle

import numpy as np

from analysis.signals.features import BASE_PARAMETERS
from report.drawing.figure_spec import Drawn, figure
from report.drawing.lines import curves
from report.drawing.style import ACCENT, COAL, GANGUE, GREEN, PALE, RATIO_LABEL, ROSE, VIOLET, YELLOW, canvas, single
from report.recognition.results import FUSION_Q, HELD_OUT, LEADING_METHODS, MODEL_METHODS, Recognition
from report.response import MOTIONS
from report.sweep_results import SweepResults
from report.tables import Cells, table

NO_BREAK = "\u00a0"  # a space at which "3 of 11" does not break into two lines

#: Label and unit of each response.
LABELS = {name: (label, unit) for label, name, unit in MOTIONS} | {
    f"{name}_J": (f"{name} energy, J", 1.0) for name in ("total", "kinetic", "internal")}


@figure("fig-answer", "Recognised against true mixing ratio",
        "By models trained on the other ratios of this sweep, where gangue takes its places in one order. Other "
        "arrangements and packings are a harder test: gangue evaluate, on a data set.")
def recognised_against_true(results: SweepResults) -> Drawn:
    """With 90 % intervals where a method gives them, the method that answers most in front."""
    rows, leading = results.of(Recognition).answers[HELD_OUT], results.of(Recognition).leading_of(LEADING_METHODS)
    second = next(name for name in LEADING_METHODS if name != leading)
    (figure, axis), true = single(3.7), 100 * results.ratios
    axis.plot([0, 100], [0, 100], color=PALE, linewidth=0.9, label="_true")
    axis.plot(true - 1.2, 100 * np.array([row[FUSION_Q].ratio for row in rows]), "s", color=COAL, markersize=4.5,
              fillstyle="none", label=MODEL_METHODS[FUSION_Q])
    for aside, mark, colour, name in ((1.2, "D", GANGUE, second), (0.0, "o", ACCENT, leading)):
        middle, low, high = 100 * np.array([(row[name].ratio, row[name].low, row[name].high) for row in rows]).T
        if np.isnan(middle).all():
            continue
        axis.vlines(true + aside, low, high, color=colour, linewidth=4, alpha=0.35)
        axis.plot(true + aside, middle, mark, color=colour, markersize=5, label=f"{MODEL_METHODS[name]}, 90 % interval")
    axis.set(xlabel="true " + RATIO_LABEL, ylabel="recognised, %", xlim=(-4, 104))
    axis.legend(loc="upper left")
    return figure


@figure("fig-24", "Fused parameter Q", "Eight parameters by Eq. 39, equal weights.")
def q_against_ratio(results: SweepResults) -> Drawn:
    fit = results.of(Recognition).q_fit
    c, fine = fit.coefficients, np.linspace(0, 1, 101)
    figure, axis = single(2.8)
    axis.plot(100 * fine, np.polynomial.polynomial.polyval(fine, c), color=ACCENT, label="fitted")
    axis.plot(100 * results.ratios, results.of(Recognition).q, "o", color=GANGUE, label="runs")
    axis.set(xlabel=RATIO_LABEL, ylabel="fused parameter Q")
    axis.legend()
    return figure, f"Line: {c[0]:.4f} {c[1]:+.4f}β {c[2]:+.4f}β², R² {fit.r2:.4f}, adjusted {fit.r2_adjusted:.4f}."


@figure("fig-25", "Kalman filter of six responses", "Random walk, q/r = 0.1. Grey: before, blue: after.")
def kalman_filter(results: SweepResults) -> Drawn:
    i, filtered = results.index_nearest(0.0), results.of(Recognition).filtered
    figure, axes = canvas(3, 2, height_in=5.1, sharex=True)
    for axis, (name, (label, unit)) in zip(axes.ravel(), LABELS.items(), strict=True):
        axis.plot(1e3 * results.t_s, unit * results.sweep.stack(name)[i], color=PALE, linewidth=0.8, label="before")
        axis.plot(1e3 * results.t_s, unit * filtered[name][i], color=ACCENT, linewidth=1.0, label="after")
        axis.set_title(label)
    for axis in axes[-1]:
        axis.set_xlabel("time, ms")
    return figure, f"Run of {100 * results.ratios[i]:.0f} %."


@figure("fig-26", "Total energy before and after", "One curve a ratio.")
def total_energy(results: SweepResults) -> Drawn:
    panels = [("before, J", results.sweep.stack("total_J")), ("after, J", results.of(Recognition).filtered["total_J"])]
    return curves(results.t_s, panels, results.ratios)


@figure("fig-27", "The other responses after the filter", "One curve a ratio.")
def filtered_responses(results: SweepResults) -> Drawn:
    filtered = results.of(Recognition).filtered
    panels = [(label, unit * filtered[name]) for name, (label, unit) in LABELS.items() if name != "total_J"]
    return curves(results.t_s, panels, results.ratios)


@figure("fig-28", "Normalised total energy", "Normalised over all ratios.")
def normalised_energy(results: SweepResults) -> Drawn:
    values = results.of(Recognition).normalised_inputs("energy")["total_J"]
    return curves(results.t_s, [("normalised total energy", values)], results.ratios)


@figure("fig-29", "Fusion of normalised responses", "Thin: the responses of which each is fused; thick: fused.")
def fusion_process(results: SweepResults) -> Drawn:
    i, fusions = results.index_nearest(0.0), results.of(Recognition).fused
    inputs = {kind: results.of(Recognition).normalised_inputs(kind) for kind in fusions}
    figure, axes = canvas(len(fusions) + 1, height_in=1.4 * len(fusions) + 1.4, sharex=True)
    names = dict.fromkeys(name for responses in inputs.values() for name in responses)
    colours = dict(zip(names, cycle((GANGUE, PALE, GREEN, ROSE, VIOLET, YELLOW, ACCENT)), strict=False))
    *drawn, below = axes[:, 0]
    for axis, (kind, fused) in zip(drawn, fusions.items(), strict=True):
        for name, values in inputs[kind].items():
            axis.plot(1e3 * results.t_s, values[i], color=colours[name], linewidth=0.6, label=name)
        axis.plot(1e3 * results.t_s, fused[i], color="black", linewidth=1.2, label="fused")
        axis.set_title(f"{kind} fusion")
    drawn[-1].set_xlabel("time, ms")
    drawn[-1].tick_params(labelbottom=True)
    below.set_axis_off()
    known = {line.get_label(): line for axis in drawn for line in axis.get_lines()}
    below.legend(known.values(), known, ncols=3, loc="center")
    return figure, f"Run of {100 * results.ratios[i]:.0f} %."


@figure("fig-33", "After fusion", "One curve a ratio.")
def fused_responses(results: SweepResults) -> Drawn:
    return curves(results.t_s, list(results.of(Recognition).fused.items()), results.ratios)


@figure("fig-37", "Function space", "Degree 2 at six of the moments.")
def function_space(results: SweepResults) -> Drawn:
    fine = np.linspace(0, 1, 51)
    figure, axis = single(2.8)
    colours = (COAL, ACCENT, GANGUE, PALE, GREEN, ROSE)
    for colour, (moment_s, points, line) in zip(colours, results.of(Recognition).moment_fits(6, fine), strict=True):
        axis.plot(100 * fine, line, color=colour)
        axis.plot(100 * results.ratios, points, "o", color=colour, markersize=3, label=f"{1e3 * moment_s:.1f} ms")
    axis.set(xlabel=RATIO_LABEL, ylabel="fusion parameter QQ")
    axis.legend(ncols=2)
    return figure


@figure("fig-38", "Worked example", "The candidate with the least mean difference is the answer.")
def worked_example(results: SweepResults) -> Drawn:
    index = results.index_nearest(0.4)
    true, methods = 100 * results.ratios[index], results.of(Recognition).candidates(index)
    figure, axes = canvas(len(methods), height_in=2.0 * len(methods) + 0.4, sharex=True)
    for axis, (name, found) in zip(axes[:, 0], methods.items(), strict=True):
        percent, difference, allowed = 100 * found.ratio, found.score, found.allowed
        axis.plot(percent, difference, ".", color=PALE, markersize=3, label="not enough usable points")
        axis.plot(percent[allowed], difference[allowed], ".", color=ACCENT, markersize=3, label="candidates")
        if allowed.any():
            best = found.best
            axis.plot(percent[best], difference[best], "o", color=GANGUE, label=f"answer {percent[best]:.2f} %")
        axis.axvline(true, color="black", linewidth=0.8)
        axis.set(title=name, ylabel="mean difference")
        axis.yaxis.set_major_formatter("{x:.3g}")
        axis.legend()
    axes[-1, 0].set_xlabel(f"candidate ratio, % (line: true, {true:.0f} %)")
    return figure, f"Run of {true:.0f} %, held out."


@figure("fig-recognised", "Recognised ratio", "Trained on all: the run itself was in the training.")
def recognised_ratios(results: SweepResults) -> Drawn:
    answers = results.of(Recognition).answers
    figure, axes = canvas(len(answers), height_in=2.0 * len(answers) + 0.4, sharex=True, sharey=True)
    for axis, (training, rows) in zip(axes[:, 0], answers.items(), strict=True):
        axis.axhline(0, color=PALE, linewidth=0.8)
        looks = zip("os^Dv", (ACCENT, GANGUE, COAL, PALE, GREEN), MODEL_METHODS.items(), strict=False)
        for mark, colour, (method, name) in looks:
            points = [(100 * ratio, 100 * (row[method].ratio - ratio))
                      for ratio, row in zip(results.ratios, rows, strict=True) if not row[method].reason]
            if points:
                axis.plot(*zip(*points, strict=True), mark, color=colour, markersize=4, label=name)
        axis.set(title=training, ylabel="error, points")
    axes[0, 0].legend()
    axes[-1, 0].set_xlabel("true " + RATIO_LABEL)
    return figure


RECOGNITION_FIGURES = [q_against_ratio, kalman_filter, total_energy, filtered_responses, normalised_energy,
                       fusion_process, fused_responses, function_space, worked_example, recognised_ratios]


@table("table-2", "Standardised parameters", "By Eq. 39; the direction of each parameter is that of these runs.")
def standardised(results: SweepResults) -> Cells:
    values, falling = results.of(Recognition).standardised_base
    rows = [[name.replace("_", " ") + (" (falling)" if falls else ""), *(f"{v:.4f}" for v in column)]
            for name, falls, column in zip(BASE_PARAMETERS, falling, values.T, strict=True)]
    return ["", *_percent(results.ratios)], rows


@table("table-3", "Q and its quadratic")
def deviations(results: SweepResults) -> Cells:
    measured, calculated = results.of(Recognition).q, results.of(Recognition).q_quadratic(results.ratios)
    named = {"measured": measured, "calculated": calculated, "difference": calculated - measured}
    rows = [[name, *(f"{v:.5f}" for v in values)] for name, values in named.items()]
    return ["", *_percent(results.ratios)], rows


@table("table-recognised", "Recognised mixing ratio of each run",
       "In per cent, by models trained on the other ratios: 0 and 100 % are extrapolations, and nothing is clipped.")
def recognised(results: SweepResults) -> Cells:
    rows = [[true, *("no answer" if answers[method].reason else f"{100 * answers[method].ratio:.2f}"
                     for method in MODEL_METHODS)]
            for true, answers in zip(_percent(results.ratios), results.of(Recognition).answers[HELD_OUT], strict=True)]
    return ["true", *MODEL_METHODS.values()], rows


@table("table-errors", "Errors of recognition",
       "Points of mixing ratio. Trained on all: the run itself was in the training, so it tells how well a method "
       "describes its own data. That ratio held out: trained on the other ratios.")
def errors(results: SweepResults) -> Cells:
    found = results.of(Recognition)
    rows = [[name, training, *_error_cells(found.errors_points(training, method), len(results.runs))]
            for training in found.answers for method, name in MODEL_METHODS.items()]
    return ["method", "training", "answered", "mean", "worst"], rows


def _percent(ratios: np.ndarray) -> list[str]:
    return [f"{100 * r:.0f} %" for r in ratios]


def _error_cells(errors_points: np.ndarray, count: int) -> list[str]:
    """Return how many of `count` runs were answered, and the mean and the worst error."""
    size = np.abs(errors_points)
    numbers = [f"{size.mean():.2f}", f"{size.max():.2f}"] if size.size else ["-", "-"]
    return [f"{size.size}{NO_BREAK}of{NO_BREAK}{count}", *numbers]


RECOGNITION_TABLES = [standardised, deviations, errors, recognised]
