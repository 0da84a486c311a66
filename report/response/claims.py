"""Statements of Section III on the response of the plate."""

import numpy as np

from analysis.sweep import breakage
from report.missing import MissingResult
from report.sweep_results import SweepResults
from report.verdicts import (
    HELD,
    NOT_HELD,
    PARTLY,
    Finding,
    Statement,
    all_rise,
    falling_steps,
    graded,
    held_if,
    spearman,
    trend,
)


def gangue_pushes_harder_at_3(results: SweepResults) -> Finding:
    coal_N, gangue_N = (results.runs[i].peak("force_03_N") for i in results.indices_coal_gangue_at_3())
    return graded(gangue_N / coal_N, 1.1, 1.0), f"gangue {gangue_N:.0f} N, coal {coal_N:.0f} N at place 3"


def gangue_comes_back_later(results: SweepResults) -> Finding:
    times_s = []
    for i, name in zip(results.indices_coal_gangue_at_3(), ("coal", "gangue"), strict=True):
        found = breakage.collisions(results.runs[i], 3)
        if len(found) < 2:
            raise MissingResult(f"{name} at place 3 touches the plate once only")
        times_s.append(found[1][0])
    coal_s, gangue_s = times_s
    value = f"second collision: coal at {1e3 * coal_s:.2f} ms, gangue at {1e3 * gangue_s:.2f} ms"
    return held_if(gangue_s > coal_s), value


def second_collisions_spread(results: SweepResults) -> Finding:
    run = results.runs[results.index_nearest(0.5)]
    found = [breakage.collisions(run, k) for k in range(1, len(run.materials) + 1)]
    second_s = [collisions[1][0] for collisions in found if len(collisions) > 1]
    if len(second_s) < 2:
        raise MissingResult(f"{len(second_s)} agglomerates touch the plate a second time")
    first_s = np.ptp([collisions[0][0] for collisions in found if collisions])
    spread_s = np.ptp(second_s)
    value = f"first within {1e6 * first_s:.0f} µs, second within {1e3 * spread_s:.2f} ms"
    return held_if(spread_s > max(10 * first_s, 1e-3)), f"{value} ({len(second_s)} of {len(found)})"


def maxima_both_ways(results: SweepResults) -> dict[str, np.ndarray]:
    return {f"{name[0]}{side}": values for name in ("u_m", "v_m_s", "a_m_s2")
            for side, values in zip("+-", results.extremes(name).T * [[1], [-1]], strict=True)}


def high_stress_appears(results: SweepResults) -> Finding:
    share = results.plate.high_stress_share
    ratios = results.ratios
    there = ratios[share > 0]
    first = f"first at {100 * there[0]:.0f} %" if there.size else "nowhere"
    rho = spearman(ratios, share)
    if rho < 0.5:
        verdict = NOT_HELD
    elif there.size and there[0] >= 0.6 and not falling_steps(ratios, share):
        verdict = HELD
    else:
        verdict = PARTLY
    return verdict, f"{first}, Spearman of its area {rho:.3f}"


RISES = "Spearman >= 0.9"

RESPONSE_STATEMENTS = [
    Statement("Displacement, velocity and acceleration of the plate rise in both directions", "Fig. 16 a-c, 19",
              "fig-19", "Spearman >= 0.9 for each", all_rise(maxima_both_ways)),
    Statement("Kinetic, internal and total energy of the plate rise with the ratio", "Fig. 16 d-f", "fig-16",
              "Spearman >= 0.9 for each",
              all_rise(lambda of: {name: of.sweep.peaks(f"{name}_J") for name in ("kinetic", "internal", "total")})),
    Statement("A gangue at place 3 pushes harder than a coal", "Fig. 17", "fig-17", "1.1 or more; partly above 1",
              gangue_pushes_harder_at_3),
    Statement("Gangue hits the plate again later than coal does", "Fig. 17", "fig-17", "gangue later",
              gangue_comes_back_later),
    Statement("From the second collision on the particles do not hit at the same time", "Fig. 18", "fig-18",
              "spread above 1 ms and ten times the first's", second_collisions_spread),
    Statement("The largest total contact force rises with the ratio", "Fig. 18, 19", "fig-19", RISES,
              trend(lambda results: results.sweep.peaks("force_N"), 1, 1e-3, "kN")),
    Statement("The overall stress under the particles rises with the ratio", "Fig. 21", "fig-21", RISES,
              trend(lambda results: results.plate.mean_stress_below_stones_Pa, 1, 1e-6, "MPa")),
    Statement("The stress at the contact points rises with the ratio", "Fig. 21", "fig-21-ratio", RISES,
              trend(lambda results: results.plate.contact_pressure_Pa.mean(axis=1), 1, 1e-6,
                    "MPa, largest Hertz pressure")),
    Statement("A region of high stress appears above 70 % and grows with the ratio", "Fig. 21", "fig-21",
              "first at 60-80 %, growing; high: above 0.8 of the highest", high_stress_appears),
]  # fmt: skip
