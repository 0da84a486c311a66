"""The parts of a page, made side by side: first what many of them show, then the rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from common.process.processes import side_by_side
from report.missing import MISSING_RESULT
from report.sweep_results import SweepResults
from report.verdicts import Claim, Statement, check_statements

Work = Callable[[], Any]


def make_parts(results: SweepResults, works: Sequence[Work], statements: Sequence[Sequence[Statement]],
               recognises: bool) -> tuple[list[Any], list[Claim]]:
    """Return what each work returns, and the claims in order, made by as many processes as there are processors.

    The last of `statements` are of the recognised ratios. While other processes recognise the runs, this one checks the
    other statements, for which it finds most of what the figures show; the figures are drawn by copies of it.
    """
    claims: list[Claim] = []
    *early, late = statements

    def beside() -> None:
        for own in early:
            claims.extend(check_statements(results, own))
        if recognises:
            attempt(lambda: results.recognition.filtered)
            attempt(lambda: results.recognition.fused)

    if recognises:
        recognition, runs = results.recognition, range(len(results.runs))
        attempt(lambda: recognition.prepared)  # else each process prepares them
        model, *held_out = all_of([lambda: (recognition.model, recognition.by_all),
                                   *(partial(lambda k: recognition.prepared.answers_without(k), k) for k in runs)],
                                  beside)
        if not any(isinstance(one, Exception) for one in (model, *held_out)):  # else it is told where it is asked for
            (recognition.model, recognition.by_all), recognition.held_out = model, held_out
    else:
        beside()
    last, *made = all_of([partial(check_statements, results, late), *works])
    return made, claims + last


def all_of(works: Sequence[Work], beside: Callable[[], object] = lambda: None) -> list[Any]:
    """What each work returns, or the reason that the runs do not give it; beside: done by this process meanwhile."""
    return side_by_side(lambda k: attempt(works[k]), len(works), beside)


def attempt(work: Work) -> Any:
    try:
        return work()
    except MISSING_RESULT as reason:
        return reason
