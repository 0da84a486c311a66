"""Records of a plate's sensors, from files."""

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.files.readers import read_signals
from analysis.signals.records import (
    RAW,
    READ_AS_S,
    Record,
    RecordError,
    refuse_other_unit,
    refuse_scale,
    sample_rate_Hz,
)
from analysis.signals.resampling import resample
from common.channels import name_and_unit, plain_unit, sensor_column, unit_of
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError
from recognition.estimation.window import LEAST_SHARE
from recognition.plate.plate_model import PlateModel

M_S2 = {"m/s^2": 1.0, "mm/s^2": 1e-3, "g": 9.80665}
FORCE_N = {"N": 1.0, "kN": 1e3}
ACCELERATION = re.compile(r"acc_\w+_m_s2")
MOST = 1e30  # of a sample in its unit
LEAST_SAMPLES = 64  # the filters need a run-up
BENDS = 0.3  # of the largest shape: modes that bend the plate


def record_table(path: str | Path, scale: float = 1.0, unit: str | None = None) -> tuple[pd.DataFrame, str]:
    """The table of a run directory or of a file, and which file that is.

    Accelerations are `acc_NAME_m_s2` there. A column `NAME` or `acc_NAME` becomes that where its unit is one of
    M_S2: that in brackets behind its name, or `unit` of all samples after `scale`; `force` in one of FORCE_N becomes
    force_N. RecordError for what cannot be read."""
    path = Path(path)
    source = str(path / "signals.parquet" if path.is_dir() else path)
    unit = known_unit(source, scale, unit)
    table = read_signals(path)
    return pd.concat([table[[]], *(acceleration(table[name], scale, unit, source) for name in table)], axis=1), source


def known_unit(source: str, scale: float, unit: str | None) -> str | None:
    """A unit in the spelling of M_S2. RecordError for another one, and for a scale that is no factor."""
    found = plain_unit(unit) if isinstance(unit, str) else unit
    if found is not None and found not in list(M_S2):
        raise RecordError(f"{source}: unit = {unit!r}; must be one of {', '.join(M_S2)}")
    refuse_scale(source, scale, found)
    return found


def acceleration(column: pd.Series, scale: float, unit: str | None, source: str) -> pd.Series:
    """A column of accelerations in m/s^2, or of the force in N, under its name, NaN where it holds no number; any other
    as it is. RecordError for a unit that is not its own."""
    name, own = name_and_unit(str(column.name))
    if name.lower() == "force" and own in FORCE_N:
        return pd.to_numeric(column, errors="coerce").rename("force_N") * FORCE_N[own]
    if ACCELERATION.fullmatch(name):
        refuse_other_unit(f"{source}: {name}", 1.0, own, "m/s^2")
        own = "m/s^2"
        refuse_other_unit(f"{source}: {name}", scale, unit, own)
    elif unit_of(name) != "1" or own not in (None, *RAW, *M_S2) or (unit or own) not in M_S2:
        return column
    else:
        refuse_other_unit(f"{source}: {name}", scale, unit, own or "1")
        name = sensor_column(name.removeprefix("acc_"))
    return pd.to_numeric(column, errors="coerce").rename(name) * (scale * M_S2[unit or str(own)])


def at_rate(table: pd.DataFrame, rate_Hz: float, source: str, anti_alias: bool = False) -> pd.DataFrame:
    """The signals of a table at another rate, behind an anti-alias filter or without. RecordError."""
    found_Hz = sample_rate_Hz(table["t_s"].to_numpy(dtype=float), f"{source}: t_s")
    if np.isclose(found_Hz, rate_Hz, rtol=1e-3):
        return table
    if found_Hz < rate_Hz * LEAST_SHARE:
        raise RecordError(f"{source}: {found_Hz:.6g} Hz; must be at least {LEAST_SHARE:.0%} of {rate_Hz:.6g} Hz; "
                          f"{READ_AS_S}")
    records = {name: resample(Record(numbers(table, name, source), found_Hz, name=name), rate_Hz, anti_alias=anti_alias)
               for name in table.columns.drop("t_s")}
    t_s = float(table["t_s"].iloc[0]) + next(iter(records.values())).t_s
    return pd.DataFrame({"t_s": t_s, **{name: record.values for name, record in records.items()}})


def read_accelerations(path: str | Path, plate: PlateModel, scale: float = 1.0,
                       unit: str | None = None) -> tuple[pd.DataFrame, Floats, float]:
    """A run directory's or a file's table, its accelerations (s, t) in the order of the plate's sensors, and its sample
    rate, see `record_table`. RecordError for what cannot be read, RecognitionError for a missing column."""
    table, source = record_table(path, scale, unit)
    names = [sensor_column(name) for name in plate.sensor_names]
    for name in ("t_s", *names):
        if name not in table.columns:
            raise RecognitionError(f"{source}: no column {name!r}; needs t_s, {', '.join(names)}; "
                                   f"{what_has(table.columns)}")
    rate_Hz = sample_rate_Hz(numbers(table, "t_s", source), f"{source}: t_s")
    lowest_Hz = float(plate.frequency_Hz[plate.rms_shape > BENDS * plate.rms_shape.max()][0])
    if rate_Hz < 2 * lowest_Hz:
        raise RecognitionError(f"{source}: {rate_Hz:g} samples a second; needs at least {2 * lowest_Hz:g} to show a "
                               f"mode of this plate; {READ_AS_S}")
    return table, np.array([numbers(table, name, source) for name in names]), rate_Hz


def what_has(columns: Iterable[str]) -> str:
    """What a table has where it lacks accelerations, and how these may be called."""
    return f"has {', '.join(list(columns)[:12]) or 'none'}; acc_NAME_m_s2 is also NAME [g], or NAME with --unit g"


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
    if not (usable := abs(values) <= MOST).all():  # of which squares and products are still numbers
        first = int(usable.argmin())
        raise RecordError(f"{source}: {name}: sample {first} is {values[first]:g}; every sample must be finite, and at "
                          f"most {MOST:g}")
    return values
