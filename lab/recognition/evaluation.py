"""Every method, those of a model and the baselines, on runs of a data set that it was not trained on; and the least error
that noise and scatter leave to any (error_bounds.py)."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import pandas as pd

from lab.recognition.baselines import EVALUATED
from lab.recognition.error_bounds import bounds
from lab.recognition.superposed import superposed
from lab.study import Row
from recognition.evaluation.cross_validation import CASES, Case, Evaluation, summary
from recognition.evaluation.dataset import read_dataset

FAMILIES, NOISE_db = ("clean", "stones", "natural", "wide"), 20.0


def recognise_families(out: Path, runs: int = 44) -> Iterator[Row]:
    """Every method on superposed runs of each family, 20 dB of noise on every sensor."""
    families, directory = [case for case in CASES if case.name in FAMILIES], out / "families"

    @cache
    def evaluation() -> Evaluation:
        for row in superposed(directory, runs=runs, families=FAMILIES):
            row.work()
        return Evaluation(read_dataset(directory))

    def found(case: Case, name: str) -> dict[str, Any]:
        return summary(evaluation().run(case, name, EVALUATED[name], (NOISE_db,))[0])

    for name in EVALUATED:
        for case in families:
            yield Row({"method": name, "family": case.name}, partial(found, case, name))


def recognise_families_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """A row a method: mean and worst error in points, and coverage of 90 % intervals in per cent, by family."""
    rows = rows.assign(coverage=100 * rows["coverage_90"].astype(float))
    names = {"mean_abs_error_points": "mean", "worst_points": "worst", "coverage": "inside", "answered": "answered"}
    wide = rows.pivot(index="method", columns="family", values=list(names)).reindex(list(EVALUATED))
    wide.columns = pd.Index([f"{column[1]}_{names[column[0]]}" for column in wide.columns.tolist()])
    return wide.reset_index()


def error_bounds(out: Path, dataset: str = "runs/dataset") -> Iterator[Row]:
    """All bounds at once, as JSON."""
    yield Row({"dataset": dataset}, lambda: {"bounds": bounds(read_dataset(dataset)).to_json(orient="records")})


def error_bounds_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    return pd.DataFrame(json.loads(rows["bounds"].iloc[0]))
