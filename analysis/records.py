"""Records: any uniformly sampled signal, from memory or from a file.

A `Record` is an array of samples, a sample rate and a unit. It is what every
other module of this package works on, so that features, EMD and spectra can be
taken from a measurement as well as from a simulation.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

# Times written with few digits jitter by the last digit; more than this share
# of the interval is another matter: gaps, or a changing rate.
MAX_TIME_JITTER = 0.01

#: Units of the columns of a run directory, by the ending of their name.
UNIT_BY_SUFFIX = {
    "_m_s2": "m/s^2",
    "_m_s": "m/s",
    "_m2": "m^2",
    "_m": "m",
    "_s": "s",
    "_N": "N",
    "_J": "J",
    "_Pa": "Pa",
}


class RecordError(ValueError):
    """A record cannot be used. The message is one line: file, key, value, what is allowed."""


@dataclass(frozen=True)
class Record:
    """A uniformly sampled signal.

    values: shape (n,), finite floats, in `unit`; rate_Hz: samples per second;
    t0_s: time of the first sample.
    """

    values: np.ndarray
    rate_Hz: float
    unit: str = "1"
    name: str = "signal"
    t0_s: float = 0.0

    def __post_init__(self):
        values = np.asarray(self.values, dtype=float)
        if values.ndim != 1 or values.size < 2:
            raise RecordError(
                f"{self.name}: shape {values.shape}; needs one dimension and at least 2 samples"
            )
        if not np.all(np.isfinite(values)):
            first = int(np.flatnonzero(~np.isfinite(values))[0])
            raise RecordError(f"{self.name}: sample {first} is {values[first]}; every sample must be finite")
        if not (np.isfinite(self.rate_Hz) and self.rate_Hz > 0):
            raise RecordError(f"{self.name}: rate_Hz = {self.rate_Hz}; must be finite and > 0")
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "rate_Hz", float(self.rate_Hz))

    @property
    def dt_s(self) -> float:
        return 1.0 / self.rate_Hz

    @property
    def t_s(self) -> np.ndarray:
        """Sample times, shape (n,)."""
        return self.t0_s + np.arange(self.values.size) / self.rate_Hz


def unit_of(column: str) -> str:
    """Unit of a column by its name's ending, "1" where the name tells none."""
    for suffix, unit in UNIT_BY_SUFFIX.items():
        if column.endswith(suffix):
            return unit
    return "1"


def sample_rate_Hz(t_s: np.ndarray, source: str) -> float:
    """Sample rate of uniformly spaced times; RecordError where they are not."""
    t_s = np.asarray(t_s, dtype=float)
    steps = np.diff(t_s)
    if steps.size == 0 or not np.all(np.isfinite(t_s)) or np.any(steps <= 0):
        raise RecordError(f"{source}: times must be finite and rise from sample to sample")
    dt_s = (t_s[-1] - t_s[0]) / steps.size
    worst = int(np.argmax(np.abs(steps - dt_s)))
    if abs(steps[worst] - dt_s) > MAX_TIME_JITTER * dt_s:
        raise RecordError(
            f"{source}: interval {steps[worst]:.6g} s at sample {worst}, {dt_s:.6g} s in the mean;"
            " needs a uniform sample rate"
        )
    return 1.0 / dt_s


def as_record(
    signal, rate_Hz: float | None = None, *, unit: str | None = None, name: str | None = None
) -> Record:
    """A Record from an array with its rate, from a pandas Series, or from a Record.

    A Series needs no rate if its index is the time in seconds (or a DatetimeIndex
    or TimedeltaIndex). Raises RecordError for a missing or a second, different rate.
    """
    if isinstance(signal, Record):
        if rate_Hz is not None and not np.isclose(rate_Hz, signal.rate_Hz, rtol=1e-6):
            raise RecordError(f"{signal.name}: rate_Hz = {rate_Hz}; the record has {signal.rate_Hz:.6g}")
        return signal
    if isinstance(signal, pd.Series):
        return _from_series(signal, rate_Hz, unit, name)
    if rate_Hz is None:
        raise RecordError(f"{name or 'signal'}: no sample rate; give rate_Hz")
    return Record(np.asarray(signal, dtype=float), rate_Hz, unit or "1", name or "signal")


def _from_series(series: pd.Series, rate_Hz, unit, name) -> Record:
    name = name or (str(series.name) if series.name is not None else "signal")
    unit = unit or unit_of(name)
    index = series.index
    if rate_Hz is not None:
        return Record(series.to_numpy(dtype=float), rate_Hz, unit, name)
    if isinstance(index, pd.DatetimeIndex):
        t_s = (index - index[0]).total_seconds().to_numpy()
    elif isinstance(index, pd.TimedeltaIndex):
        t_s = index.total_seconds().to_numpy()
    elif isinstance(index, pd.RangeIndex) or not pd.api.types.is_float_dtype(index.dtype):
        raise RecordError(f"{name}: no sample rate; give rate_Hz or an index of times in seconds")
    else:
        t_s = index.to_numpy(dtype=float)
    return Record(series.to_numpy(dtype=float), sample_rate_Hz(t_s, name), unit, name, float(t_s[0]))


def read_record(path, *, column: str | None = None, rate_Hz: float | None = None) -> Record:
    """Read one signal from a run directory, a Parquet or a CSV file.

    column: name (or, in a file without names, number from 0) of the signal. Without
    it: `a_m_s2` where there is one, else the only column that is not time. rate_Hz:
    needed where the file has no time column (`t_s`, `time`, `time_s` or `t`).
    Raises RecordError, one line, for everything that keeps it from being read.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "signals.parquet"
    if not path.is_file():
        raise RecordError(f"{path}: no such file; needs a run directory, a .parquet or a .csv file")
    reader = {".parquet": read_table, ".csv": read_table, ".txt": read_table}.get(path.suffix.lower())
    if reader is None:
        raise RecordError(f"{path}: ending {path.suffix!r}; needs one of .parquet, .csv, .txt")
    table = reader(path)
    return _pick(table, str(path), column, rate_Hz)


def read_table(path) -> pd.DataFrame:
    """A Parquet or CSV file as a table; a CSV without names gets columns "0", "1", ..."""
    from pyarrow import ArrowException

    path = Path(path)
    try:
        if path.suffix.lower() == ".parquet":
            return pd.read_parquet(path)
        table = _read_text_table(path)
    except FileNotFoundError:
        raise RecordError(f"{path}: no such file") from None
    except (OSError, ValueError, ArrowException) as error:
        reason = " ".join(str(error).split())
        raise RecordError(f"{path}: not a readable {path.suffix[1:]} table ({reason})") from None
    return table.rename(columns=lambda name: str(name).strip())


def _read_text_table(path: Path) -> pd.DataFrame:
    """Numbers separated by comma, semicolon, tab or blanks, with or without a line of names."""
    with path.open(encoding="utf-8-sig") as file:
        first = file.readline()
    separator = next((mark for mark in ",;\t" if mark in first), r"\s+")
    named = not all(
        _is_number(word) for word in (first.split(separator) if separator in ",;\t" else first.split())
    )
    return pd.read_csv(path, header=0 if named else None, sep=separator, encoding="utf-8-sig")


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


TIME_COLUMNS = ("t_s", "time_s", "time", "t")


def _pick(table: pd.DataFrame, source: str, column: str | None, rate_Hz: float | None) -> Record:
    time = next((name for name in TIME_COLUMNS if name in table.columns), None)
    signals = [name for name in table.columns if name != time]
    if column is None:
        column = "a_m_s2" if "a_m_s2" in signals else (signals[0] if len(signals) == 1 else None)
    if column is None or column not in signals:
        asked = "no column named" if column is None else f"no column {column!r}"
        raise RecordError(f"{source}: {asked}; choose one of {', '.join(signals[:12])}")
    values = pd.to_numeric(table[column], errors="coerce").to_numpy(dtype=float)
    t0_s = 0.0
    if time is not None:
        t_s = table[time].to_numpy(dtype=float)
        found = sample_rate_Hz(t_s, f"{source}: {time}")
        if rate_Hz is not None and not np.isclose(rate_Hz, found, rtol=0.01):
            raise RecordError(f"{source}: rate_Hz = {rate_Hz:g}; its column {time} says {found:.6g}")
        rate_Hz, t0_s = found, float(t_s[0])
    if rate_Hz is None:
        raise RecordError(f"{source}: no time column ({', '.join(TIME_COLUMNS)}); give the sample rate")
    return Record(values, rate_Hz, unit_of(column), f"{source}: {column}", t0_s)
