"""Statements of Section III on breakage."""

from __future__ import annotations

import numpy as np

from report.missing import MissingResult
from report.sweep_results import SweepResults
from report.verdicts import (
    HELD,
    NOT_HELD,
    Finding,
    Statement,
    graded,
    held_if,
    need_enough_ratios,
    trend,
)


def _half(results: SweepResults) -> tuple[int, np.ndarray]:
    """Return the index of the run with five of ten gangue, and which of its stones are gangue."""
    index = results.index_at(0.5)
    return index, results.is_gangue[index]


def coal_breaks_more(results: SweepResults) -> Finding:
    index, gangue = _half(results)
    area = results.breakage.area_first_m2[index]
    if area[gangue].mean() == 0:
        none = area[~gangue].mean() == 0
        return (NOT_HELD, "neither breaks") if none else (HELD, "gangue does not break at all")
    ratio = area[~gangue].mean() / area[gangue].mean()
    return graded(ratio, 2.0, 1.1), f"coal over gangue {ratio:.2f}"


def _later_share(results: SweepResults, gangue: bool) -> float:
    """Return the share of the crack area of coal or gangue that comes after the first collision."""
    index, is_gangue = _half(results)
    chosen = is_gangue == gangue
    end = results.breakage.area_end_m2[index][chosen].sum()
    if end == 0:
        raise MissingResult(f"no {'gangue' if gangue else 'coal'} breaks")
    return float(1 - results.breakage.area_first_m2[index][chosen].sum() / end)


def gangue_breaks_once(results: SweepResults) -> Finding:
    share = _later_share(results, True)
    return graded(share, 0.02, 0.1), f"{100 * share:.1f} % of its crack area comes after the first collision"


def coal_goes_on_breaking(results: SweepResults) -> Finding:
    share = _later_share(results, False)
    return graded(share, 0.1, 0.02), f"{100 * share:.1f} % of its crack area comes after the first collision"


def coal_falls_into_smaller_pieces(results: SweepResults) -> Finding:
    index, gangue = _half(results)
    largest = np.array([shares[0] for shares in results.breakage.fragment_shares(index)])
    of_coal, of_gangue = largest[~gangue].mean(), largest[gangue].mean()
    value = f"largest fragment, share of the stone: coal {of_coal:.3f}, gangue {of_gangue:.3f}"
    return held_if(of_coal < of_gangue < 1 + 1e-9), value


def single_area_is_constant(results: SweepResults) -> Finding:
    """The scatter over the ratios, of coal and of gangue, is a share of the area of one coal."""
    need_enough_ratios(results)
    means = results.mean_by_material(results.breakage.area_first_m2)
    areas = {name: area[np.isfinite(area)] for name, area in means.items()}
    if not areas["coal"].size or areas["coal"].mean() == 0:
        raise MissingResult("no coal breaks")
    scatter = {name: float(area.std() / areas["coal"].mean()) for name, area in areas.items() if area.size}
    numbers = ", ".join(f"{name} {100 * value:.1f} %" for name, value in scatter.items())
    value = f"scatter over the ratios, of the area of one coal: {numbers}"
    return graded(max(scatter.values()), 0.1, 0.25), value


def _total_area_m2(results: SweepResults) -> np.ndarray:
    return results.breakage.area_first_m2.sum(axis=1)


BREAKAGE_STATEMENTS = [
    Statement("After the first collision one coal is broken much more than one gangue", "Fig. 13", "fig-13",
              "'much': 2 or more; partly from 1.1", coal_breaks_more),
    Statement("After the first collision gangue does not break further", "Fig. 13", "fig-13",
              "at most 2 % later; partly to 10 %", gangue_breaks_once),
    Statement("Coal goes on breaking in later collisions", "Fig. 13", "fig-13",
              "at least 10 % later; partly from 2 %", coal_goes_on_breaking),
    Statement("Coal falls into smaller pieces than gangue", "Fig. 13", "fig-fragments", "coal < gangue",
              coal_falls_into_smaller_pieces),
    Statement("The broken area of a single coal or gangue does not change with the ratio", "Fig. 15", "fig-15",
              "scatter at most 10 % of coal's area; partly to 25 %", single_area_is_constant),
    Statement("The total broken area rises as the ratio falls (Conclusion 1 says the reverse)", "Fig. 15", "fig-15",
              "Spearman <= -0.9", trend(_total_area_m2, -1, 1e4, "cm²")),
]  # fmt: skip
