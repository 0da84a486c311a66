"""The chapter of recognition: Figures 24 to 38 of the paper."""

from __future__ import annotations

import numpy as np

from report.drawing.figure_spec import Drawn, FigureSpec
from report.drawing.lines import curves
from report.recognition import figures
from report.recognition.results import FUSION_Q, HELD_OUT, LEADING_METHODS, MODEL_METHODS
from report.recognition.tables import DEVIATIONS, ERRORS, RECOGNISED, STANDARDISED
from report.sweep_results import SweepResults

#: Label and unit of each response.
RESPONSES = {
    "u_m": ("displacement, µm", 1e6),
    "v_m_s": ("velocity, m/s", 1.0),
    "a_m_s2": ("acceleration, m/s²", 1.0),
    "total_J": ("total energy, J", 1.0),
    "kinetic_J": ("kinetic energy, J", 1.0),
    "internal_J": ("internal energy, J", 1.0),
}


def q_against_ratio(results: SweepResults) -> Drawn:
    fit = results.recognition.q_fit
    c = fit.coefficients
    note = f"Line: {c[0]:.4f} {c[1]:+.4f}β {c[2]:+.4f}β², R² {fit.r2:.4f}, adjusted {fit.r2_adjusted:.4f}."
    return figures.q_against_ratio(results.ratios, results.recognition.q, c), note


def kalman_filter(results: SweepResults) -> Drawn:
    i, filtered = results.index_nearest(0.0), results.recognition.filtered
    panels = [(label, unit * results.sweep.stack(name)[i], unit * filtered[name][i])
              for name, (label, unit) in RESPONSES.items()]
    return figures.before_after(results.t_s, panels), f"Run of {100 * results.ratios[i]:.0f} %."


def total_energy(results: SweepResults) -> Drawn:
    panels = [("before, J", results.sweep.stack("total_J")), ("after, J", results.recognition.filtered["total_J"])]
    return curves(results.t_s, panels, results.ratios)


def filtered_responses(results: SweepResults) -> Drawn:
    filtered = results.recognition.filtered
    panels = [(label, unit * filtered[name]) for name, (label, unit) in RESPONSES.items() if name != "total_J"]
    return curves(results.t_s, panels, results.ratios)


def normalised_energy(results: SweepResults) -> Drawn:
    values = results.recognition.normalised_inputs("energy")["total_J"]
    return curves(results.t_s, [("normalised total energy", values)], results.ratios)


def fusion_process(results: SweepResults) -> Drawn:
    i, panels = results.index_nearest(0.0), []
    for kind, fused in results.recognition.fused.items():
        inputs = {name: values[i] for name, values in results.recognition.normalised_inputs(kind).items()}
        panels.append((kind, inputs, fused[i]))
    return figures.fusion_process(results.t_s, panels), f"Run of {100 * results.ratios[i]:.0f} %."


def fused_responses(results: SweepResults) -> Drawn:
    return curves(results.t_s, list(results.recognition.fused.items()), results.ratios)


def function_space(results: SweepResults) -> Drawn:
    fits = results.recognition.moment_fits(6)
    return figures.function_space(results.ratios, fits.measured, fits.t_s, fits.fine_ratios, fits.fitted)


def worked_example(results: SweepResults) -> Drawn:
    index = results.index_nearest(0.4)
    ratio, candidates = results.ratios[index], results.recognition.candidates(index)
    methods = {name: (c.ratio, c.difference, c.allowed) for name, c in candidates.items()}
    return figures.worked_example(ratio, methods), f"Run of {100 * ratio:.0f} %, held out."


def recognised_against_true(results: SweepResults) -> Drawn:
    rows, leading = results.recognition.answers[HELD_OUT], results.recognition.leading_of(LEADING_METHODS)
    second = next(name for name in LEADING_METHODS if name != leading)
    with_interval = {
        MODEL_METHODS[name]: np.array([(row[name].ratio, row[name].low, row[name].high) for row in rows])
        for name in (leading, second)
    }
    of_q = {MODEL_METHODS[FUSION_Q]: np.array([row[FUSION_Q].ratio for row in rows])}
    return figures.recognised_against_true(results.ratios, with_interval, of_q)


def recognised_ratios(results: SweepResults) -> Drawn:
    answers: dict[str, dict[str, list[float | None]]] = {}
    for training, rows in results.recognition.answers.items():
        answers[training] = {
            label: [None if row[method].reason else row[method].ratio for row in rows]
            for method, label in MODEL_METHODS.items()
        }
    return figures.recognition_errors(results.ratios, answers)


ANSWER = FigureSpec("fig-answer", "Recognised against true mixing ratio",
                    "By models trained on the other ratios of this sweep, where gangue takes its places in one "
                    "order. Other arrangements and packings are a harder test: gangue evaluate, on a data set.",
                    recognised_against_true, ratios=4)

RECOGNITION_TABLES = [STANDARDISED, DEVIATIONS, ERRORS, RECOGNISED]

RECOGNITION_FIGURES = [
    FigureSpec("fig-24", "Fused parameter Q", "Eight parameters by Eq. 39, equal weights.", q_against_ratio, ratios=4),
    FigureSpec("fig-25", "Kalman filter of six responses", "Random walk, q/r = 0.1. Grey: before, blue: after.",
               kalman_filter, ratios=4),
    FigureSpec("fig-26", "Total energy before and after", "One curve a ratio.", total_energy, ratios=4),
    FigureSpec("fig-27", "The other responses after the filter", "One curve a ratio.", filtered_responses, ratios=4),
    FigureSpec("fig-28", "Normalised total energy", "Normalised over all ratios.", normalised_energy, ratios=4),
    FigureSpec("fig-29", "Fusion of normalised responses",
               "Thin: the responses of which each is fused; thick: fused.", fusion_process, ratios=4),
    FigureSpec("fig-33", "After fusion", "One curve a ratio.", fused_responses, ratios=4),
    FigureSpec("fig-37", "Function space", "Degree 2 at six of the moments.", function_space, ratios=4),
    FigureSpec("fig-38", "Worked example",
               "The candidate with the least mean difference is the answer.", worked_example, ratios=4),
    FigureSpec("fig-recognised", "Recognised ratio",
               "Trained on all: the run itself was in the training.", recognised_ratios, ratios=4),
]
