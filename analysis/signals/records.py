"""Records: any uniformly sampled signal, from memory or from a file.

A `Record` is an array of samples with a sample rate and a unit. Every other module of this package works on records, so
that features, EMD and spectra can be taken from a measurement as well as from a simulation.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias, TypeGuard

import numpy as np
from numpy.typing import ArrayLike

from common.by_value import ByValue
from common.channels import name_and_unit, unit_of
from common.input_error import InputError

if TYPE_CHECKING:
    import pandas as pd

# Share of the interval. More means gaps, or a rate that changes, unless times are rounded.
MAX_TIME_JITTER = 0.01
# Rounded times are up to their last digit off even ones from the first to the last; a lost sample moves them by half an
# interval, less a digit. More digits in an interval than this tell one from the other.
DIGITS_OF_AN_INTERVAL = 4
TIME_COLUMNS = ("t_s", "time_s", "time", "t")
READ_AS_S = "times without a unit are read in s: a column in ms must be called t [ms]"
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}
RAW = ("1", "-", "%", "V", "mV", "mA")  # units of samples that a sensor's calibration is still to come for
CLIPPED_RUN, CLIPPED_COUNT = 3, 4  # samples at the very largest value, on end and in all
LEAST_INTERVAL_s = 1e-12  # of which a rate, and its whole number, are far from the ends of what numbers hold


class RecordError(InputError):
    """A record cannot be used. The message is one line: file, key, value, what is allowed.

    >>> Record([1.0, float("nan")], rate_Hz=1000.0)
    Traceback (most recent call last):
    analysis.signals.records.RecordError: signal: sample 1 is nan; every sample must be finite
    """


@dataclass(frozen=True, eq=False)
class Record(ByValue):
    """A uniformly sampled signal: finite values (n,) in `unit`, from the time `t0_s` on.

    Raises RecordError for values of another shape, a rate that is not positive, and what is not finite.

    >>> Record([0.0, 2.0, 1.0], rate_Hz=1000.0, unit="m/s^2").t_s.tolist()
    [0.0, 0.001, 0.002]
    """

    values: np.ndarray
    rate_Hz: float
    unit: str = "1"
    name: str = "signal"
    t0_s: float = 0.0

    def __post_init__(self) -> None:
        try:
            if (kind := np.asanyarray(self.values).dtype.kind) in "cmM":
                raise RecordError(f"{self.name}: {'complex numbers' if kind == 'c' else 'dates'}; needs real numbers")
            values = np.ma.filled(np.asanyarray(self.values, dtype=float), np.nan)
        except RecordError:
            raise
        except (TypeError, ValueError):
            raise RecordError(f"{self.name}: every sample must be a number") from None
        if values.ndim != 1 or values.size < 2:
            raise RecordError(f"{self.name}: shape {values.shape}; needs one dimension and at least 2 samples")
        if not np.all(np.isfinite(values)):
            first = int(np.flatnonzero(~np.isfinite(values))[0])
            raise RecordError(f"{self.name}: sample {first} is {values[first]}; every sample must be finite")
        object.__setattr__(self, "values", values)
        for key, above, allowed in (("rate_Hz", 0.0, " and > 0"), ("t0_s", -np.inf, "")):
            try:
                number = float(getattr(self, key))
            except (TypeError, ValueError):
                number = np.nan
            if not above < number < np.inf:
                raise RecordError(f"{self.name}: {key} = {getattr(self, key)}; must be finite{allowed}")
            object.__setattr__(self, key, number)

    @property
    def dt_s(self) -> float:
        return 1.0 / self.rate_Hz

    @property
    def t_s(self) -> np.ndarray:
        """Sample times, shape (n,)."""
        return self.t0_s + np.arange(self.values.size) / self.rate_Hz


def refuse_scale(source: object, scale: float, unit: str | None) -> None:
    """RecordError for a scale that is no factor, or whose samples are in nobody knows which unit."""
    if not (np.isfinite(scale) and scale != 0):
        raise RecordError(f"{source}: scale = {scale}; must be finite and not 0")
    if scale != 1.0 and unit is None:
        raise RecordError(f"{source}: scale = {scale:g}; needs the unit of the scaled samples as well, such as m/s^2")


def refuse_other_unit(source: object, scale: float, unit: str | None, own: str) -> None:
    """RecordError for another unit than the `own` one of samples that no scale takes from one to the other."""
    if scale == 1.0 and unit is not None and own not in (unit, *RAW):
        raise RecordError(f"{source}: unit = {unit!r}; samples are in {own!r}, and no scale goes from one to the other")


def name_and_unit_of_time(name: str) -> tuple[str, str | None]:
    """("Zeit", "ms") of "Zeit [ms]" or "Zeit_ms"; None where there is no unit."""
    word, unit = name_and_unit(name)
    stem, _, last = word.rpartition("_")
    return (stem, last) if unit is None and last in SECONDS else (word, unit)


def seconds(name: str, times: np.ndarray, source: str) -> np.ndarray:
    """Times in s by the unit behind their name, in brackets or after "_", s where there is none."""
    unit = name_and_unit_of_time(name)[1] or "s"
    if unit not in SECONDS:
        raise RecordError(f"{source}: times {name!r} in {unit!r}; allowed are {', '.join(SECONDS)}")
    return SECONDS[unit] * times


Signal: TypeAlias = "ArrayLike | pd.Series | Record"  # of which `as_record` makes a Record
Channels = dict[str, Callable[[], Record]]  # of a file, by name


def sample_rate_Hz(t_s: np.ndarray, source: str, may_be_rounded: bool = True) -> float:
    """Return the sample rate of times (n,). Raises RecordError where they are not uniformly spaced, but for rounding to
    as many digits as they have, or closer than anything is sampled."""
    t_s = np.asarray(t_s, dtype=float)
    steps = np.diff(t_s)
    if steps.size == 0:
        raise RecordError(f"{source}: has {t_s.size} samples; must have at least 2")
    if not (rise := np.append(np.isfinite(t_s[0]), steps > 0)).all():
        raise RecordError(f"{source}: times must be finite numbers, or dates such as 2026-11-28T10:00:00.001, and rise "
                          f"from sample to sample; sample {rise.argmin()} does not")
    dt_s = (t_s[-1] - t_s[0]) / steps.size
    worst = int(np.argmax(np.abs(steps - dt_s)))
    if abs(steps[worst] - dt_s) > MAX_TIME_JITTER * dt_s and not (may_be_rounded and _even_but_rounded(t_s, dt_s)):
        raise RecordError(f"{source}: interval {steps[worst]:.6g} s at sample {worst}, {dt_s:.6g} s in the mean; needs "
                          "a uniform sample rate")
    if dt_s < LEAST_INTERVAL_s:
        raise RecordError(f"{source}: {dt_s:.6g} s from sample to sample; must be at least {LEAST_INTERVAL_s:g} s")
    return 1.0 / dt_s


def last_digit_s(t_s: np.ndarray) -> float:
    """What finite times are rounded to: the last digit that they have, or what their size leaves of numbers in double
    or single precision."""
    with np.errstate(over="ignore"):
        t_s, single = t_s.astype(float), t_s.astype(np.float32)
        digit = next((10.0**-k for k in range(10) if np.allclose(t_s.round(k), t_s, rtol=1e-15, atol=0)), 0.0)
        return max(digit, float(np.spacing(abs(single if (single == t_s).all() else t_s).max())))


def _even_but_rounded(t_s: np.ndarray, dt_s: float) -> bool:
    """Whether times are even ones, all rounded alike, whose mean interval is known as well as that of others."""
    digit_s, off_s = last_digit_s(t_s), t_s - t_s[0] - np.arange(t_s.size) * dt_s
    return bool(abs(off_s).max() <= digit_s * (1 + 1e-6) and DIGITS_OF_AN_INTERVAL * digit_s < dt_s
                and digit_s < MAX_TIME_JITTER * (t_s[-1] - t_s[0]))


def chosen(path: str | Path, asked: str | None, channels: Channels) -> Record:
    """Return the channel `asked`, a name or a number from 0, or the only one. Raises RecordError."""
    known = {str(k): one for k, one in enumerate(channels.values())} | channels
    asked = "0" if asked is None and len(channels) == 1 else asked
    if asked not in known:
        found = "none named" if asked is None else f"no signal {asked!r}"
        raise RecordError(f"{path}: {found}; choose one of 0..{len(channels) - 1}")
    return known[asked]()


def as_record(signal: Signal, rate_Hz: float | None = None, *, unit: str | None = None,
              name: str | None = None) -> Record:
    """Return a Record from an array with its rate, from a pandas Series, or from a Record.

    A Series needs no rate if its index is the time in seconds, or in the unit behind its name, a DatetimeIndex or a
    TimedeltaIndex. Its unit is that behind its name. A unit and a name count instead of those of a Series or a Record.
    Raises RecordError for a missing rate, or one that differs from that of the record, and for what is no real number.

    >>> import pandas as pd
    >>> as_record(pd.Series([0.0, 2.0, 1.0], index=[0.0, 0.5, 1.0], name="a_m_s2")).rate_Hz
    2.0
    """
    if isinstance(signal, Record):
        if rate_Hz is not None and not np.isclose(rate_Hz, signal.rate_Hz, rtol=1e-6):
            raise RecordError(f"{signal.name}: rate_Hz = {rate_Hz}; the record has {signal.rate_Hz:.6g}")
        return replace(signal, unit=unit or signal.unit, name=name or signal.name)
    if _is_series(signal):
        return _from_series(signal, rate_Hz, unit, name)
    if rate_Hz is None:
        raise RecordError(f"{name or 'signal'}: no sample rate; give rate_Hz, of an array to as_record")
    return Record(np.asanyarray(signal), rate_Hz, unit or "1", name or "signal")


def _is_series(signal: object) -> TypeGuard[pd.Series]:
    """There is no Series where pandas, which is slow to import, was not."""
    return "pandas" in sys.modules and isinstance(signal, sys.modules["pandas"].Series)


def _from_series(series: pd.Series, rate_Hz: float | None, unit: str | None, name: str | None) -> Record:
    name = name or (str(series.name) if series.name is not None else "signal")
    t_s = _times_of(series.index, name)
    if t_s is None and rate_Hz is None:
        raise RecordError(f"{name}: no sample rate; give rate_Hz or an index of times in seconds")
    return timed_record(name, series.to_numpy(), unit or unit_of(name), rate_Hz, "index", t_s)


def _times_of(index: pd.Index, name: str) -> np.ndarray | None:
    """Times in s; whole numbers are times where a unit says so."""
    import pandas as pd

    if isinstance(index, pd.DatetimeIndex):
        index = index - index.min()
    if isinstance(index, pd.TimedeltaIndex):
        return index.total_seconds().to_numpy()
    called = str(index.name or "")
    if pd.api.types.is_float_dtype(index.dtype) or (
            pd.api.types.is_integer_dtype(index.dtype) and name_and_unit_of_time(called)[1] in SECONDS):
        return seconds(called, index.to_numpy(dtype=float), name)
    return None


def timed_record(name: str, values: np.ndarray, unit: str, rate_Hz: float | None, time: str | None,
                 t_s: np.ndarray | None) -> Record:
    """A record with the rate of its times, or with `rate_Hz` where it has none, or where rounding makes them uneven."""
    if t_s is None:
        if rate_Hz is None:
            raise RecordError(f"{name}: no times ({', '.join(TIME_COLUMNS)}); give the sample rate, or the name of the "
                              "column of times")
        return Record(values, rate_Hz, unit, name)
    try:
        found = sample_rate_Hz(t_s, f"{name}: {time}", may_be_rounded=rate_Hz is None)
    except RecordError as error:
        if rate_Hz is None:
            raise RecordError(f"{error}; where times are rounded, give the sample rate") from None
        if not _agrees(t_s, rate_Hz):
            raise
        found = rate_Hz
    check_rate(name, rate_Hz, found, f"its {time}")
    return Record(values, found, unit, name, float(t_s[0]))


def _agrees(t_s: np.ndarray, rate_Hz: float) -> bool:
    """Whether times are those of a rate, all rounded to as many digits as they have, or to single precision."""
    if not (np.isfinite(t_s).all() and rate_Hz > 0):
        return False
    return bool(np.ptp(t_s.astype(float) - np.arange(t_s.size) / rate_Hz) <= last_digit_s(t_s) * (1 + 1e-6))


def check_rate(name: str, given_Hz: float | None, found_Hz: float, where: str) -> None:
    """RecordError where a rate is given and `where` says another."""
    if given_Hz is not None and not np.isclose(given_Hz, found_Hz, rtol=0.01):
        raise RecordError(f"{name}: rate_Hz = {given_Hz:g}; {where} says {found_Hz:.6g}")


def clipped(values: np.ndarray, end: float, unit: str) -> str:
    """Why samples (n,) are taken to be cut off at their largest or least value, "" if they are not."""
    runs = np.diff(np.flatnonzero(np.concatenate([[True], values != end, [True]]))) - 1
    cut = runs.max() >= CLIPPED_RUN or runs.sum() >= CLIPPED_COUNT
    return f"clipped: {runs.sum()} samples at {end:.4g} {unit}" if cut else ""
