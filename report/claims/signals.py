"""Statements of Sections IV and V: time-frequency parameters, Kalman filter, fusion, recognition."""

from __future__ import annotations

import numpy as np

from analysis.runs import RESPONSES
from recognition.estimation.errors import RecognitionError
from recognition.paper.least_squares import fit_polynomial
from report.claims.trends import fluctuation, overlap, separation, spearman, stratification, travel
from report.claims.verdicts import (
    HELD,
    NOT_HELD,
    PARTLY,
    Statement,
    all_trends,
    disorderly,
    graded,
    needs_ratios,
    trend,
    trend_words,
)

ENERGY_NAMES = ("total_J", "kinetic_J", "internal_J")


def number_of_imfs_differs(study):
    counts = [len(d.imfs) for d in study.decompositions]
    return (HELD if len(set(counts)) > 1 else NOT_HELD), f"{min(counts)} to {max(counts)} IMFs"


def first_imf_rises(study):
    needs_ratios(study, study.ratios)
    first = [d.imfs[0] for d in study.decompositions]
    return all_trends({"up": np.array([f.max() for f in first]), "down": np.array([-f.min() for f in first])},
                      study.ratios)  # fmt: skip


def other_imfs_are_irregular(study):
    needs_ratios(study, study.ratios)
    common = min(len(d.imfs) for d in study.decompositions)
    if common < 2:
        raise RecognitionError("some run has one IMF only")
    rho = [
        abs(spearman(study.ratios, np.array([np.abs(d.imfs[k]).max() for d in study.decompositions])))
        for k in range(1, common)
    ]
    irregular = sum(r < 0.9 for r in rho)
    verdict = HELD if irregular == len(rho) else PARTLY if irregular else NOT_HELD
    return verdict, f"|Spearman| of the maxima of IMF 2..{common}: {', '.join(f'{r:.2f}' for r in rho)}"


def rms_ratio(study):
    low, high = study.run_at(0.0), study.run_at(1.0)
    rms = study.parameters["rms"]
    value = rms[study.runs.index(high)] / rms[study.runs.index(low)]
    return graded(abs(value / 1.764 - 1), 0.05, 0.2), f"{value:.3f}"


def q_is_quadratic(study):
    needs_ratios(study, study.q)
    fit = fit_polynomial(study.ratios, study.q, 2)
    if not np.isfinite(fit.r2_adjusted):
        raise RecognitionError(f"{len(study.ratios)} ratios; an adjusted R^2 needs more")
    c = fit.coefficients
    value = f"adjusted R^2 {fit.r2_adjusted:.5f}, Q = {c[0]:.5f} {c[1]:+.5f} b {c[2]:+.5f} b^2"
    return graded(fit.r2_adjusted, 0.99, 0.97), value


def q_deviates(study):
    needs_ratios(study, study.q)
    off = fit_polynomial(study.ratios, study.q, 2)(study.ratios) - study.q
    value = f"{np.abs(off).min():.4f} to {np.abs(off).max():.4f}"
    both = off.min() < 0 < off.max()
    return (HELD if both and np.abs(off).max() > 0.01 else PARTLY if both else NOT_HELD), value


def q_recognises_roughly(study):
    errors = np.abs(study.errors_points("that ratio held out", "fusion_q"))
    if errors.size == 0:
        raise RecognitionError("Q gives no answer at all")
    return graded(
        errors.max(), 3.0, 1.0
    ), f"held out: mean {errors.mean():.2f}, worst {errors.max():.2f} points"


# --------------------------------------------------------------------- Kalman


def filter_calms(study):
    calmer = {}
    for name in RESPONSES:
        before, after = study.sweep.stack(name), study.filtered[name]
        rough = np.mean([fluctuation(b) / fluctuation(a) for a, b in zip(before, after, strict=True)])
        calmer[name] = (rough, np.abs(after).max() / np.abs(before).max())
    held = all(rough < 1 and size < 1 for rough, size in calmer.values())
    words = ", ".join(f"{n} {a:.2f}/{b:.2f}" for n, (a, b) in calmer.items())
    return (HELD if held else PARTLY), f"after over before, fluctuation/amplitude: {words}"


def filtered_energy_is_clearer(study):
    needs_ratios(study, study.ratios)
    before = [overlap(study.sweep.stack(name)) for name in ENERGY_NAMES]
    after = [overlap(study.filtered[name]) for name in ENERGY_NAMES]
    better = sum(a < b for a, b in zip(after, before, strict=True))
    words = ", ".join(f"{n} {b:.4f} to {a:.4f}" for n, b, a in zip(ENERGY_NAMES, before, after, strict=True))
    return (HELD if better == 3 else PARTLY if better else NOT_HELD), f"overlap: {words}"


def filtered_peaks_cross_at_the_end(study):
    filtered = study.filtered["total_J"]
    i, j = (study.runs.index(study.run_at(r)) for r in (0.9, 1.0))
    peak = int(np.argmax(filtered[j]))
    window = slice(max(0, peak - 10), peak + 11)
    crossing = float(np.mean(filtered[j, window] <= filtered[i, window]))
    return (
        HELD if crossing > 0 else NOT_HELD
    ), f"crossed at {100 * crossing:.0f} % of 21 samples about the peak"


def filtered_motion_is_not_monotone(study):
    needs_ratios(study, study.ratios)
    against = {}
    for name in ("a_m_s2", "v_m_s", "u_m"):
        size = np.abs(study.filtered[name]).max(axis=1)
        against[name] = int(np.sum(np.diff(size) < 0))
    verdict = HELD if all(against.values()) else PARTLY if any(against.values()) else NOT_HELD
    return verdict, "steps against the rise: " + ", ".join(f"{n} {k}" for n, k in against.items())


# --------------------------------------------------------------------- fusion


def fused_maxima_rise(study):
    needs_ratios(study, study.ratios)
    start = {kind: curves[:, :1] for kind, curves in study.fused.items()}
    named = {kind: np.abs(study.fused[kind] - start[kind]).max(axis=1) for kind in study.fused}
    return all_trends(named, study.ratios)


def _until(study, end_s):
    return study.t_s <= end_s


def energy_fusion_is_stratified(study):
    needs_ratios(study, study.ratios)
    curves = study.fused["energy"][:, _until(study, 0.03)]
    value, crossed = stratification(study.ratios, curves), overlap(curves)
    return graded(
        value, 0.95, 0.8
    ), f"mean |Spearman| {value:.4f}, {100 * crossed:.2f} % of neighbours out of order"


def energy_fusion_has_one_peak(study):
    ways = {kind: float(np.mean([travel(c) for c in curves])) for kind, curves in study.fused.items()}
    words = ", ".join(f"{kind} {way:.2f}" for kind, way in ways.items())
    return graded(ways["energy"], 1.2, 2.0), f"way up and down over twice the range: {words}"


def energy_fusion_is_calmest(study):
    ways = {kind: float(np.mean([travel(c) for c in curves])) for kind, curves in study.fused.items()}
    least = min(ways, key=ways.__getitem__)
    verdict = HELD if least == "energy" else PARTLY if ways["energy"] < ways["composite"] else NOT_HELD
    return verdict, f"least volatile: {least}; energy {ways['energy']:.2f}, composite {ways['composite']:.2f}"


def energy_fusion_separates_best(study):
    needs_ratios(study, study.ratios)
    order = {kind: stratification(study.ratios, curves) for kind, curves in study.fused.items()}
    apart = {kind: separation(curves) for kind, curves in study.fused.items()}
    best = [max(order, key=order.__getitem__), max(apart, key=apart.__getitem__)]
    words = ", ".join(f"{kind} {order[kind]:.3f}/{apart[kind]:.3f}" for kind in order)
    verdict = HELD if best == ["energy"] * 2 else PARTLY if "energy" in best else NOT_HELD
    return verdict, f"stratification/separation: {words}"


def strategy_beats_q(study):
    held_out = "that ratio held out"
    q = np.abs(study.errors_points(held_out, "fusion_q"))
    if q.size == 0:
        raise RecognitionError("Q gives no answer")
    words, better = [f"Q {q.mean():.2f} ({q.size} of {len(study.runs)} answered)"], []
    for method in ("energy_fusion_as_published", "energy_fusion_modified"):
        e = np.abs(study.errors_points(held_out, method))
        if e.size:
            better.append(e.size == len(study.runs) and e.mean() < q.mean())
            words.append(f"{method.removeprefix('energy_fusion_')} {e.mean():.2f} ({e.size} of {len(study.runs)} answered)")
        else:
            better.append(False)
    verdict = HELD if all(better) else PARTLY if any(better) else NOT_HELD
    return verdict, f"mean error in points, held out: {', '.join(words)}"


def q_rises(study):
    ratios = needs_ratios(study, study.q)
    return graded(spearman(ratios, study.q), 0.9, 0.5), trend_words(ratios, study.q)


def _parameter(name):
    return lambda study: study.parameters[name]


def _rising(name, label, unit="m/s²"):
    return Statement(f"The {label} of the acceleration rises with the ratio as a whole", "Fig. 23", "fig-23",
                     "Spearman >= 0.9", trend(_parameter(name), 1, 1.0, unit))  # fmt: skip


def _falling(name, label):
    return Statement(f"The {label} of the acceleration falls with the ratio as a whole", "Fig. 23", "fig-23",
                     "Spearman <= -0.9", trend(_parameter(name), -1))  # fmt: skip


def _without_order(values, label):
    return Statement(f"The {label} of the acceleration changes without order", "Fig. 23", "fig-23",
                     "|Spearman| < 0.6; partly below 0.9", disorderly(values))  # fmt: skip


STATEMENTS = [
    Statement("The number of IMFs differs from ratio to ratio", "Fig. 22", "fig-22", "differs",
              number_of_imfs_differs),
    Statement("The maxima of IMF 1 rise in both directions", "Fig. 22", "fig-22", "Spearman >= 0.9 for both",
              first_imf_rises),
    Statement("The other IMFs show no regular pattern", "Fig. 22", "fig-22", "|Spearman| < 0.9 for each",
              other_imfs_are_irregular),
    _without_order(lambda study: study.imf_energies[:, 0] / study.imf_energies.sum(axis=1), "energy share of IMF 1"),
    _without_order(_parameter("mean"), "mean"),
    _without_order(_parameter("waveform_index"), "waveform index"),
    _without_order(_parameter("kurtosis_index"), "kurtosis index"),
    _rising("square_root_amplitude", "square root amplitude"),
    _rising("absolute_mean", "absolute mean"),
    _rising("variance", "variance", "(m/s²)²"),
    _rising("peak_to_peak", "peak-to-peak value"),
    _rising("rms", "RMS"),
    _rising("marginal_spectrum_energy", "energy of the marginal spectrum", "(m/s²)² s"),
    _falling("skewness_raw", "skewness"),
    _falling("margin_index", "margin index"),
    Statement("The RMS of the acceleration grows by 1.764 from 0 to 100 % (implied by Table 2)", "Table 2", "fig-23",
              "1.764 within 5 %; partly within 20 %", rms_ratio),
    Statement("Q rises gradually with the ratio", "Fig. 24", "fig-24", "Spearman >= 0.9", q_rises),
    Statement("A quadratic describes Q: R^2 0.99079 (adjusted)", "Fig. 24", "fig-24", "0.99 or more; partly from 0.97",
              q_is_quadratic),
    Statement("Q deviates from the quadratic by 0.006 to 0.046, to both sides", "Table 3", "table-3",
              "to both sides, above 0.01", q_deviates),
    Statement("The ratio from Q is only roughly right", "Table 3", "fig-recognised",
              "worst error above 3 points; partly above 1", q_recognises_roughly),
    Statement("The Kalman filter makes each response calmer and smaller", "Fig. 25", "fig-25", "all six", filter_calms),
    Statement("Filtered, the energies of the ratios overlap less", "Fig. 26, 27", "fig-26", "less for all three",
              filtered_energy_is_clearer),
    Statement("Filtered, the peaks of the total energy at 90 and 100 % cross in part", "Fig. 26", "fig-26", "crossed",
              filtered_peaks_cross_at_the_end),
    Statement("Filtered, the amplitudes of a, v and u do not change monotonously", "Fig. 27", "fig-27",
              "a step against the rise in each", filtered_motion_is_not_monotone),
    Statement("The maxima of all four fusion parameters rise with the ratio", "Fig. 33-36", "fig-33",
              "Spearman >= 0.9 for each", fused_maxima_rise),
    Statement("In 0..0.03 s the energy fusion curves of the ratios lie apart, uncrossed", "Fig. 33", "fig-33",
              "mean |Spearman| 0.95 or more; partly from 0.8", energy_fusion_is_stratified),
    Statement("Energy fusion has a single peak", "Fig. 33", "fig-33", "1.2 or less; partly to 2",
              energy_fusion_has_one_peak),
    Statement("Energy fusion is less volatile than the composite fusion", "Fig. 33, 36", "fig-33",
              "least of the four; partly below the composite", energy_fusion_is_calmest),
    Statement("Energy fusion separates the ratios best of the four", "Fig. 33-36", "fig-33",
              "most stratified and most apart", energy_fusion_separates_best),
    Statement("The energy fusion strategy recognises better than Q", "Section V-B-3", "fig-recognised",
              "lower mean error, as published and modified", strategy_beats_q),
]  # fmt: skip
