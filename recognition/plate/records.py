"""Records of a plate's sensors, from files."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from analysis.readers import read_table
from analysis.records import sample_rate_Hz
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError
from recognition.plate.plate_model import PlateModel


def read_accelerations(path: str | Path, plate: PlateModel) -> tuple[pd.DataFrame, Floats, float]:
    """A run directory's or a file's table, its accelerations (s, t) in the order of the plate's sensors, and its sample
    rate. RecordError for what cannot be read, RecognitionError for a missing column."""
    path = Path(path)
    path = path / "signals.parquet" if path.is_dir() else path
    table, names = read_table(path), [f"acc_{name}_m_s2" for name in plate.sensor_names]
    for name in ("t_s", *names):
        if name not in table.columns:
            raise RecognitionError(f"{path}: no column {name!r}; needs t_s, {', '.join(names)}")
    rate_Hz = sample_rate_Hz(table["t_s"].to_numpy(dtype=float), f"{path}: t_s")
    return table, table[names].to_numpy(dtype=float).T, rate_Hz
