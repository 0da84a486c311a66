"""A study of the laboratory: rows that are made one by one, kept as they come, and made once.

A study is a function `rows(out, **options)` that yields `Row`s, and one that makes the result's table of them. Rows are
kept in OUT/NAME.HASH.csv, HASH that of the sources: a study that was stopped goes on, and one of other code begins
anew.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from common.files.whole import written_whole


@dataclass(frozen=True)
class Row:
    """A row of a table: what tells it from the others, and the work that gives its figures."""

    key: dict[str, Any]
    work: Callable[[], dict[str, Any]]


_waiting: list[Row] = []


def _made(number: int) -> dict[str, Any]:
    return _waiting[number].key | _waiting[number].work()


def made(rows: Iterable[Row], file: Path, jobs: int = 1) -> pd.DataFrame:
    """The rows in their order, those made that `file` lacks, by `jobs` processes; each is printed, and in `file` as
    soon as it is there."""
    wanted = list(rows)
    there = {_name(row, wanted[0].key): row for row in _records(file)} if wanted else {}
    _waiting[:] = [row for row in wanted if _name(row.key, row.key) not in there]
    for found in _made_by(jobs):
        there[_name(found, wanted[0].key)] = found
        print(", ".join(f"{key} {_shown(value)}" for key, value in found.items() if value is not None), flush=True)
        with written_whole(file) as beside:
            pd.DataFrame(list(there.values())).to_csv(beside, index=False)
    return pd.DataFrame([there[_name(row.key, row.key)] for row in wanted])


def _made_by(jobs: int) -> Iterator[dict[str, Any]]:
    if jobs == 1:
        yield from map(_made, range(len(_waiting)))
        return
    # Copies, which know the rows and may have copies of their own.
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("fork")) as pool:
        yield from pool.map(_made, range(len(_waiting)))


def _records(file: Path) -> list[dict[Any, Any]]:
    return pd.read_csv(file).to_dict("records") if file.is_file() else []


def _name(row: dict[Any, Any], key: dict[str, Any]) -> str:
    """The values of the key, however a table of text gives them back."""
    return "|".join(_text(row[name]) for name in key)


def _text(value: object) -> str:
    if value is None or value != value:  # NaN
        return ""
    return f"{value:.10g}" if isinstance(value, (int, float)) and not isinstance(value, bool) else str(value)


def _shown(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
