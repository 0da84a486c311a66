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
from lab.study import Row
from recognition.evaluation.cross_validation import CASES, NOISES_DB, Case, Evaluation, summary
from recognition.evaluation.dataset import read_dataset


def recognise_evaluation(out: Path, dataset: str = "runs/dataset") -> Iterator[Row]:
    """Every case and method at every noise."""
    evaluation = cache(lambda: Evaluation(read_dataset(dataset)))

    @cache
    def results(case: Case, name: str) -> dict[float | None, dict[str, Any]]:
        return {one.noise_db: summary(one) for one in evaluation().run(case, name, EVALUATED[name])}

    for case in CASES:
        for name in EVALUATED:
            for noise_db in NOISES_DB:
                yield Row({"case": case.name, "method": name, "noise_db": noise_db},
                          partial(lambda case, name, noise_db: results(case, name)[noise_db], case, name, noise_db))


def error_bounds(out: Path, dataset: str = "runs/dataset") -> Iterator[Row]:
    """All bounds at once, as JSON."""
    yield Row({"dataset": dataset}, lambda: {"bounds": bounds(read_dataset(dataset)).to_json(orient="records")})


def error_bounds_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    return pd.DataFrame(json.loads(rows["bounds"].iloc[0]))
