"""The evaluation of the recognition methods on runs that they were not trained on."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from analysis import RecordError
from analysis.readers import read_table

#: The columns of evaluation.csv that the report shows.
EVALUATION_COLUMNS = ("method", "held_out", "noise_db", "n", "mean_abs_error_points", "p95_points", "worst_points",
                      "bias_points", "coverage_90", "case", "answered", "flagged")  # fmt: skip


def read_evaluation(file: Path) -> pd.DataFrame:
    """Return the rows of evaluation.csv. Raises RecordError if there is no such file or a column is missing."""
    if not file.is_file():
        raise RecordError(f"{file}: no such file; `make dataset` writes it")
    table = read_table(file)
    missing = [name for name in EVALUATION_COLUMNS if name not in table.columns]
    if missing:
        raise RecordError(f"{file}: no column {missing[0]!r}; needs {', '.join(EVALUATION_COLUMNS)}")
    return table
