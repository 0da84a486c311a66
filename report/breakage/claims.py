"""Statements of Section III on breakage."""

import numpy as np

from report.missing import MissingResult
from report.sweep_results import SweepResults
from report.verdicts import HELD, NOT_HELD, Finding, Statement, graded, held_if, trend


def _half(results: SweepResults) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices of the runs with five of ten gangue, and which of their stones are gangue (runs, stones)."""
    results.index_at(0.5)  # is there one?
    runs = np.flatnonzero(np.abs(results.ratios - 0.5) < 1e-6)
    return runs, results.is_gangue[runs]


def _with_error(values: np.ndarray, form: str) -> str:
    """The mean and, of two values or more, its standard error."""
    error = f" ± {values.std(ddof=1) / np.sqrt(values.size):{form}}" if values.size > 1 else ""
    return f"{values.mean():{form}}{error}"


def coal_breaks_more(results: SweepResults) -> Finding:
    runs, gangue = _half(results)
    area = 1e4 * results.breakage.area_first_m2[runs]
    stones = f"{_with_error(area[~gangue], '.3g')} and {_with_error(area[gangue], '.3g')} cm² over stones"
    if area[gangue].mean() == 0:
        none = area[~gangue].mean() == 0
        return (NOT_HELD, "neither breaks") if none else (HELD, f"gangue does not break at all; {stones}")
    ratio = area[~gangue].mean() / area[gangue].mean()
    return graded(ratio, 2.0, 1.1), f"coal over gangue {ratio:.2f}: {stones}; {results.breakage.draws_in_words}"


def _later_share(results: SweepResults, gangue: bool) -> tuple[float, str]:
    """Return the share of the crack area of coal or gangue that comes after the first collision, and with its standard
    error over the stones in words."""
    runs, is_gangue = _half(results)
    chosen = is_gangue == gangue
    first, end = results.breakage.area_first_m2[runs][chosen], results.breakage.area_end_m2[runs][chosen]
    if end.sum() == 0:
        raise MissingResult(f"no {'gangue' if gangue else 'coal'} breaks")
    share = float(1 - first.sum() / end.sum())
    missed = end - first - share * end  # of a ratio of sums
    error = np.sqrt(end.size / max(end.size - 1, 1) * (missed**2).sum()) / end.sum()
    return share, (f"{100 * share:.1f} ± {100 * error:.2g} % of its crack area comes after the first collision, over "
                   f"{end.size} stones; {results.breakage.draws_in_words}")


def gangue_breaks_once(results: SweepResults) -> Finding:
    share, words = _later_share(results, True)
    return graded(share, 0.02, 0.1), words


def coal_goes_on_breaking(results: SweepResults) -> Finding:
    share, words = _later_share(results, False)
    return graded(share, 0.1, 0.02), words


def coal_falls_into_smaller_pieces(results: SweepResults) -> Finding:
    runs, gangue = _half(results)
    largest = np.array([[shares[0] for shares in results.breakage.fragment_shares(run)] for run in runs])
    of_coal, of_gangue = largest[~gangue], largest[gangue]
    value = (f"largest fragment, share of the stone: coal {_with_error(of_coal, '.3f')}, gangue "
             f"{_with_error(of_gangue, '.3f')}; {results.breakage.draws_in_words}")
    return held_if(of_coal.mean() < of_gangue.mean() < 1 + 1e-9), value


def single_area_is_constant(results: SweepResults) -> Finding:
    """The scatter over the ratios, of coal and of gangue, is a share of the area of one coal."""
    means = results.mean_by_material(results.breakage.area_first_m2)
    areas = {name: area[np.isfinite(area)] for name, area in means.items()}
    if not areas["coal"].size or areas["coal"].mean() == 0:
        raise MissingResult("no coal breaks")
    scatter = {name: float(area.std() / areas["coal"].mean()) for name, area in areas.items() if area.size}
    numbers = ", ".join(f"{name} {100 * value:.1f} %" for name, value in scatter.items())
    value = f"scatter over the ratios, of the area of one coal: {numbers}; {results.breakage.draws_in_words}"
    return graded(max(scatter.values()), 0.1, 0.25), value


def total_area_rises(results: SweepResults) -> Finding:
    verdict, words = trend(lambda of: of.breakage.area_first_m2.sum(axis=1), -1, 1e4, "cm²")(results)
    return verdict, f"{words}; {results.breakage.draws_in_words}"


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
              "Spearman <= -0.9", total_area_rises),
]  # fmt: skip
