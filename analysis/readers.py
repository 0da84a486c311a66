"""Files of one signal: Parquet and CSV tables, run directories, WAV and UFF-58 of measurement systems."""

from __future__ import annotations

import struct
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.records import Record, RecordError, as_record, sample_rate_Hz
from common.units import unit_of

TABLES = (".parquet", ".csv", ".txt")
ENDINGS = (*TABLES, ".wav", ".uff", ".unv")
TIME_COLUMNS = ("t_s", "time_s", "time", "t")

# What scipy raises for a broken file, found by tests/fuzz.
BROKEN_WAV = (OSError, ValueError, EOFError, TypeError, UnboundLocalError, ZeroDivisionError, struct.error)
TIME_DOMAIN = 1  # func_type of a time response in UFF dataset 58


def read_record(
    path: str | Path,
    *,
    column: str | None = None,
    rate_Hz: float | None = None,
    scale: float = 1.0,
    unit: str | None = None,
) -> Record:
    """Read one signal from a run directory, or from a Parquet, CSV, WAV or UFF-58 file.

    column: name of the signal, or its number from 0 where it has none (in a CSV file without names, a WAV or UFF file).
    Without it the signal is `a_m_s2` where there is one, else the only one.
    rate_Hz: needed where the file has neither a rate nor a time column (`t_s`, `time_s`, `time`, `t`).
    scale: factor on the samples, the calibration of a sensor. unit: that of the scaled samples.
    Raises RecordError, one line, if the file cannot be read or leaves the signal or its rate open.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "signals.parquet"
    if not path.is_file():
        raise RecordError(f"{path}: no such file; needs a run directory or one of {', '.join(ENDINGS)}")
    ending = path.suffix.lower()
    if ending in TABLES:
        record = _pick(read_table(path), str(path), column, rate_Hz)
    elif ending in ENDINGS:
        record = as_record((read_wav if ending == ".wav" else read_uff)(path, column), rate_Hz)
    else:
        raise RecordError(f"{path}: ending {path.suffix!r}; needs one of {', '.join(ENDINGS)}")
    if not (np.isfinite(scale) and scale != 0):
        raise RecordError(f"{path}: scale = {scale}; must be finite and not 0")
    return replace(record, values=scale * record.values, unit=unit or record.unit)


def read_table(path: str | Path) -> pd.DataFrame:
    """Return a Parquet or CSV file as a table; the columns of a CSV file without names are "0", "1", ...

    Raises RecordError if it cannot be read, or if a column appears twice.
    """
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
    table = table.rename(columns=lambda name: str(name).strip())
    if not table.columns.is_unique:
        raise RecordError(f"{path}: column {table.columns[table.columns.duplicated()][0]!r} appears twice")
    return table


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


def _pick(table: pd.DataFrame, source: str, column: str | None, rate_Hz: float | None) -> Record:
    time = next((name for name in TIME_COLUMNS if name in table.columns), None)
    signals = [name for name in table.columns if name != time]
    if column is None:
        column = "a_m_s2" if "a_m_s2" in signals else (signals[0] if len(signals) == 1 else None)
    if column is None or column not in signals:
        asked = "no column named" if column is None else f"no column {column!r}"
        raise RecordError(f"{source}: {asked}; choose one of {', '.join(signals[:12])}")
    values = _numbers(table[column])
    t0_s = 0.0
    if time is not None:
        t_s = _numbers(table[time])
        found = sample_rate_Hz(t_s, f"{source}: {time}")
        if rate_Hz is not None and not np.isclose(rate_Hz, found, rtol=0.01):
            raise RecordError(f"{source}: rate_Hz = {rate_Hz:g}; its column {time} says {found:.6g}")
        rate_Hz, t0_s = found, float(t_s[0])
    if rate_Hz is None:
        raise RecordError(f"{source}: no time column ({', '.join(TIME_COLUMNS)}); give the sample rate")
    return Record(values, rate_Hz, unit_of(column), f"{source}: {column}", t0_s)


def _numbers(column: pd.Series) -> np.ndarray:
    """Return the column as floats, NaN where it holds no number: a Record then refuses that sample by its number."""
    return pd.to_numeric(column, errors="coerce").to_numpy(dtype=float, na_value=np.nan)


def read_wav(path: str | Path, channel: str | None = None) -> Record:
    """Return one channel of a WAV file; whole numbers become shares of full scale, -1..1.

    The channel is a number from 0, needed where there are several. `scale` of `read_record` calibrates the samples.
    Raises RecordError if the file cannot be read or the channel is left open.
    """
    from scipy.io import wavfile

    path = Path(path)
    try:
        with warnings.catch_warnings():
            # Chunks beside the samples (calibration notes of a recorder) are no fault.
            warnings.simplefilter("ignore", wavfile.WavFileWarning)
            rate_Hz, samples = wavfile.read(path)
    except BROKEN_WAV as error:
        raise RecordError(f"{path}: not a readable WAV file ({error})") from None
    if samples.size == 0:
        raise RecordError(f"{path}: holds no samples")
    if np.issubdtype(samples.dtype, np.integer):
        limits = np.iinfo(samples.dtype)
        centre = 128.0 if samples.dtype == np.uint8 else 0.0
        samples = (samples - centre) / (centre or -float(limits.min))
    samples = samples.reshape(len(samples), -1)
    number = _choose(path, channel, [str(i) for i in range(samples.shape[1])])
    return Record(samples[:, number], float(rate_Hz), "1", f"{path}: {number}")


def read_uff(path: str | Path, dataset: str | None = None) -> Record:
    """Return one time response (dataset 58) of a UFF file, ASCII or binary.

    The dataset is its number from 0 among the time responses, or its first identification line; it is needed where
    there are several. Raises RecordError if the file cannot be read, the dataset is left open or the package pyuff is
    missing.
    """
    try:
        import pyuff
    except ImportError:
        raise RecordError(f"{path}: reading UFF needs the package pyuff (pip install pyuff)") from None

    path = Path(path)
    try:
        sets = pyuff.UFF(str(path)).read_sets()
    except Exception as error:  # noqa: BLE001  pyuff raises bare Exception for a broken file
        raise RecordError(f"{path}: not a readable UFF file ({' '.join(str(error).split())})") from None
    sets = sets if isinstance(sets, list) else [sets]
    responses = [s for s in sets if s.get("type") == 58 and s.get("func_type") == TIME_DOMAIN]
    if not responses:
        raise RecordError(f"{path}: no time response; needs a dataset 58 with function type 1")
    labels = [str(s.get("id1", "")).strip() for s in responses]
    if dataset in labels and labels.count(dataset) == 1:
        number = labels.index(dataset)
    else:
        number = _choose(path, dataset, [str(i) for i in range(len(responses))])
    chosen = responses[number]
    if np.iscomplexobj(chosen["data"]) or not chosen.get("abscissa_spacing"):
        raise RecordError(f"{path}: dataset {number} is complex or unevenly spaced; needs real, even samples")
    unit = str(chosen.get("ordinate_axis_units_lab", "")).strip()
    unit = "1" if unit.upper() in ("", "NONE") else unit
    return Record(chosen["data"], 1.0 / chosen["abscissa_inc"], unit, f"{path}: {labels[number] or number}",
                  float(chosen.get("abscissa_min", 0.0)))  # fmt: skip


def _choose(path: Path, asked: str | None, names: list[str]) -> int:
    if asked is None and len(names) == 1:
        return 0
    if asked not in names:
        found = "none named" if asked is None else f"no signal {asked!r}"
        raise RecordError(f"{path}: {found}; choose one of 0..{len(names) - 1}")
    return names.index(asked)
