"""What fell in a run, stone by stone, and the true mixing ratio in any window of time.

`stones.parquet` has a row a stone. A stone counts from its first touch of the plate, `first_contact_s`.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import pandas as pd

from analysis.files.readers import read_table
from analysis.signals.records import RecordError
from analysis.sweep.runs import Run

By = Literal["mass", "number"]
COLUMNS = ("material", "radius_m", "arrival_s", "mass_kg", "first_contact_s", "peak_force_N", "broken_area_m2",
           "left_mass_kg", "left_s")


def is_stream(run: Run) -> bool:
    """Do stones come and go in a run, so that it has a table of what left?"""
    return (run.path / "left.parquet").is_file()


def fallen(run: Run) -> pd.DataFrame:
    """stones.parquet of a run, with `is_gangue` beside its columns. Raises RecordError where it is not there."""
    file = run.path / "stones.parquet"
    table = read_table(file)
    missing = [name for name in COLUMNS if name not in table.columns]
    if missing:
        raise RecordError(f"{file}: no column {missing[0]!r}; needs {', '.join(COLUMNS)}")
    return table.assign(is_gangue=table["material"].map(run.scene.kind_of) == "gangue")


def true_ratio(stones: pd.DataFrame, begin_s: float, end_s: float, by: By = "mass") -> float:
    """Share of gangue, 0..1, among the stones (of `fallen`) that first touched the plate in begin_s <= t < end_s, by
    mass or by number. Raises RecordError where there were none."""
    first_s = stones["first_contact_s"].to_numpy()
    here = stones[(first_s >= begin_s) & (first_s < end_s)]
    if here.empty:
        raise RecordError(f"no stone touched the plate first from {begin_s:g} to {end_s:g} s; the ratio needs one")
    weight = here["mass_kg"].to_numpy() if by == "mass" else np.ones(len(here))
    return float(weight[here["is_gangue"].to_numpy()].sum() / weight.sum())
