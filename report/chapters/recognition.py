"""The chapter of recognition: Figures 24 to 38 of the paper."""

from __future__ import annotations

from report.chapters.figure_spec import Drawn, FigureSpec
from report.figures import recognition as figures
from report.figures.lines import curves
from report.results.methods import MODEL_METHODS
from report.results.sweep_results import SweepResults

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


def recognised_ratios(results: SweepResults) -> Drawn:
    answers: dict[str, dict[str, list[float | None]]] = {}
    for training, rows in results.recognition.answers.items():
        answers[training] = {
            label: [answer if isinstance(answer := row[method], float) else None for row in rows]
            for method, label in MODEL_METHODS.items()
        }
    return figures.recognition_errors(results.ratios, answers)


RECOGNITION_FIGURES = [
    FigureSpec("fig-24", "Fused parameter Q (Figure 24)", "Rises gradually; quadratic 0.00614 + 0.79954β + 0.15488β²"
               " with R² 0.99079 (the adjusted one).", "Eight parameters by Eq. 39, equal weights.", q_against_ratio),
    FigureSpec("fig-25", "Kalman filter of six responses (Figure 25)", "Fluctuation and amplitude become smaller.",
               "Random walk, q/r = 0.1.", kalman_filter),
    FigureSpec("fig-26", "Total energy before and after (Figure 26)", "More clearly stratified after; the peaks of 90"
               " and 100 % cross in part.", "", total_energy),
    FigureSpec("fig-27", "The other responses after the filter (Figure 27)", "Energies stratified; amplitudes of"
               " acceleration, velocity and displacement not monotone.", "", filtered_responses),
    FigureSpec("fig-28", "Normalised total energy (Figure 28)", "By Eq. 41 over all eleven ratios.", "",
               normalised_energy),
    FigureSpec("fig-29", "Fusion of normalised responses (Figures 29-32)", "The fused signal lies among its parts and is"
               " calmer.", "", fusion_process),
    FigureSpec("fig-33", "After fusion (Figures 33-36)", "Maxima rise with the ratio; energy fusion has a single peak,"
               " is calmest and best stratified.", "Energy, other, absolute, composite.", fused_responses),
    FigureSpec("fig-37", "Function space (Figure 37, left)", "At each moment a polynomial of QQ against the ratio.",
               "Degree 2 at six of the moments.", function_space),
    FigureSpec("fig-38", "Worked example (Figures 37, 38)", "Each moment's root is a candidate; the smallest mean"
               " difference wins.", "", worked_example),
    FigureSpec("fig-recognised", "Recognised ratio", "The strategy greatly improves on Q; the paper reports no test on"
               " unseen data.", "Trained on all: the run itself was in the training.", recognised_ratios),
]  # fmt: skip
