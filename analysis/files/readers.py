"""Signals from a file: run directories, tables, sound files (WAV by scipy, FLAC by soundfile, extra `records`),
UFF-58, HDF5, MATLAB and LabVIEW."""

from __future__ import annotations

import logging
import struct
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.files.array_files import Arrays, read_hdf5, read_lvm, read_matlab, read_tdms
from analysis.files.text_tables import is_date, read_plain_table, read_text_table
from analysis.files.uff_files import OF_A_TABLE, as_tap, impulse_response, read_uff
from analysis.signals.records import (
    READ_AS_S,
    TIME_COLUMNS,
    Channels,
    Record,
    RecordError,
    check_rate,
    chosen,
    name_and_unit_of_time,
    refuse_other_unit,
    refuse_scale,
    seconds,
    timed_record,
)
from common.channels import name_and_unit, plain_unit, unit_of
from common.files.parquet import read_numbers, read_parquet
from common.input_error import optional_library, raised_as, refuse_unreadable
from common.process.processes import Crashed, apart

# What scipy raises for a broken file, found by tests/fuzz.
BROKEN_WAV = (OSError, ValueError, EOFError, TypeError, UnboundLocalError, ZeroDivisionError, struct.error)


def read_wav(path: Path) -> Channels:
    """The channels of a WAV file by their numbers; whole numbers become shares of full scale, -1..1, which `scale` of
    `read_record` calibrates. Raises RecordError."""
    from scipy.io import wavfile

    try:
        with warnings.catch_warnings(record=True, action="always", category=wavfile.WavFileWarning) as told:
            rate_Hz, samples = wavfile.read(path)
    except BROKEN_WAV as error:
        raise RecordError(f"{path}: not a readable WAV file ({error})") from None
    if any("EOF" in str(one.message) for one in told):  # chunks beside the samples, of a recorder, are no fault
        _log.warning("note: %s: has fewer samples than it says; it may be cut off", path)
    return _channels(path, _shares_of_full_scale(samples), rate_Hz)


def read_flac(path: Path) -> Channels:
    """The channels of a FLAC file, as `read_wav`. Raises RecordError also where soundfile is missing."""
    soundfile = optional_library("soundfile", f"{path}: reading FLAC", "soundfile", RecordError)
    try:
        samples, rate_Hz = soundfile.read(path)
    except (OSError, RuntimeError, ValueError, TypeError) as error:  # its own error is a RuntimeError
        raise RecordError(f"{path}: not a readable FLAC file ({' '.join(str(error).split())})") from None
    return _channels(path, samples, rate_Hz)


def _shares_of_full_scale(samples: np.ndarray) -> np.ndarray:
    """Whole numbers as shares of the largest, -1..1."""
    if not np.issubdtype(samples.dtype, np.integer):
        return samples
    centre = 128.0 if samples.dtype == np.uint8 else 0.0
    return (samples - centre) / (centre or -float(np.iinfo(samples.dtype).min))


def _channels(path: Path, samples: np.ndarray, rate_Hz: float) -> Channels:
    """Of samples (n,) or (n, channels). RecordError where there are none."""
    if samples.size == 0:
        raise RecordError(f"{path}: holds no samples")
    return {str(k): partial(Record, one, float(rate_Hz), "1", f"{path}: {k}")
            for k, one in enumerate(samples.reshape(len(samples), -1).T)}


if TYPE_CHECKING:
    import pandas as pd

_log = logging.getLogger(__name__)
MOST_BYTES = 4e9
SLOW_Hz = 100.0  # for vibration
SHORT_BYTES = 3e6  # of a table that is read sooner than pandas is imported
TABLES = (".parquet", ".csv", ".txt")
CHANNELS = {".wav": read_wav, ".flac": read_flac, ".uff": read_uff, ".unv": read_uff}
ARRAYS = {".mat": read_matlab, ".h5": read_hdf5, ".hdf5": read_hdf5, ".lvm": read_lvm, ".tdms": read_tdms}
ENDINGS = (*TABLES, *CHANNELS, *ARRAYS)
# What such a column is called elsewhere, without the unit that follows in brackets.
TIME_WORDS = (*TIME_COLUMNS, "second", "seconds", "sec", "zeit", "temps", "tiempo", "tempo", "tijd", "czas", "время",
              "时间", "時間")


def read_record(path: str | Path, *, column: str | None = None, rate_Hz: float | None = None, scale: float = 1.0,
                unit: str | None = None, time: str | None = None) -> Record:
    """Read one signal from a run directory, or from a file with one of ENDINGS.

    column: name of the signal, with or without the unit in brackets behind it, or its number from 0 where it has none
    (in a text table without names, a WAV, FLAC or UFF file). Without it the signal is `a_m_s2` where there is one, else
    the only one.
    time: name of the column of times; without it the one that is called so in one of several languages, in s or in the
    unit behind its name, in brackets or after "_". rate_Hz: needed where the file has neither a rate nor times, or
    times that coarse rounding makes uneven.
    scale: factor on the samples, the calibration of a sensor. unit: that of the scaled samples, which goes with it.
    Raises RecordError, one line, if the file cannot be read or leaves the signal or its rate open.

    >>> record = read_record("runs/paper/ratio_030", column="acc_A_m_s2", scale=1000.0, unit="mm/s^2")
    >>> record.values.size, record.unit
    (267, 'mm/s^2')
    """
    unit = plain_unit(unit) if unit else None
    refuse_scale(path, scale, unit)
    path = _file_of(path)
    ending = path.suffix.lower()
    if ending in TABLES:
        record = _from_table(_plain_table(path) or read_table(path), str(path), column, time, rate_Hz)
    elif ending in ARRAYS:
        record = _from_arrays(_arrays(path), str(path), column, time, rate_Hz)
    elif ending in CHANNELS:
        if time is not None:
            raise RecordError(f"{path}: no column of times {time!r}; a file with its own sample rate has none")
        record = chosen(path, column, CHANNELS[ending](path))
        check_rate(record.name, rate_Hz, record.rate_Hz, "the file")
    else:
        raise RecordError(f"{path}: ending {path.suffix!r}; needs one of {', '.join(ENDINGS)}")
    refuse_other_unit(record.name, scale, unit, record.unit)
    return replace(record, values=scale * record.values, unit=unit or record.unit)


def read_signals(path: str | Path) -> pd.DataFrame:
    """Return all signals of a run directory or a file as a table with the times `t_s`, `NAME [unit]` being called what
    no ending says. Frequency responses become a tap of 1 N s, `force_N`. Raises RecordError where signals do not share
    rate and length."""
    import pandas as pd

    path = _file_of(path)
    ending = path.suffix.lower()
    if ending not in (*CHANNELS, *ARRAYS):
        table = read_table(path)
        time = _time_of(list(map(str, table.columns)), str(path), None)
        if time in (None, "t_s"):
            return table
        return table.assign(t_s=seconds(time, _numbers(table[time]), str(path))).drop(columns=time)
    if ending in CHANNELS:
        records = {name: read() for name, read in CHANNELS[ending](path).items()}
    else:
        arrays = _arrays(path)
        records = {name: _from_arrays(arrays, str(path), name, None, None) for name in arrays.signals
                   if not _says_time(_last(name))}
    if len({(record.values.size, record.rate_Hz) for record in records.values()}) != 1:
        names = ", ".join(list(records)[:12])
        raise RecordError(f"{path}: needs signals of one rate and one length; has {names or 'none'}")
    records = as_tap(records)
    t_s = next(iter(records.values())).t_s
    signals = {_with_unit(_last(name), record.unit): record.values for name, record in records.items()}
    return pd.DataFrame({"t_s": t_s, **signals})


def _file_of(path: str | Path) -> Path:
    """The file that holds the signals. Raises RecordError where there is none that can be read."""
    path = Path(path) / "signals.parquet" if Path(path).is_dir() else Path(path)
    _refuse_unreadable(path)
    if not path.is_file():
        raise RecordError(f"{path}: no such file; needs a run directory or one of {', '.join(ENDINGS)}")
    return path


def _with_unit(name: str, unit: str) -> str:
    return name if unit_of(name) == unit else f"{name} [{unit}]"


def read_table(path: str | Path, columns: Sequence[str] | None = None) -> pd.DataFrame:
    """Return a Parquet or text table (`analysis.files.text_tables`); columns of a text without names are "0", "1", ...,
    an index with a name is a column, and dates, ISO 8601 where they are text, and times of day are seconds from the
    first one.

    columns: those wanted of a Parquet table, which takes as many times less to read; all if None.
    Raises RecordError if it cannot be read, lacks one of them, or if a column appears twice.
    """
    import pandas as pd
    from pyarrow import ArrowException

    path = Path(path)
    _refuse_unreadable(path)
    try:
        table = read_parquet(path, columns) if path.suffix.lower() == ".parquet" else read_text_table(path)
    except FileNotFoundError:
        raise RecordError(f"{path}: no such file") from None
    except RecordError:
        raise
    except (OSError, ValueError, ArrowException) as error:
        reason = " ".join(str(error).split())
        raise RecordError(f"{path}: not a readable {path.suffix[1:]} table ({reason})") from None
    if table.index.name is not None:
        table = table.reset_index()
    table = table.rename(columns=lambda name: str(name).strip())
    if not table.columns.is_unique:
        raise RecordError(f"{path}: column {table.columns[table.columns.duplicated()][0]!r} appears twice")
    for text in table.columns[[is_date(one) for one in table.iloc[0]]] if len(table) else ():
        of_day = ":" in table[text].iloc[0][:3]
        table[text] = (pd.to_timedelta(table[text], errors="coerce") if of_day else
                       pd.to_datetime(table[text], format="ISO8601", utc=True, errors="coerce"))
    for name in table.select_dtypes(["datetime", "datetimetz", "timedelta"]):  # pandas would count them in ns
        table[name] = (table[name] - table[name].min()).dt.total_seconds()
    return table


def _plain_table(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of a short table of numbers; nothing of any other, which `read_table` reads or refuses."""
    if path.stat().st_size > SHORT_BYTES:
        return {}
    try:
        found = (read_numbers if path.suffix.lower() == ".parquet" else read_plain_table)(path)
    except (OSError, ValueError):
        return {}
    names = [name.strip() for name in found]
    return dict(zip(names, found.values(), strict=True)) if len(set(names)) == len(names) else {}


def _arrays(path: Path) -> Arrays:
    """MATLAB and HDF5 files are read in a process of their own: a damaged one can crash scipy, or HDF5's library."""
    read = ARRAYS[path.suffix.lower()]
    try:
        return apart(lambda: read(path)) if read in (read_matlab, read_hdf5) else read(path)
    except Crashed:
        raise RecordError(f"{path}: not a readable {path.suffix[1:]} file (its library crashes on it)") from None


def _refuse_unreadable(path: Path) -> None:
    with raised_as(RecordError):
        refuse_unreadable(path, MOST_BYTES)


def _from_table(table: Mapping[str, Any] | pd.DataFrame, source: str, column: str | None, time: str | None,
                rate_Hz: float | None) -> Record:
    names = list(map(str, table))
    if [name_and_unit(name)[0].lower() for name in names] == list(OF_A_TABLE):
        frequency_Hz, real, imaginary = (_numbers(table[name]) for name in names)
        return impulse_response(frequency_Hz, real + 1j * imaginary, name_and_unit(names[1])[1] or "1", source)
    asked, time = time, _time_of(names, source, time)
    column = _signal_of([name for name in names if name != time], source, column)
    t_s = None if time is None else seconds(time, _numbers(table[time]), source)
    if asked is None and rate_Hz is not None and t_s is not None and np.isnan(t_s).all():
        time = t_s = None  # of text that is no date
    record = timed_record(f"{source}: {column}", _numbers(table[column]), unit_of(column), rate_Hz, time, t_s)
    if time is not None and name_and_unit_of_time(time)[1] is None and record.rate_Hz < SLOW_Hz:
        _log.warning("note: %s: %.6g Hz by its %s; %s", source, record.rate_Hz, time, READ_AS_S)
    return record


def _from_arrays(arrays: Arrays, source: str, column: str | None, time: str | None, rate_Hz: float | None) -> Record:
    names = [name for name in arrays.signals if not _says_time(_last(name)) and _last(name) != time]
    column = _signal_of(names, source, column)
    beside, values = arrays.beside(column), arrays.signals[column]
    unit = plain_unit(arrays.unit(column))
    time, name = _time_of(list(beside), source, time), f"{source}: {column}"
    if time is not None:
        return timed_record(name, values, unit, rate_Hz, time, seconds(time, beside[time], source))
    found = arrays.rate_Hz(column)
    if found is not None:
        check_rate(name, rate_Hz, found, "the file")
    return timed_record(name, values, unit, found or rate_Hz, None, None)


def _says_time(name: str) -> bool:
    return name_and_unit_of_time(name)[0].lower() in TIME_WORDS


def _last(name: str) -> str:
    return name.rsplit("/", 1)[-1]


def _time_of(names: list[str], source: str, asked: str | None) -> str | None:
    """The column of times: the one asked for, else the one that is called so."""
    if asked is not None:
        return _same(names, asked) or _refuse(source, f"no column of times {asked!r}", names)
    exact = [name for name in TIME_COLUMNS if name in names]
    return next(iter(exact or [name for name in names if _says_time(name)]), None)


def _signal_of(names: list[str], source: str, asked: str | None) -> str:
    """The column of the signal: the one asked for, else `a_m_s2`, else the only one with a name."""
    if asked is not None:
        return _same(names, asked) or _refuse(source, f"no column {asked!r}", names)
    if "a_m_s2" in names:
        return "a_m_s2"
    if not names:
        raise RecordError(f"{source}: holds no signal, which is an array of real numbers")
    named = [name for name in names if name] or names  # pandas writes an index without a name
    return named[0] if len(named) == 1 else _refuse(source, "no column named", names)


def _same(names: Iterable[str], asked: str) -> str | None:
    """The name that is meant: the very one, or the only one that is the same without group or unit."""
    names = list(names)
    if asked in names:
        return asked
    alike = [name for name in names if asked in (name_and_unit(name)[0], _last(name))]
    return alike[0] if len(alike) == 1 else None


def _refuse(source: str, what: str, names: list[str]) -> str:
    raise RecordError(f"{source}: {what}; choose one of {', '.join(names[:12])}")


def _numbers(column: pd.Series | np.ndarray) -> np.ndarray:
    """Return the column as floats, NaN where it holds no number: a Record then refuses that sample by its number."""
    if isinstance(column, np.ndarray):
        return column
    import pandas as pd

    return pd.to_numeric(column, errors="coerce").to_numpy(dtype=float, na_value=np.nan)
