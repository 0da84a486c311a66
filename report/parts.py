"""The parts of a page, made side by side: first what many of them show, then the rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from common.process.processes import side_by_side
from report.drawing.figure_spec import FigureSpec, FinishedFigure, finish_figure
from report.film.reel import Films, films_of, pack_films
from report.missing import MISSING_RESULT
from report.sweep_results import SweepResults
from report.tables import FinishedTable, TableSpec, finish_table
from report.verdicts import Claim, Statement, check_statements

Spec = FigureSpec | TableSpec
Finished = FinishedFigure | FinishedTable
Work = Callable[[], Any]


#: Results that take long and that several parts show; kept where they are first asked for.
SHARED: tuple[Callable[[SweepResults], object], ...] = (
    lambda results: results.recognition.filtered, lambda results: results.recognition.fused)


@dataclass(frozen=True)
class Parts:
    """Finished figures and tables by their key, the claims in order, and the films."""

    finished: dict[str, Any]
    claims: list[Claim]
    films: Films


def make_parts(results: SweepResults, specs: Sequence[Spec], statements: Sequence[Sequence[Statement]]) -> Parts:
    """Make every part, by as many processes as there are processors.

    The last of `statements` are of the recognised ratios. While other processes recognise the runs, this one checks the
    other statements, for which it finds most of what the figures show, and the rest of what several of them show; the
    figures are drawn by copies of it.
    """
    runs, recognition = range(len(results.runs)), results.recognition
    *early, late = statements
    claims: list[Claim] = []

    def beside() -> None:
        for own in early:
            claims.extend(check_statements(results, own))
        for shared in SHARED:
            _attempt(partial(shared, results))

    _attempt(lambda: recognition.prepared)  # else each process prepares them
    works: list[Work] = [recognition.of_model, *(partial(recognition.held_out, k) for k in runs)]
    model, *held_out = _all(works, beside)
    if not any(isinstance(one, Exception) for one in (model, *held_out)):  # else it is told where it is asked for
        recognition.take(model, held_out)
    rest = _all([partial(check_statements, results, late), *(partial(finish, spec, results) for spec in specs),
                 *(partial(pack_films, results, k) for k in runs)])
    finished, films = rest[1:len(specs) + 1], films_of(results, rest[len(specs) + 1:])
    return Parts({spec.key: one for spec, one in zip(specs, finished, strict=True)}, claims + rest[0], films)


def finish(spec: Spec, results: SweepResults) -> Finished:
    """A figure drawn, or a table filled."""
    return finish_figure(spec, results) if isinstance(spec, FigureSpec) else finish_table(spec, results)


def _all(works: Sequence[Work], beside: Callable[[], object] = lambda: None) -> list[Any]:
    """What each work returns, or the reason that the runs do not give it; beside: done by this process meanwhile."""
    return side_by_side(lambda k: _attempt(works[k]), len(works), beside)


def _attempt(work: Work) -> Any:
    try:
        return work()
    except MISSING_RESULT as reason:
        return reason
