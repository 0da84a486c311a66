"""Pictures of signal analysis and recognition: Figures 22-38 of the paper."""

from __future__ import annotations

from analysis.hilbert import hilbert_spectrum, marginal_spectrum
from recognition.methods import EVALUATED, METHODS
from recognition.models import Model
from recognition.paper.pipeline import FusionPipeline
from report.chapters.picture import Plan
from report.figures import evaluation as figures_evaluation
from report.figures import signals as figures_signals
from report.figures import style as figures

RESPONSE_LABELS = {
    "u_m": "displacement, m",
    "v_m_s": "velocity, m/s",
    "a_m_s2": "acceleration, m/s²",
    "total_J": "total energy, J",
    "kinetic_J": "kinetic energy, J",
    "internal_J": "internal energy, J",
}


def imfs(study):
    chosen = sorted({0, len(study.runs) - 1})
    return figures_signals.imfs(
        study.t_s, {f"{100 * study.ratios[i]:.0f} %": study.decompositions[i].imfs for i in chosen}
    )


def hilbert(study):
    first = hilbert_spectrum(study.decompositions[-1], bin_width_Hz=50.0, times=134)
    marginal = {r: marginal_spectrum(d) for r, d in zip(study.ratios, study.decompositions, strict=True)}
    return figures_signals.hilbert_map(first, marginal, figures.ratio_colour)


def parameters(study):
    labels = {
        "square_root_amplitude": "square root amplitude, m/s²",
        "absolute_mean": "absolute mean, m/s²",
        "mean": "mean, m/s²",
        "variance": "variance, (m/s²)²",
        "peak_to_peak": "peak to peak, m/s²",
        "rms": "RMS, m/s²",
        "waveform_index": "waveform index",
        "kurtosis_index": "kurtosis index",
        "skewness_raw": "skewness (raw), (m/s²)³",
        "margin_index": "margin index",
        "marginal_spectrum_energy": "marginal spectrum, (m/s²)² s",
    }
    energies = study.imf_energies[:, :3].T
    panels = [("energy of IMF 1-3, (m/s²)² s", {f"IMF {k}": row for k, row in enumerate(energies, 1)})]
    panels += [(label, {label: study.parameters[name]}) for name, label in labels.items()]
    return figures.against_ratio(study.ratios, panels)


def rules(study):
    return figures_signals.rule_costs(study.rule_costs)


def q(study):
    fit = study.fusion_q.fit_
    c = fit.coefficients
    note = f"{c[0]:.4f} {c[1]:+.4f}β {c[2]:+.4f}β², R² {fit.r2:.4f}, adjusted {fit.r2_adjusted:.4f}"
    return figures_signals.q_against_ratio(study.ratios, study.q, c, note)


def _coal_run(study):
    return study.runs.index(study.nearest(0.0))


def kalman(study):
    i = _coal_run(study)
    panels = [(label, study.sweep.stack(n)[i], study.filtered[n][i]) for n, label in RESPONSE_LABELS.items()]
    return figures_signals.before_after(study.t_s, panels), f"Run of {study.ratios[i]:.0%}."


def total_energy(study):
    panels = [("before, J", study.sweep.stack("total_J")), ("after, J", study.filtered["total_J"])]
    return figures.curves(study.t_s, panels, study.ratios)


def filtered(study):
    panels = [(label, study.filtered[n]) for n, label in RESPONSE_LABELS.items() if n != "total_J"]
    return figures.curves(study.t_s, panels, study.ratios)


def normalised(study):
    fusion = study.fusions["energy"]
    row = list(fusion.names).index("total_J")
    values = fusion.normalised(study.responses("energy"))[:, row]
    return figures.curves(study.t_s, [("normalised total energy", values)], study.ratios)


def process(study):
    i, panels = _coal_run(study), []
    for kind, fusion in study.fusions.items():
        parts = dict(zip(fusion.names, fusion.normalised(study.responses(kind)[i]), strict=True))
        panels.append((kind, parts, study.fused[kind][i]))
    return figures_signals.fusion_process(study.t_s, panels), f"Run of {study.ratios[i]:.0%}."


def fused(study):
    return figures.curves(study.t_s, list(study.fused.items()), study.ratios)


def function_space(study):
    method = study.model.methods["energy_fusion_modified"]
    n = study.model.window.n_samples
    curves = method.transform(study.responses("energy")[:, :, :n])
    return figures_signals.function_space(study.ratios, curves, method.strategy.space_, study.t_s)


def worked_example(study):
    """The run nearest to 40 %, by models fitted without its ratio."""
    run = study.nearest(0.4)
    rest = [other for other in study.runs if other.gangue_ratio != run.gangue_ratio]
    model = Model.fit(rest)
    table = model.window.cut(run.signals, str(run.path))
    tables = {
        METHODS[name].title: method.strategy.candidates(method.transform(method.prepare(table)))
        for name, method in model.methods.items()
        if isinstance(method, FusionPipeline)
    }
    return figures_signals.worked_example(
        run.gangue_ratio, tables
    ), f"Run of {run.gangue_ratio:.0%}, held out."


def recognised(study):
    answers = {
        trained: {
            entry.title: [None if row[method].reason else row[method].ratio for row in rows]
            for method, entry in METHODS.items()
        }
        for trained, rows in study.answers.items()
    }
    return figures_signals.recognised(study.ratios, answers)


def unseen(study):
    noises = {"no noise": None, "noise of 20 dB": 20.0}
    best = tuple(name for name, entry in EVALUATED.items() if entry.gives_interval and name not in figures_evaluation.MARKS)
    return figures_evaluation.evaluation(
        study.evaluation, {name: entry.title for name, entry in EVALUATED.items()}, best, noises)


SIGNALS = [
    Plan("fig-22", "IMFs of the acceleration (Figure 22)", "Their number differs from ratio to ratio; the maxima of IMF"
         " 1 rise, the others show no pattern.", "Lowest and highest ratio. Rule: ten siftings an IMF.", imfs),
    Plan("fig-hilbert", "Hilbert and marginal spectrum", "Used for the marginal spectrum's energy in Figure 23.",
         "Above: highest ratio. Below: all ratios, bins of 25 Hz.", hilbert),
    Plan("fig-23", "Time-frequency parameters (Figure 23)", "Square root amplitude, absolute mean, variance, peak to"
         " peak, RMS and marginal spectrum rise; skewness and margin index fall; IMF energies, mean, waveform and"
         " kurtosis index are disorderly.", "Formulas: docs/analysis.md.", parameters),
    Plan("fig-rules", "Cost of the EMD stopping rules", "Not in the paper.", "AM-FM mode of 900 Hz plus tone of 110 Hz at 6667"
         " Hz; 267, 4000 and 20000 samples. Up to 10000 samples extrema are vertices of parabolas, beyond it samples.", rules),
]  # fmt: skip
RECOGNITION = [
    Plan("fig-24", "Fused parameter Q (Figure 24)", "Rises gradually; quadratic 0.00614 + 0.79954β + 0.15488β² with"
         " R² 0.99079 (the adjusted one).", "Eight parameters by Eq. 39, equal weights.", q),
    Plan("fig-25", "Kalman filter of six responses (Figure 25)", "Fluctuation and amplitude become smaller.",
         "Random walk, q/r = 0.1.", kalman),
    Plan("fig-26", "Total energy before and after (Figure 26)", "More clearly stratified after; the peaks of 90 and"
         " 100 % cross in part.", "", total_energy),
    Plan("fig-27", "The other responses after the filter (Figure 27)", "Energies stratified; amplitudes of"
         " acceleration, velocity and displacement not monotone.", "", filtered),
    Plan("fig-28", "Normalised total energy (Figure 28)", "By Eq. 41 over all eleven ratios.", "", normalised),
    Plan("fig-29", "Fusion of normalised responses (Figures 29-32)", "The fused signal lies among its parts and is"
         " calmer.", "", process),
    Plan("fig-33", "After fusion (Figures 33-36)", "Maxima rise with the ratio; energy fusion has a single peak, is"
         " calmest and best stratified.", "Energy, other, absolute, composite.", fused),
    Plan("fig-37", "Function space (Figure 37, left)", "At each moment a polynomial of QQ against the ratio.",
         "Degree 2 at six of the moments.", function_space),
    Plan("fig-38", "Worked example (Figures 37, 38)", "Each moment's root is a candidate; the smallest mean difference"
         " wins.", "", worked_example),
    Plan("fig-recognised", "Recognised ratio", "The strategy greatly improves on Q; the paper reports no test on unseen"
         " data.", "Trained on all: the run itself was in the training.", recognised),
]  # fmt: skip
UNSEEN = [
    Plan("fig-unseen", "Runs that were not trained on", "Not in the paper.", "Mean absolute error of the data set beside"
         " this sweep; whole arrangements, packings, speeds, dampings held out.", unseen),
]  # fmt: skip
