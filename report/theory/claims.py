"""Statements of Section II: the theory of a sphere's impact in four states."""

import numpy as np

from analysis.theory.contact_states import STATES
from report.sweep_results import SweepResults
from report.verdicts import Finding, Statement, graded, held_if

RIGID, DEFLECTING = ("PH", "PF"), ("HN", "FN")
MIDDLE = 20  # of the 41 places


def _along(results: SweepResults) -> dict[str, dict[str, np.ndarray]]:
    """Return peak forces in N at 41 places between the supports: {material: {state: shape (41,)}}."""
    half_m = 0.48 * results.theory.setup.support_length_m
    return results.theory.single_peaks_N(np.linspace(-half_m, half_m, 2 * MIDDLE + 1))


def position_does_not_matter(results: SweepResults) -> Finding:
    spread = max(np.ptp(f[key]) / f[key].mean() for f in _along(results).values() for key in RIGID)
    return held_if(spread < 1e-9), f"spread {spread:.1e} of the mean"


def weakest_in_the_middle(results: SweepResults) -> Finding:
    forces = [f[key] for f in _along(results).values() for key in DEFLECTING]
    least_in_middle = all(np.argmin(f) == MIDDLE and np.all(np.diff(f[MIDDLE:]) > 0)
                          and np.all(np.diff(f[:MIDDLE + 1]) < 0) for f in forces)
    depth = max(1 - f.min() / f.max() for f in forces)
    return held_if(least_in_middle), f"up to {100 * depth:.1f} % lower in the middle"


def damping_lowers(results: SweepResults) -> Finding:
    pairs = [(f["PF"] / f["PH"], f["FN"] / f["HN"]) for f in _along(results).values()]
    worst = max(np.max(ratio) for pair in pairs for ratio in pair)
    return held_if(worst < 1), f"Flores over Hertz at most {worst:.3f}"


def deflection_lowers_much(results: SweepResults) -> Finding:
    forces = _along(results).values()
    pairs = list(zip(DEFLECTING, RIGID, strict=True))
    ratio = max(f[deflecting][MIDDLE] / f[rigid][MIDDLE] for f in forces for deflecting, rigid in pairs)
    return graded(ratio, 0.7, 0.95), f"in the middle of the plate up to {ratio:.3f} of the rigid state's force"


def gangue_is_harder(results: SweepResults) -> Finding:
    forces = _along(results)
    least = min(np.min(forces["gangue"][key] / forces["coal"][key]) for key in STATES)
    return held_if(least > 1), f"gangue over coal at least {least:.3f}"


def totals_rise(results: SweepResults) -> Finding:
    least_N = min(np.min(np.diff(total)) for total in results.theory.beam_totals_N.values())
    return held_if(least_N > 0), f"smallest step {1e-3 * least_N:.2f} kN"


def _unevenness(total_N: np.ndarray) -> float:
    """Return the spread of the steps from count to count over their mean."""
    return np.ptp(np.diff(total_N)) / np.diff(total_N).mean()


def rigid_totals_are_straight(results: SweepResults) -> Finding:
    worst = max(_unevenness(results.theory.beam_totals_N[key]) for key in RIGID)
    return held_if(worst < 1e-9), f"steps differ by {worst:.1e}"


def deflecting_totals_fluctuate(results: SweepResults) -> Finding:
    spread = [_unevenness(results.theory.beam_totals_N[key]) for key in DEFLECTING]
    value = f"steps differ by {100 * min(spread):.1f} to {100 * max(spread):.1f} %"
    return graded(min(spread), 0.05, 0.005), value


def _theory_over_simulation(results: SweepResults) -> dict[str, float]:
    """Return the total force by theory over the simulated one, mean over the ratios, of each state."""
    counts = np.rint(results.ratios * (len(results.theory.gangue_counts) - 1)).astype(int)
    force_N = results.sweep.peaks("force_N")
    return {key: float(np.mean(total[counts] / force_N)) for key, total in results.theory.beam_totals_N.items()}


def theory_is_much_larger(results: SweepResults) -> Finding:
    over = _theory_over_simulation(results)
    numbers = ", ".join(f"{key} {value:.2f}" for key, value in over.items())
    return graded(min(over.values()), 1.5, 1.05), f"theory over simulation, mean over the ratios: {numbers}"


def fn_is_nearest(results: SweepResults) -> Finding:
    over = _theory_over_simulation(results)
    nearest = min(over, key=lambda key: abs(np.log(over[key])))
    return held_if(nearest == "FN"), f"nearest is {nearest}, {over[nearest]:.2f} of the simulated force"


THEORY_STATEMENTS = [
    Statement("Without deflection the peak force of a sphere does not depend on where it hits", "Fig. 9", "fig-9",
              "no spread", position_does_not_matter),
    Statement("With deflection the peak force is smallest in the middle and grows to both ends", "Fig. 9", "fig-9",
              "minimum in the middle, monotone to the ends", weakest_in_the_middle),
    Statement("Damping lowers the peak force in either state", "Fig. 9", "fig-9", "< 1", damping_lowers),
    Statement("With deflection the force is much less than without", "Fig. 9", "fig-9",
              "'much': at most 0.7 in the middle; partly below 0.95", deflection_lowers_much),
    Statement("Gangue pushes harder than coal at the same place in all four states", "Fig. 9", "fig-9", "> 1",
              gangue_is_harder),
    Statement("The total force of all four states rises with the ratio", "Fig. 10", "fig-10", "every step > 0",
              totals_rise),
    Statement("The totals without deflection rise in a straight line", "Fig. 10", "fig-10", "equal steps",
              rigid_totals_are_straight),
    Statement("The totals with deflection rise in uneven steps", "Fig. 10", "fig-10",
              "steps differ by 5 % or more; partly from 0.5 %", deflecting_totals_fluctuate),
    Statement("The total force of all four theories is much larger than the simulated one", "Fig. 10, 19", "fig-19",
              "'much': 1.5 or more; partly from 1.05", theory_is_much_larger),
    Statement("Flores with deflection is the theory nearest to the simulation", "Fig. 10, 19", "fig-19", "FN nearest",
              fn_is_nearest),
]  # fmt: skip
