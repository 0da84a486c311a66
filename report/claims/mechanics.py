"""Statements of Sections II and III: theory, breakage, response of the plate."""

from __future__ import annotations

import numpy as np

from analysis import breakage
from analysis.theory import STATES
from recognition.estimation.errors import RecognitionError
from report.claims.trends import falling_steps, spearman
from report.claims.verdicts import HELD, NOT_HELD, PARTLY, Statement, all_trends, graded, needs_ratios, trend

RIGID, DEFLECTING = ("PH", "PF"), ("HN", "FN")


def _along(study):
    """Peak forces at 41 places between the supports: {rock: {state: (41,)}}."""
    half = 0.48 * study.setup.support_length_m
    return study.single_peaks_N(np.linspace(-half, half, 41))


def position_does_not_matter(study):
    spread = max(np.ptp(f[key]) / f[key].mean() for f in _along(study).values() for key in RIGID)
    return (HELD if spread < 1e-9 else NOT_HELD), f"spread {spread:.1e} of the mean"


def weakest_in_the_middle(study):
    forces = [f[key] for f in _along(study).values() for key in DEFLECTING]
    held = all(
        np.argmin(f) == 20 and np.all(np.diff(f[20:]) > 0) and np.all(np.diff(f[:21]) < 0) for f in forces
    )
    depth = max(1 - f.min() / f.max() for f in forces)
    return (HELD if held else NOT_HELD), f"up to {100 * depth:.1f} % lower in the middle"


def damping_lowers(study):
    pairs = [(f["PF"] / f["PH"], f["FN"] / f["HN"]) for f in _along(study).values()]
    worst = max(np.max(ratio) for pair in pairs for ratio in pair)
    return (HELD if worst < 1 else NOT_HELD), f"Flores over Hertz at most {worst:.3f}"


def deflection_lowers_much(study):
    ratio = max(
        f[soft][20] / f[rigid][20]
        for f in _along(study).values()
        for soft, rigid in zip(DEFLECTING, RIGID, strict=True)
    )
    return graded(
        ratio, 0.7, 0.95
    ), f"in the middle of the plate up to {ratio:.3f} of the rigid state's force"


def gangue_is_harder(study):
    forces = _along(study)
    least = min(np.min(forces["gangue"][key] / forces["coal"][key]) for key in STATES)
    return (HELD if least > 1 else NOT_HELD), f"gangue over coal at least {least:.3f}"


def totals_rise(study):
    least = min(np.min(np.diff(total)) for total in study.beam_totals_N.values())
    return (HELD if least > 0 else NOT_HELD), f"smallest step {1e-3 * least:.2f} kN"


def rigid_totals_are_straight(study):
    bend = max(
        np.ptp(np.diff(study.beam_totals_N[key])) / np.diff(study.beam_totals_N[key]).mean() for key in RIGID
    )
    return (HELD if bend < 1e-9 else NOT_HELD), f"steps differ by {bend:.1e}"


def deflecting_totals_fluctuate(study):
    spread = [
        np.ptp(np.diff(study.beam_totals_N[k])) / np.diff(study.beam_totals_N[k]).mean() for k in DEFLECTING
    ]
    return graded(
        min(spread), 0.05, 0.005
    ), f"steps differ by {100 * min(spread):.1f} to {100 * max(spread):.1f} %"


def _theory_over_simulation(study):
    counts = np.rint(study.ratios * (len(study.theory_counts) - 1)).astype(int)
    force = study.peaks["force_N"]
    return {key: float(np.mean(total[counts] / force)) for key, total in study.beam_totals_N.items()}


def theory_is_much_larger(study):
    over = _theory_over_simulation(study)
    words = ", ".join(f"{key} {value:.2f}" for key, value in over.items())
    return graded(min(over.values()), 1.5, 1.05), f"theory over simulation, mean over the ratios: {words}"


def fn_is_nearest(study):
    over = _theory_over_simulation(study)
    nearest = min(over, key=lambda key: abs(np.log(over[key])))
    return (
        HELD if nearest == "FN" else NOT_HELD
    ), f"nearest is {nearest}, {over[nearest]:.2f} of the simulated force"


# ------------------------------------------------------------------- breakage


def _half(study):
    """Index of the run with five of ten gangue, and which of its agglomerates are gangue."""
    run = study.run_at(0.5)
    index = study.runs.index(run)
    return index, study.is_gangue[index]


def coal_breaks_more(study):
    index, gangue = _half(study)
    area = study.area_first_m2[index]
    if area[gangue].mean() == 0:
        none = area[~gangue].mean() == 0
        return (NOT_HELD if none else HELD), "neither breaks" if none else "gangue does not break at all"
    ratio = area[~gangue].mean() / area[gangue].mean()
    return graded(ratio, 2.0, 1.1), f"coal over gangue {ratio:.2f}"


def _later_share(study, gangue: bool) -> float:
    index, is_gangue = _half(study)
    chosen = is_gangue == gangue
    end = study.area_end_m2[index][chosen].sum()
    if end == 0:
        raise RecognitionError(f"no {'gangue' if gangue else 'coal'} breaks")
    return float(1 - study.area_first_m2[index][chosen].sum() / end)


def gangue_breaks_once(study):
    share = _later_share(study, True)
    return graded(share, 0.02, 0.1), f"{100 * share:.1f} % of its crack area comes after the first collision"


def coal_goes_on_breaking(study):
    share = _later_share(study, False)
    return graded(share, 0.1, 0.02), f"{100 * share:.1f} % of its crack area comes after the first collision"


def single_area_is_constant(study):
    """Scatter over the ratios, of coal and of gangue, as a share of the area of one coal."""
    needs_ratios(study, study.ratios)
    areas = {name: v[np.isfinite(v)] for name, v in study.per_stone(study.area_first_m2).items()}
    if not areas["coal"].size or areas["coal"].mean() == 0:
        raise RecognitionError("no coal breaks")
    scatter = {name: float(v.std() / areas["coal"].mean()) for name, v in areas.items() if v.size}
    words = ", ".join(f"{name} {100 * value:.1f} %" for name, value in scatter.items())
    return graded(
        max(scatter.values()), 0.1, 0.25
    ), f"scatter over the ratios, of the area of one coal: {words}"


def fragments_of_coal(study):
    index, gangue = _half(study)
    network = study.networks[index]
    shares = breakage.fragment_shares(network, breakage.broken_bonds(study.runs[index], network))
    largest = np.array([s[0] for s in shares])
    coal, rock = largest[~gangue].mean(), largest[gangue].mean()
    verdict = HELD if coal < rock < 1 + 1e-9 else NOT_HELD
    return verdict, f"largest fragment, share of the stone: coal {coal:.3f}, gangue {rock:.3f}"


# ------------------------------------------------------------------- response


def single_force_of_gangue(study):
    coal, gangue = (study.runs[i].peak("force_03_N") for i in study.place_3())
    return graded(gangue / coal, 1.1, 1.0), f"gangue {gangue:.0f} N, coal {coal:.0f} N at place 3"


def gangue_comes_back_later(study):
    times = []
    for i, name in zip(study.place_3(), ("coal", "gangue"), strict=True):
        found = breakage.collisions(study.runs[i], 3)
        if len(found) < 2:
            raise RecognitionError(f"{name} at place 3 touches the plate once only")
        times.append(found[1][0])
    verdict = HELD if times[1] > times[0] else NOT_HELD
    return verdict, f"second collision: coal at {1e3 * times[0]:.2f} ms, gangue at {1e3 * times[1]:.2f} ms"


def second_collisions_spread(study):
    run = study.nearest(0.5)
    found = [breakage.collisions(run, k) for k in range(1, len(run.materials) + 1)]
    second = [c[1][0] for c in found if len(c) > 1]
    if len(second) < 2:
        raise RecognitionError(f"{len(second)} agglomerates touch the plate a second time")
    first = np.ptp([c[0][0] for c in found if c])
    spread = f"first within {1e6 * first:.0f} µs, second within {1e3 * np.ptp(second):.2f} ms"
    return (
        HELD if np.ptp(second) > max(10 * first, 1e-3) else NOT_HELD
    ), f"{spread} ({len(second)} of {len(found)})"


def two_way_maxima(study):
    needs_ratios(study, study.ratios)
    named: dict[str, np.ndarray] = {}
    for name, label in (("u_m", "u"), ("v_m_s", "v"), ("a_m_s2", "a")):
        named |= {f"{label}+": study.two_way[name][:, 0], f"{label}-": -study.two_way[name][:, 1]}
    return all_trends(named, study.ratios)


def stress_rises(study):
    return trend(lambda s: s.stress_mean_Pa, 1, 1e-6, "MPa")(study)


def high_stress_appears(study):
    """High: above 0.8 of the highest stress in any run at the instant of its largest force."""
    share = study.high_stress_share
    needs_ratios(study, share)
    there = study.ratios[share > 0]
    first = f"first at {100 * there[0]:.0f} %" if there.size else "nowhere"
    rho = spearman(study.ratios, share)
    if rho >= 0.5 and there.size and there[0] >= 0.6:
        verdict = HELD if not falling_steps(study.ratios, share) else PARTLY
    else:
        verdict = PARTLY if rho >= 0.5 else NOT_HELD
    return verdict, f"{first}, Spearman of its area {rho:.3f}"


def _peak(name, factor=1.0, unit="J"):
    return trend(lambda study: study.peaks[name], 1, factor, unit)


RISES = "Spearman >= 0.9"

STATEMENTS = [
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
    Statement("After the first collision one coal is broken much more than one gangue", "Fig. 13", "fig-13",
              "'much': 2 or more; partly from 1.1", coal_breaks_more),
    Statement("After the first collision gangue does not break further", "Fig. 13", "fig-13",
              "at most 2 % later; partly to 10 %", gangue_breaks_once),
    Statement("Coal goes on breaking in later collisions", "Fig. 13", "fig-13",
              "at least 10 % later; partly from 2 %", coal_goes_on_breaking),
    Statement("Coal falls into smaller pieces than gangue", "Fig. 13", "fig-fragments", "coal < gangue",
              fragments_of_coal),
    Statement("The broken area of a single coal or gangue does not change with the ratio", "Fig. 15", "fig-15",
              "scatter at most 10 % of coal's area; partly to 25 %", single_area_is_constant),
    Statement("The total broken area after the first collision rises as the ratio falls", "Fig. 15", "fig-15",
              "Spearman <= -0.9", trend(lambda study: study.area_first_m2.sum(axis=1), -1, 1e4, "cm²")),
    Statement("The totally broken area increases with the ratio (against Fig. 15)", "Conclusion 1", "fig-15", RISES,
              trend(lambda study: study.area_first_m2.sum(axis=1), 1, 1e4, "cm²")),
    Statement("The amplitude of the plate's displacement rises with the ratio", "Fig. 16 a", "fig-16", RISES,
              _peak("u_m", 1e6, "µm")),
    Statement("The amplitude of the plate's velocity rises with the ratio", "Fig. 16 b", "fig-16", RISES,
              _peak("v_m_s", 1.0, "m/s")),
    Statement("The amplitude of the plate's acceleration rises with the ratio", "Fig. 16 c", "fig-16", RISES,
              _peak("a_m_s2", 1.0, "m/s²")),
    Statement("The plate's kinetic energy rises with the ratio", "Fig. 16 d", "fig-16", RISES, _peak("kinetic_J")),
    Statement("The plate's internal energy rises with the ratio", "Fig. 16 e", "fig-16", RISES, _peak("internal_J")),
    Statement("The plate's total energy rises with the ratio", "Fig. 16 f", "fig-16", RISES, _peak("total_J")),
    Statement("A gangue at place 3 pushes harder than a coal", "Fig. 17", "fig-17", "1.1 or more; partly above 1",
              single_force_of_gangue),
    Statement("Gangue hits the plate again later than coal does", "Fig. 17", "fig-17", "gangue later",
              gangue_comes_back_later),
    Statement("From the second collision on the particles do not hit at the same time", "Fig. 18", "fig-18",
              "spread above 1 ms and ten times the first's", second_collisions_spread),
    Statement("The largest total contact force rises with the ratio", "Fig. 18, 19", "fig-19", RISES,
              _peak("force_N", 1e-3, "kN")),
    Statement("The largest displacement, velocity and acceleration rise in both directions", "Fig. 19", "fig-19",
              "Spearman >= 0.9 for each", two_way_maxima),
    Statement("The overall stress under the particles rises with the ratio", "Fig. 21", "fig-21", RISES, stress_rises),
    Statement("The stress at the contact points rises with the ratio", "Fig. 21", "fig-21-ratio", RISES,
              trend(lambda study: study.contact_pressure_Pa.mean(axis=1), 1, 1e-6, "MPa, largest Hertz pressure")),
    Statement("A region of high stress appears above 70 % and grows with the ratio", "Fig. 21", "fig-21",
              "first at 60-80 %, growing; high: above 0.8 of the highest", high_stress_appears),
]  # fmt: skip
