"""Features of records: the time-frequency parameters of Figure 23, and what recognition takes of several sensors.

FEATURES lists them all. x_1 ... x_N are the samples of one record; mean() is over the samples.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from analysis.signals.records import Record, RecordError, Signal, as_record

if TYPE_CHECKING:
    from analysis.signals.emd import Decomposition

#: Ends of windows in shares of the record, ends of bands in shares of half its sample rate.
WINDOWS = (0.0, 0.025, 0.125, 0.375, 1.0)
BANDS = (0.0, 0.1, 0.25, 0.5, 1.0)
MOST_ENERGY = 2.0  # of IMFs over that of the record; what holds more are splines that overshoot where it is quiet


def square_root_amplitude(x: np.ndarray) -> float:
    """x_r = (mean sqrt|x|)^2."""
    return float(np.mean(np.sqrt(np.abs(x))) ** 2)


def absolute_mean(x: np.ndarray) -> float:
    """mean |x|."""
    return float(np.mean(np.abs(x)))


def mean(x: np.ndarray) -> float:
    """mean x."""
    return float(np.mean(x))


def variance(x: np.ndarray) -> float:
    """mean (x - mean x)^2, over N (not N - 1)."""
    return float(np.var(x))


def peak_to_peak(x: np.ndarray) -> float:
    """max x - min x."""
    return float(np.ptp(x))


def rms(x: np.ndarray) -> float:
    """sqrt(mean x^2)."""
    return float(np.sqrt(np.mean(np.square(x))))


def waveform_index(x: np.ndarray) -> float:
    """rms / mean |x|; 1 for a square wave, pi / (2 sqrt 2) for a sine."""
    return rms(x) / absolute_mean(x)


def kurtosis_index(x: np.ndarray) -> float:
    """mean x^4 / rms^4 (raw, about zero: the usual index in this literature); 3/2 for a sine."""
    return float(np.mean(_unit_rms(x) ** 4))


def kurtosis_central(x: np.ndarray) -> float:
    """mean (x - mean x)^4 / variance^2; 3 for a normal distribution."""
    return kurtosis_index(x - np.mean(x))


def skewness_raw(x: np.ndarray) -> float:
    """mean x^3, in the unit cubed. The paper does not say which skewness it takes."""
    return float(np.mean(np.asarray(x) ** 3))


def skewness_normalised(x: np.ndarray) -> float:
    """mean (x - mean x)^3 / variance^(3/2)."""
    return float(np.mean(_unit_rms(x - np.mean(x)) ** 3))


def margin_index(x: np.ndarray) -> float:
    """max |x| / x_r, with the square root amplitude x_r."""
    return float(np.max(np.abs(x)) / square_root_amplitude(x))


def _unit_rms(x: np.ndarray) -> np.ndarray:
    # Powers are taken of the scaled signal: x^4 of a signal in nanometres underflows.
    return x / rms(x)


def log_rms(signals: np.ndarray, windows: tuple[float, ...] = WINDOWS, bands: tuple[float, ...] = BANDS) -> np.ndarray:
    """Logarithm of the rms of all signals (m, n) together in each window, then of their spectrum in each band.

    It hardly depends on the arrangement of the stones. A greater energy of the impact raises all of it, damping changes
    the later windows, a higher impact speed the upper bands. Raises RecordError for silence.
    """
    ends = np.round(np.array(windows) * signals.shape[1]).astype(int)
    parts = [np.sqrt(np.mean(signals[:, a:b] ** 2)) for a, b in pairwise(ends)]
    spectrum = np.abs(np.fft.rfft(signals, axis=1)) ** 2
    ends = np.round(np.array(bands) * spectrum.shape[1]).astype(int)
    parts += [np.sqrt(np.sum(spectrum[:, a:b])) for a, b in pairwise(ends)]
    if min(parts) <= 0:
        raise RecordError("the record is silent in a window or a band")
    return np.log(parts)


def _marginal_energy(decomposition: Decomposition) -> float:
    from analysis.signals.hilbert import marginal_spectrum

    return marginal_spectrum(decomposition, kind="energy").total


@dataclass(frozen=True)
class Formula:
    """How a feature is computed: a function that takes the "samples" (n,) of a record, its "imfs", a Decomposition, or
    the signals (m, n) of several "sensors"; the power of the signal's unit that it carries; and its place from 1 among
    the base parameters of Q, 0 if it is none. A function of IMFs or sensors may return an array."""

    function: Callable[[Any], Any]
    power: int = 0
    place_in_Q: int = 0
    takes: Literal["samples", "imfs", "sensors"] = "samples"


#: Every feature by its name, in which {} is the number of an IMF. `gangue features` prints those of one record;
#: regressions of recognition take any of samples or sensors.
FEATURES = {
    "square_root_amplitude": Formula(square_root_amplitude, 1, 1),
    "absolute_mean": Formula(absolute_mean, 1, 2),
    "mean": Formula(mean, 1),
    "variance": Formula(variance, 2, 3),
    "peak_to_peak": Formula(peak_to_peak, 1, 4),
    "rms": Formula(rms, 1, 5),
    "waveform_index": Formula(waveform_index),
    "kurtosis_index": Formula(kurtosis_index),
    "kurtosis_central": Formula(kurtosis_central),
    "skewness_raw": Formula(skewness_raw, 3, 7),
    "skewness_normalised": Formula(skewness_normalised),
    "margin_index": Formula(margin_index, 0, 8),
    "imf_{}_energy": Formula(lambda imfs: imfs.energies, 2, takes="imfs"),
    "imf_{}_energy_share": Formula(lambda imfs: imfs.energies / imfs.energies.sum(), takes="imfs"),
    "marginal_spectrum_energy": Formula(_marginal_energy, 2, 6, takes="imfs"),
    "energies_sensors": Formula(log_rms, takes="sensors"),
}

#: The eight base parameters of Q (Section V-A) in its order.
BASE_PARAMETERS = sorted((name for name, formula in FEATURES.items() if formula.place_in_Q),
                         key=lambda name: FEATURES[name].place_in_Q)


@dataclass(frozen=True)
class Feature:
    """One parameter of a record.

    >>> signal_features(Record([0.0, 1.0, 0.0, -1.0] * 9, rate_Hz=100.0, unit="m/s^2"))["peak_to_peak"]
    Feature(name='peak_to_peak', value=2.0, unit='m/s^2')
    """

    name: str
    value: float
    unit: str


def power_of_unit(unit: str, power: int) -> str:
    """Return the unit of x^power, such as "(m/s^2)^3", and "1" for power 0."""
    if power == 0 or unit == "1":
        return "1"
    return unit if power == 1 else f"({unit})^{power}"


def time_features(record: Record) -> list[Feature]:
    """Return the parameters in the time domain. Raises RecordError for a record of constant value."""
    if np.ptp(record.values) == 0:
        raise RecordError(f"{record.name}: every sample is {record.values[0]:g}; parameters need a changing signal")
    return [Feature(name, formula.function(record.values), power_of_unit(record.unit, formula.power))
            for name, formula in FEATURES.items() if formula.takes == "samples"]


def time_frequency_features(record: Record) -> tuple[list[Feature], float]:
    """Return the parameters of IMFs, decomposed by the default rule, with energies as integrals of x^2 over time, in
    unit^2 s; and how many times the record's energy all IMFs hold."""
    from analysis.signals.emd import decompose

    imfs, found = decompose(record), list[Feature]()
    for name, formula in FEATURES.items():
        if formula.takes == "imfs":
            unit = f"{power_of_unit(record.unit, formula.power)} s".removeprefix("1 ") if formula.power else "1"
            values = np.atleast_1d(formula.function(imfs))
            found += [Feature(name.format(k), float(value), unit) for k, value in enumerate(values, 1)]
    return found, float(imfs.energies.sum() * record.rate_Hz / (record.values.size * variance(record.values)))


def sensor_features(name: str, signals: np.ndarray) -> np.ndarray:
    """Return a feature (p,) of the signals (m, n) of several sensors, or one of samples for each of them. Raises
    RecordError where it is no number."""
    formula = FEATURES[name]
    each = signals[None] if formula.takes == "sensors" else signals
    with np.errstate(all="ignore"), suppress(ZeroDivisionError):
        if np.isfinite(found := np.array([formula.function(x) for x in each]).ravel()).all():
            return found
    raise RecordError(f"{name} of a sensor is no number: the samples are silent, too large or too small for it")


def _every_feature(record: Record) -> tuple[dict[str, Feature], list[str], float]:
    """All parameters by name, which of them are of IMFs, and how many times the record's energy these hold."""
    try:
        with np.errstate(all="ignore"):  # what is no number is refused below
            of_imfs, times = time_frequency_features(record)
            found = {f.name: f for f in [*time_features(record), *of_imfs]}
    except ZeroDivisionError:
        raise RecordError(f"{record.name}: has a mean of zero; the samples are too small") from None
    for f in found.values():
        if not np.isfinite(f.value):
            raise RecordError(f"{record.name}: {f.name} is {f.value}; the samples are too large or too small for it")
    return found, [f.name for f in of_imfs], times


def features_of(record: Record) -> tuple[dict[str, Feature], str]:
    """Return all parameters of Figure 23 by name, in a fixed order, and why those of IMFs are not among them, "" if
    they are. Raises as `signal_features`."""
    found, of_imfs, times = _every_feature(record)
    if 0 < times <= MOST_ENERGY:
        return found, ""
    why = ("it has too few extrema for one" if times == 0 else
           f"they would hold {times:.3g} times the record's energy, where at most {MOST_ENERGY:g} are allowed; take a "
           "part without quiet")
    return ({name: f for name, f in found.items() if name not in of_imfs},
            f"{record.name}: IMFs and their spectrum: {why}")


def signal_features(signal: Signal) -> dict[str, Feature]:
    """Return all parameters of Figure 23 by name, in a fixed order; those of IMFs that overshoot, or are
    none, are left out, and a warning says so.

    Raises RecordError for a record of constant value, or samples too large or too small for a parameter.

    >>> signal_features(Record([1.0, -1.0] * 50, rate_Hz=100.0))["waveform_index"].value
    1.0
    """
    found, left_out = features_of(as_record(signal))
    if left_out:
        warnings.warn(f"left out: {left_out}", stacklevel=2)
    return found


def base_parameters(signal: Signal) -> np.ndarray:
    """Return the eight parameters of Q (Eq. 40) in the order of BASE_PARAMETERS, as the paper takes them: also of IMFs
    that overshoot. Raises as `signal_features`.

    >>> base_parameters(read_run("runs/paper/ratio_030").record("a_m_s2")).shape
    (8,)
    """
    found = _every_feature(as_record(signal))[0]
    return np.array([found[name].value for name in BASE_PARAMETERS])
