"""The parts of a page, made side by side: first those that are needed by others or need none, then the rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from common.processes import side_by_side
from report.chapters.figure_spec import FigureSpec, FinishedFigure, finish_figure
from report.claims.verdicts import Claim, Statement, check_statements
from report.film.reel import Films, films_of, pack_films
from report.results.missing import MISSING_RESULT
from report.results.sweep_results import SweepResults
from report.tables import FinishedTable, TableSpec, finish_table

Spec = FigureSpec | TableSpec
Finished = FinishedFigure | FinishedTable
Work = Callable[[], Any]


@dataclass(frozen=True)
class Parts:
    """Finished figures and tables by their key, the claims in order, and the films."""

    finished: dict[str, Any]
    claims: list[Claim]
    films: Films


def make_parts(results: SweepResults, specs: Sequence[Spec], recognising: Sequence[Spec],
               statements: Sequence[Sequence[Statement]]) -> Parts:
    """Make every part, by as many processes as there are processors.

    recognising: figures and tables that need the recognised ratios, as `statements` do. The runs are recognised beside
    `specs` and the films, and the results taken into this process before the rest is begun.
    """
    runs, recognition = range(len(results.runs)), results.recognition
    first: list[Work] = [recognition.of_model, *(partial(recognition.held_out, k) for k in runs)]
    found = _all([*first, *(partial(finish, spec, results) for spec in specs),
                  *(partial(pack_films, results, k) for k in runs)])
    (model, *held_out), found = found[:len(first)], found[len(first):]
    if not any(isinstance(one, Exception) for one in (model, *held_out)):  # else it is told where it is asked for
        recognition.take(model, held_out)
    finished, films = found[:len(specs)], films_of(results, found[len(specs):])
    rest = _all([*(partial(finish, spec, results) for spec in recognising),
                 *(partial(check_statements, results, own) for own in statements)])
    finished += rest[:len(recognising)]
    keys = [spec.key for spec in (*specs, *recognising)]
    return Parts(dict(zip(keys, finished, strict=True)), sum(rest[len(recognising):], []), films)


def finish(spec: Spec, results: SweepResults) -> Finished:
    """A figure drawn, or a table filled."""
    return finish_figure(spec, results) if isinstance(spec, FigureSpec) else finish_table(spec, results)


def _all(works: Sequence[Work]) -> list[Any]:
    """What each work returns, or the reason that the runs do not give it."""
    return side_by_side(lambda k: _attempt(works[k]), len(works))


def _attempt(work: Work) -> Any:
    try:
        return work()
    except MISSING_RESULT as reason:
        return reason
