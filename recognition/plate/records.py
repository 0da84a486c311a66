"""Records of a plate's sensors, from files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from analysis.files.readers import read_table
from analysis.signals.records import RecordError, sample_rate_Hz
from common.channels import sensor_column
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError
from recognition.plate.plate_model import PlateModel

MOST = 1e30  # of a sample in its unit
LEAST_SAMPLES = 64  # the filters need a run-up
BENDS = 0.3  # of the largest shape: modes that bend the plate


def record_table(path: str | Path) -> tuple[pd.DataFrame, str]:
    """The table of a run directory or of a file, and which file that is. RecordError for what cannot be read."""
    path = Path(path)
    path = path / "signals.parquet" if path.is_dir() else path
    return read_table(path), str(path)


def read_accelerations(path: str | Path, plate: PlateModel) -> tuple[pd.DataFrame, Floats, float]:
    """A run directory's or a file's table, its accelerations (s, t) in the order of the plate's sensors, and its sample
    rate. RecordError for what cannot be read, RecognitionError for a missing column."""
    table, source = record_table(path)
    names = [sensor_column(name) for name in plate.sensor_names]
    for name in ("t_s", *names):
        if name not in table.columns:
            raise RecognitionError(f"{source}: no column {name!r}; needs t_s, {', '.join(names)}")
    rate_Hz = sample_rate_Hz(numbers(table, "t_s", source), f"{source}: t_s")
    lowest_Hz = float(plate.frequency_Hz[plate.rms_shape > BENDS * plate.rms_shape.max()][0])
    if rate_Hz < 2 * lowest_Hz:
        raise RecognitionError(f"{source}: {rate_Hz:g} samples a second; needs at least {2 * lowest_Hz:g} to show a "
                               "mode of this plate; t_s must be in s")
    return table, np.array([numbers(table, name, source) for name in names]), rate_Hz


def numbers(table: pd.DataFrame, name: str, source: object) -> Floats:
    """The samples (t,) of a column. RecordError for fewer than LEAST_SAMPLES, for one that is not finite or above MOST,
    and for two columns of this name."""
    column = table[name]
    try:
        values = np.asarray(column.to_numpy(dtype=float), float)
    except (TypeError, ValueError):
        raise RecordError(f"{source}: {name}: must be numbers") from None
    if values.ndim != 1:
        raise RecordError(f"{source}: {name}: is there {values.shape[1]} times; must be there once")
    if values.size < LEAST_SAMPLES:
        raise RecordError(f"{source}: {name}: {values.size} samples; needs at least {LEAST_SAMPLES}")
    if not (abs(values) <= MOST).all():  # of which squares and products are still numbers
        raise RecordError(f"{source}: {name}: every sample must be finite, and at most {MOST:g}")
    return values
