"""The chapter of recognition: Figures 24 to 38 of the paper."""

from __future__ import annotations

import numpy as np

from report.drawing.figure_spec import Drawn, FigureSpec
from report.drawing.lines import curves
from report.recognition import figures
from report.recognition.results import FUSION_Q, HELD_OUT, MODEL_METHODS, MODEL_METHODS_WITH_INTERVAL
from report.sweep_results import SweepResults

RESPONSE_LABELS = {
    "u_m": "displacement, m",
    "v_m_s": "velocity, m/s",
    "a_m_s2": "acceleration, m/s²",
    "total_J": "total energy, J",
    "kinetic_J": "kinetic energy, J",
    "internal_J": "internal energy, J",
}


def q_against_ratio(results: SweepResults) -> Drawn:
    fit = results.recognition.q_fit
    c = fit.coefficients
    label = f"{c[0]:.4f} {c[1]:+.4f}β {c[2]:+.4f}β², R² {fit.r2:.4f}, adjusted {fit.r2_adjusted:.4f}"
    return figures.q_against_ratio(results.ratios, results.recognition.q, c, label)


def kalman_filter(results: SweepResults) -> Drawn:
    i, filtered = results.index_nearest(0.0), results.recognition.filtered
    panels = [(label, results.sweep.stack(name)[i], filtered[name][i]) for name, label in RESPONSE_LABELS.items()]
    return figures.before_after(results.t_s, panels), f"Run of {results.ratios[i]:.0%}."


def total_energy(results: SweepResults) -> Drawn:
    panels = [("before, J", results.sweep.stack("total_J")), ("after, J", results.recognition.filtered["total_J"])]
    return curves(results.t_s, panels, results.ratios)


def filtered_responses(results: SweepResults) -> Drawn:
    filtered = results.recognition.filtered
    panels = [(label, filtered[name]) for name, label in RESPONSE_LABELS.items() if name != "total_J"]
    return curves(results.t_s, panels, results.ratios)


def normalised_energy(results: SweepResults) -> Drawn:
    values = results.recognition.normalised_inputs("energy")["total_J"]
    return curves(results.t_s, [("normalised total energy", values)], results.ratios)


def fusion_process(results: SweepResults) -> Drawn:
    i, panels = results.index_nearest(0.0), []
    for kind, fused in results.recognition.fused.items():
        inputs = {name: values[i] for name, values in results.recognition.normalised_inputs(kind).items()}
        panels.append((kind, inputs, fused[i]))
    return figures.fusion_process(results.t_s, panels), f"Run of {results.ratios[i]:.0%}."


def fused_responses(results: SweepResults) -> Drawn:
    return curves(results.t_s, list(results.recognition.fused.items()), results.ratios)


def function_space(results: SweepResults) -> Drawn:
    fits = results.recognition.moment_fits(6)
    return figures.function_space(results.ratios, fits.measured, fits.t_s, fits.fine_ratios, fits.fitted)


def worked_example(results: SweepResults) -> Drawn:
    index = results.index_nearest(0.4)
    ratio, candidates = results.ratios[index], results.recognition.candidates(index)
    methods = {name: (c.ratio, c.difference, c.allowed) for name, c in candidates.items()}
    return figures.worked_example(ratio, methods), f"Run of {ratio:.0%}, held out."


def recognised_against_true(results: SweepResults) -> Drawn:
    rows, leading = results.recognition.answers[HELD_OUT], results.recognition.leading_method
    second = next(name for name in MODEL_METHODS_WITH_INTERVAL if name != leading)
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


ANSWER = FigureSpec(
    key="fig-answer",
    title="Recognised against true mixing ratio",
    in_paper="The paper reports no test on unseen data.",
    caption=(
        "By models trained on the other ratios of this sweep, where gangue takes its places in one order. Other"
        " arrangements and packings are a harder test: gangue evaluate, on a data set."
    ),
    draw=recognised_against_true,
)

RECOGNITION_FIGURES = [
    FigureSpec(
        key="fig-24",
        title="Fused parameter Q (Figure 24)",
        in_paper="Rises gradually; quadratic 0.00614 + 0.79954β + 0.15488β² with R² 0.99079 (the adjusted one).",
        caption="Eight parameters by Eq. 39, equal weights.",
        draw=q_against_ratio,
    ),
    FigureSpec(
        key="fig-25",
        title="Kalman filter of six responses (Figure 25)",
        in_paper="Fluctuation and amplitude become smaller.",
        caption="Random walk, q/r = 0.1.",
        draw=kalman_filter,
    ),
    FigureSpec(
        key="fig-26",
        title="Total energy before and after (Figure 26)",
        in_paper="More clearly stratified after; the peaks of 90 and 100 % cross in part.",
        caption="",
        draw=total_energy,
    ),
    FigureSpec(
        key="fig-27",
        title="The other responses after the filter (Figure 27)",
        in_paper="Energies stratified; amplitudes of acceleration, velocity and displacement not monotone.",
        caption="",
        draw=filtered_responses,
    ),
    FigureSpec(
        key="fig-28",
        title="Normalised total energy (Figure 28)",
        in_paper="By Eq. 41 over all eleven ratios.",
        caption="",
        draw=normalised_energy,
    ),
    FigureSpec(
        key="fig-29",
        title="Fusion of normalised responses (Figures 29-32)",
        in_paper="The fused signal lies among its parts and is calmer.",
        caption="",
        draw=fusion_process,
    ),
    FigureSpec(
        key="fig-33",
        title="After fusion (Figures 33-36)",
        in_paper="Maxima rise with the ratio; energy fusion has a single peak, is calmest and best stratified.",
        caption="Energy, other, absolute, composite.",
        draw=fused_responses,
    ),
    FigureSpec(
        key="fig-37",
        title="Function space (Figure 37, left)",
        in_paper="At each moment a polynomial of QQ against the ratio.",
        caption="Degree 2 at six of the moments.",
        draw=function_space,
    ),
    FigureSpec(
        key="fig-38",
        title="Worked example (Figures 37, 38)",
        in_paper="Each moment's root is a candidate; the smallest mean difference wins.",
        caption="",
        draw=worked_example,
    ),
    FigureSpec(
        key="fig-recognised",
        title="Recognised ratio",
        in_paper="The strategy greatly improves on Q; the paper reports no test on unseen data.",
        caption="Trained on all: the run itself was in the training.",
        draw=recognised_ratios,
    ),
]
