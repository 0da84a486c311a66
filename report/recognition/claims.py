"""Statements of Section V: fused parameter Q, Kalman filter, fusion and recognition."""

import numpy as np

from common.channels import RESPONSES
from report.missing import MissingResult
from report.recognition.results import FUSION_Q, FUSION_WORDS, HELD_OUT, Recognition
from report.sweep_results import SweepResults
from report.verdicts import (
    HELD,
    NOT_HELD,
    PARTLY,
    Finding,
    Statement,
    all_rise,
    describe_trend,
    fluctuation,
    graded,
    held_if,
    held_if_all,
    listed,
    overlap,
    separation,
    spearman,
    stratification,
    travel,
)


def q_rises(results: SweepResults) -> Finding:
    q = results.of(Recognition).q
    return graded(spearman(results.ratios, q), 0.9, 0.5), describe_trend(results.ratios, q)


def q_is_quadratic(results: SweepResults) -> Finding:
    fit = results.of(Recognition).q_quadratic
    if not np.isfinite(fit.r2_adjusted):
        raise MissingResult(f"{len(results.ratios)} ratios; an adjusted R^2 needs more")
    c = fit.coefficients
    value = f"adjusted R^2 {fit.r2_adjusted:.5f}, Q = {c[0]:.5f} {c[1]:+.5f} b {c[2]:+.5f} b^2"
    return graded(fit.r2_adjusted, 0.99, 0.97), value


def q_deviates(results: SweepResults) -> Finding:
    off = results.of(Recognition).q_quadratic(results.ratios) - results.of(Recognition).q
    value = f"{np.abs(off).min():.4f} to {np.abs(off).max():.4f}"
    to_both_sides = off.min() < 0 < off.max()
    return (HELD if to_both_sides and np.abs(off).max() > 0.01 else PARTLY if to_both_sides else NOT_HELD), value


def q_recognises_roughly(results: SweepResults) -> Finding:
    errors = np.abs(results.of(Recognition).errors_points(HELD_OUT, FUSION_Q))
    if errors.size == 0:
        raise MissingResult("Q gives no answer at all")
    value = f"held out: mean {errors.mean():.2f}, worst {errors.max():.2f} points"
    return graded(errors.max(), 3.0, 1.0), value


ENERGY_NAMES = ("total_J", "kinetic_J", "internal_J")


def filter_calms(results: SweepResults) -> Finding:
    calmer = {}
    for name in RESPONSES:
        before, after = results.sweep.stack(name), results.of(Recognition).filtered[name]
        rough = np.mean([fluctuation(b) / fluctuation(a) for a, b in zip(before, after, strict=True)])
        calmer[name] = (rough, np.abs(after).max() / np.abs(before).max())
    all_calmer = all(rough < 1 and size < 1 for rough, size in calmer.values())
    numbers = ", ".join(f"{name} {rough:.2f}/{size:.2f}" for name, (rough, size) in calmer.items())
    return (HELD if all_calmer else PARTLY), f"after over before, fluctuation/amplitude: {numbers}"


def filtered_energy_is_clearer(results: SweepResults) -> Finding:
    pairs = {name: (overlap(results.sweep.stack(name)), overlap(results.of(Recognition).filtered[name]))
             for name in ENERGY_NAMES}
    numbers = ", ".join(f"{name} {before:.4f} to {after:.4f}" for name, (before, after) in pairs.items())
    return held_if_all([after < before for before, after in pairs.values()]), f"overlap: {numbers}"


def filtered_peaks_cross_at_the_end(results: SweepResults) -> Finding:
    filtered = results.of(Recognition).filtered["total_J"]
    at_90, at_100 = (filtered[results.index_at(ratio)] for ratio in (0.9, 1.0))
    peak = int(np.argmax(at_100))
    window = slice(max(0, peak - 10), peak + 11)
    crossing = float(np.mean(at_100[window] <= at_90[window]))
    return held_if(crossing > 0), f"crossed at {100 * crossing:.0f} % of 21 samples about the peak"


def filtered_motion_is_not_monotone(results: SweepResults) -> Finding:
    filtered = results.of(Recognition).filtered
    largest = {name: np.abs(filtered[name]).max(axis=1) for name in ("a_m_s2", "v_m_s", "u_m")}
    against = {name: int(np.sum(np.diff(values) < 0)) for name, values in largest.items()}
    return held_if_all([count > 0 for count in against.values()]), f"steps against the rise: {listed(against, 'd')}"


def fused_maxima(results: SweepResults) -> dict[str, np.ndarray]:
    return {kind: np.abs(curves - curves[:, :1]).max(axis=1) for kind, curves in results.of(Recognition).fused.items()}


def energy_fusion_is_stratified(results: SweepResults) -> Finding:
    curves = results.of(Recognition).fused["energy"][:, results.t_s <= 0.03]
    order, crossed = stratification(results.ratios, curves), overlap(curves)
    value = f"mean |Spearman| {order:.4f}, {100 * crossed:.2f} % of neighbours out of order"
    return graded(order, 0.95, 0.8), value


def _mean_travel(results: SweepResults) -> dict[str, float]:
    """Return the way up and down over twice the range, mean over the runs, of each fusion."""
    fused = results.of(Recognition).fused
    return {kind: float(np.mean([travel(curve) for curve in curves])) for kind, curves in fused.items()}


def energy_fusion_has_one_peak(results: SweepResults) -> Finding:
    ways = _mean_travel(results)
    return graded(ways["energy"], 1.2, 2.0), f"way up and down over twice the range: {listed(ways, '.2f')}"


def energy_fusion_is_calmest(results: SweepResults) -> Finding:
    ways = _mean_travel(results)
    least = min(ways, key=ways.__getitem__)
    verdict = HELD if least == "energy" else PARTLY if ways["energy"] < ways["composite"] else NOT_HELD
    return verdict, f"least volatile: {least}; energy {ways['energy']:.2f}, composite {ways['composite']:.2f}"


def energy_fusion_separates_best(results: SweepResults) -> Finding:
    fused = results.of(Recognition).fused
    order = {kind: stratification(results.ratios, curves) for kind, curves in fused.items()}
    apart = {kind: separation(curves) for kind, curves in fused.items()}
    best = [max(order, key=order.__getitem__), max(apart, key=apart.__getitem__)]
    numbers = ", ".join(f"{kind} {order[kind]:.3f}/{apart[kind]:.3f}" for kind in order)
    return held_if_all([kind == "energy" for kind in best]), f"stratification/separation: {numbers}"


def strategy_beats_q(results: SweepResults) -> Finding:
    of_q = np.abs(results.of(Recognition).errors_points(HELD_OUT, FUSION_Q))
    if of_q.size == 0:
        raise MissingResult("Q gives no answer")
    count = len(results.runs)
    numbers, better = [f"Q {of_q.mean():.2f} ({of_q.size} of {count} answered)"], []
    for method, words in FUSION_WORDS.items():
        errors = np.abs(results.of(Recognition).errors_points(HELD_OUT, method))
        better.append(errors.size == count and bool(errors.mean() < of_q.mean()))
        numbers.append(f"{words} {errors.mean():.2f} ({errors.size} of {count} answered)" if errors.size else
                       f"{words} no answer")
    return held_if_all(better), f"mean error in points, held out: {', '.join(numbers)}"


RECOGNITION_STATEMENTS = [
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
              "Spearman >= 0.9 for each", all_rise(fused_maxima)),
    Statement("In 0..0.03 s the energy fusion curves of the ratios lie apart, uncrossed", "Fig. 33", "fig-33",
              "mean |Spearman| 0.95 or more; partly from 0.8", energy_fusion_is_stratified),
    Statement("Energy fusion has a single peak", "Fig. 33", "fig-33", "1.2 or less; partly to 2",
              energy_fusion_has_one_peak),
    Statement("Energy fusion is less volatile than the composite fusion", "Fig. 33, 36", "fig-33",
              "least of the four; partly below the composite", energy_fusion_is_calmest),
    Statement("Energy fusion separates the ratios best of the four", "Fig. 33-36", "fig-33",
              "most stratified and most apart", energy_fusion_separates_best),
    Statement("The energy fusion strategy recognises better than Q", "Section V-B-3", "fig-recognised",
              f"lower mean error, {' and '.join(FUSION_WORDS.values())}", strategy_beats_q),
]  # fmt: skip
