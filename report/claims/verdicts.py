"""The paper's statements, each held against the runs: the scoreboard of the report.

A verdict is "held", "partly", "not held", or "not tested" where the runs do not hold what
the statement is about. The rules: a trend is held from |Spearman| >= 0.9 in the stated
direction and partly from 0.5; a "disorderly" change is held below 0.6 and partly below 0.9.
Other rules stand in each claim's `expected`.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from analysis import RecordError
from recognition.estimation.errors import RecognitionError
from report.claims.trends import falling_steps, spearman
from report.study import Study

HELD, PARTLY, NOT_HELD, NOT_TESTED = "held", "partly", "not held", "not tested"
VERDICTS = (HELD, PARTLY, NOT_HELD, NOT_TESTED)

#: Fewer ratios than this say nothing about a trend.
LEAST_RATIOS = 4


@dataclass(frozen=True)
class Statement:
    """text: what the paper says; where: its figure, table or section; figure: key of ours."""

    text: str
    where: str
    figure: str
    expected: str
    test: Callable[[Study], tuple[str, str]]


@dataclass(frozen=True)
class Claim:
    """A statement with its verdict and our number."""

    text: str
    where: str
    figure: str
    expected: str
    verdict: str
    value: str


def judge(study: Study, statements: list[Statement]) -> list[Claim]:
    """Hold every statement against a study."""
    claims = []
    for s in statements:
        try:
            verdict, value = s.test(study)
        except (RecordError, RecognitionError) as reason:
            verdict, value = NOT_TESTED, str(reason)
        claims.append(Claim(s.text, s.where, s.figure, s.expected, verdict, value))
    return claims


def to_csv(claims: list[Claim]) -> str:
    """claim, where, verdict, value, expected."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["claim", "where", "verdict", "value", "expected"])
    writer.writerows([c.text, c.where, c.verdict, c.value, c.expected] for c in claims)
    return out.getvalue()


# ------------------------------------------------------------ kinds of statement


def graded(value: float, held: float, partly: float) -> str:
    """Held at or above one limit, partly at or above another (below, if held < partly)."""
    if held < partly:
        value, held, partly = -value, -held, -partly
    return HELD if value >= held else PARTLY if value >= partly else NOT_HELD


def trend(
    values: Callable[[Study], np.ndarray], direction: int = 1, factor: float = 1.0, unit: str = ""
) -> Callable[[Study], tuple[str, str]]:
    """The values rise (direction 1) or fall (-1) with the ratio as a whole; shown times a factor, in a unit."""

    def test(study: Study):
        x = np.asarray(values(study), dtype=float)
        ratios = needs_ratios(study, x)
        rho = spearman(ratios, x)
        span = f"{factor * x[0]:.4g} to {factor * x[-1]:.4g} {unit}".rstrip()
        return graded(direction * rho, 0.9, 0.5), f"{trend_words(ratios, x, direction)}; {span}"

    return test


def trend_words(ratios: np.ndarray, values: np.ndarray, direction: int = 1) -> str:
    wrong = falling_steps(ratios, direction * values)
    steps = ", ".join(f"{100 * a:.0f}-{100 * b:.0f} %" for a, b in wrong)
    return f"Spearman {spearman(ratios, values):.3f}" + (
        f", against it at {steps}" if wrong else ", no step against it"
    )


def disorderly(values: Callable[[Study], np.ndarray]) -> Callable[[Study], tuple[str, str]]:
    def test(study: Study):
        x = np.asarray(values(study), dtype=float)
        rho = spearman(needs_ratios(study, x), x)
        return graded(abs(rho), 0.6, 0.9), f"Spearman {rho:.3f}"

    return test


def all_trends(named: dict[str, np.ndarray], ratios: np.ndarray) -> tuple[str, str]:
    """The verdict on several rising quantities together: held if each is."""
    rho = {name: spearman(ratios, values) for name, values in named.items()}
    words = ", ".join(f"{name} {value:.3f}" for name, value in rho.items())
    if all(value >= 0.9 for value in rho.values()):
        return HELD, f"Spearman {words}"
    return (PARTLY if max(rho.values()) >= 0.9 or min(rho.values()) >= 0.5 else NOT_HELD), f"Spearman {words}"


def needs_ratios(study: Study, values: np.ndarray) -> np.ndarray:
    if len(study.ratios) < LEAST_RATIOS:
        raise RecognitionError(f"{len(study.ratios)} ratios; a trend needs at least {LEAST_RATIOS}")
    if len(values) != len(study.ratios) or not np.all(np.isfinite(values)):
        raise RecognitionError("not every run has a value")
    return study.ratios
