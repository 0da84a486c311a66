"""The evaluation of the recognition methods on runs that they were not trained on."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from analysis import RecordError
from analysis.readers import read_table

#: The columns of evaluation.csv that the report shows.
EVALUATION_COLUMNS = ("method", "held_out", "noise_db", "n", "mean_abs_error_points", "p95_points", "worst_points",
                      "bias_points", "coverage_90", "case", "answered", "flagged")  # fmt: skip


#: A shortened table of an earlier `make dataset`, for where there is none; its first line says when and of what.
KEPT = Path(__file__).with_name("reference_evaluation.csv")


@dataclass(frozen=True)
class Evaluation:
    """table: the rows of evaluation.csv. kept: "" if it was made here, or where the kept table comes from."""

    table: pd.DataFrame
    kept: str


def read_evaluation(file: Path) -> Evaluation:
    """Return the rows of evaluation.csv, or those of the kept table if there is no such file.

    Raises RecordError if a column is missing.
    """
    if not file.is_file():
        return Evaluation(pd.read_csv(KEPT, comment="#"), KEPT.read_text().splitlines()[0].lstrip("# "))
    table = read_table(file)
    missing = [name for name in EVALUATION_COLUMNS if name not in table.columns]
    if missing:
        raise RecordError(f"{file}: no column {missing[0]!r}; needs {', '.join(EVALUATION_COLUMNS)}")
    return Evaluation(table, "")
