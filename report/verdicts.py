"""Verdicts on the paper's statements, the measures of what it says in words, and the rules that give verdicts.

A verdict is "held", "partly", "not held", or "not tested" where the runs do not hold what the statement is about.
A trend is held from |Spearman| >= 0.9 in the stated direction and partly from 0.5; a change "without order" is held
below 0.6 and partly below 0.9. Other rules stand in each statement's `expected`.

ratios: mixing ratio of each run, shape (runs,). values: one number a run, shape (runs,). curves: shape (runs, moments).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import rankdata, spearmanr

from report.drawing.pages import to_csv
from report.missing import MISSING_RESULT, MissingResult
from report.sweep_results import SweepResults

HELD, PARTLY, NOT_HELD, NOT_TESTED = "held", "partly", "not held", "not tested"
VERDICTS = (HELD, PARTLY, NOT_HELD, NOT_TESTED)

#: The verdict, and our number in words.
Finding = tuple[str, str]
Test = Callable[[SweepResults], Finding]
Values = Callable[[SweepResults], np.ndarray]
#: So many ratios are needed to test the statements.
LEAST_TREND = 4


@dataclass(frozen=True)
class Claim:
    """A statement of the paper with its verdict and our number. where: its figure, table or section. figure: key of
    ours. expected: the rule in words."""

    text: str
    where: str
    figure: str
    expected: str
    verdict: str = NOT_TESTED
    value: str = ""


class Statement:
    """A claim, and the test that gives its finding."""

    def __init__(self, text: str, where: str, figure: str, expected: str, test: Test) -> None:
        self.claim, self.test = Claim(text, where, figure, expected), test


def check_statements(results: SweepResults, statements: Sequence[Statement]) -> list[Claim]:
    claims = []
    for statement in statements:
        try:
            verdict, value = statement.test(results)
        except MISSING_RESULT as reason:
            verdict, value = NOT_TESTED, str(reason)
        claims.append(replace(statement.claim, verdict=verdict, value=value))
    return claims


def claims_csv(claims: list[Claim]) -> str:
    """Return the claims as CSV: claim, where, verdict, value, expected."""
    return to_csv([["claim", "where", "verdict", "value", "expected"],
                   *([c.text, c.where, c.verdict, c.value, c.expected] for c in claims)])


def listed(values: Mapping[str, float], form: str) -> str:
    """Numbers with their names, in words."""
    return ", ".join(f"{name} {value:{form}}" for name, value in values.items())


def held_if(true: bool) -> str:
    """Return the verdict on a statement that is either true or not."""
    return HELD if true else NOT_HELD


def held_if_all(true: Sequence[bool]) -> str:
    """Return held if all parts of a statement are true, partly if some are."""
    return HELD if all(true) else PARTLY if any(true) else NOT_HELD


def graded(value: float, held: float, partly: float) -> str:
    """Return held from one limit on and partly from another on: upward, or downward if held < partly."""
    if held < partly:
        value, held, partly = -value, -held, -partly
    return HELD if value >= held else PARTLY if value >= partly else NOT_HELD


def trend(values: Values, direction: int = 1, factor: float = 1.0, unit: str = "") -> Test:
    """Test whether values rise (direction 1) or fall (-1) with the ratio as a whole. The first and the last are shown,
    times a factor, in a unit."""

    def test(results: SweepResults) -> Finding:
        x = np.asarray(values(results), dtype=float)
        verdict = graded(direction * spearman(results.ratios, x), 0.9, 0.5)
        span = f"{factor * x[0]:.4g} to {factor * x[-1]:.4g} {unit}".rstrip()
        return verdict, f"{describe_trend(results.ratios, x, direction)}; {span}"

    return test


def describe_trend(ratios: np.ndarray, values: np.ndarray, direction: int = 1) -> str:
    """Return the rank correlation and the steps against the direction, in words."""
    wrong = falling_steps(ratios, direction * values)
    steps = ", ".join(f"{100 * a:.0f}-{100 * b:.0f} %" for a, b in wrong)
    against = f"against it at {steps}" if wrong else "no step against it"
    return f"Spearman {spearman(ratios, values):.3f}, {against}"


def all_rise(named: Callable[[SweepResults], dict[str, np.ndarray]]) -> Test:
    """Test whether several quantities rise together with the ratio: held if each does."""

    def test(results: SweepResults) -> Finding:
        rho = {name: spearman(results.ratios, values) for name, values in named(results).items()}
        least, partly = min(rho.values()), max(rho.values()) >= 0.9 or min(rho.values()) >= 0.5
        return HELD if least >= 0.9 else PARTLY if partly else NOT_HELD, f"Spearman {listed(rho, '.3f')}"

    return test


def spearman(ratios: np.ndarray, values: np.ndarray) -> float:
    """Return Spearman's rank correlation of values with the ratio, -1..1; 0 where all values are equal. Raises
    MissingResult if not every run has a finite value."""
    if not np.all(np.isfinite(values)):
        raise MissingResult("not every run has a value")
    if np.ptp(values) == 0:
        return 0.0
    return float(spearmanr(ratios, values).statistic)


def falling_steps(ratios: np.ndarray, values: np.ndarray) -> list[tuple[float, float]]:
    """Return the pairs of neighbouring ratios between which the values fall."""
    return [(float(ratios[i]), float(ratios[i + 1])) for i in np.flatnonzero(np.diff(values) < 0)]


def stratification(ratios: np.ndarray, curves: np.ndarray) -> float:
    """Mean over the moments of |Spearman| between ratio and value: 1 for curves that never cross. Moments at which all
    agree (before the impact) do not count. The order may turn over with time, as it must for a vibration."""
    ranks = rankdata(_alive(curves), axis=0)
    ranks = ranks - ranks.mean(axis=0)
    r = rankdata(ratios) - np.mean(rankdata(ratios))
    return float(np.mean(np.abs(r @ ranks) / np.sqrt((r @ r) * np.sum(ranks**2, axis=0))))


def overlap(curves: np.ndarray) -> float:
    """Return the share of neighbouring curves, over all moments, that lie against the order of most at that moment."""
    rising = np.mean(np.diff(_alive(curves), axis=0) > 0, axis=0)
    return float(np.mean(np.minimum(rising, 1 - rising)))


def _alive(curves: np.ndarray) -> np.ndarray:
    return curves[:, np.ptp(curves, axis=0) > 1e-12 * np.ptp(curves)]


def separation(curves: np.ndarray) -> float:
    """Return the mean over the moments of the spread of the curves, divided by the whole range of values."""
    return float(np.mean(np.ptp(curves, axis=0)) / np.ptp(curves))


def travel(curve: np.ndarray) -> float:
    """The way of a curve (moments,) up and down over twice its range: at most 1 for a single peak, n for n equal
    ones."""
    return float(np.sum(np.abs(np.diff(curve))) / (2 * np.ptp(curve)))


def fluctuation(signal: np.ndarray) -> float:
    """Return the RMS of the change from sample to sample over the signal's standard deviation, shape (samples,)."""
    return float(np.sqrt(np.mean(np.diff(signal) ** 2)) / np.std(signal))
