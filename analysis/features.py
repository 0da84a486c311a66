"""The time-frequency parameters of Figure 23, from any record.

Each takes the samples x_1 ... x_N of one record; mean() is over the samples. The energies of the IMFs and of the
marginal spectrum come from `analysis.emd` and `analysis.hilbert`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.records import Record, RecordError


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


#: name -> (function, power of the signal's unit).
TIME_PARAMETERS = {
    "square_root_amplitude": (square_root_amplitude, 1),
    "absolute_mean": (absolute_mean, 1),
    "mean": (mean, 1),
    "variance": (variance, 2),
    "peak_to_peak": (peak_to_peak, 1),
    "rms": (rms, 1),
    "waveform_index": (waveform_index, 0),
    "kurtosis_index": (kurtosis_index, 0),
    "kurtosis_central": (kurtosis_central, 0),
    "skewness_raw": (skewness_raw, 3),
    "skewness_normalised": (skewness_normalised, 0),
    "margin_index": (margin_index, 0),
}

#: The eight base parameters of Q (Section V-A), with the direction that the paper finds.
BASE_PARAMETERS = {
    "square_root_amplitude": +1,
    "absolute_mean": +1,
    "variance": +1,
    "peak_to_peak": +1,
    "rms": +1,
    "marginal_spectrum_energy": +1,
    "skewness_raw": -1,
    "margin_index": -1,
}


@dataclass(frozen=True)
class Feature:
    """One parameter of a record."""

    name: str
    value: float
    unit: str


def power_of_unit(unit: str, power: int) -> str:
    """Return the unit of x^power, such as "(m/s^2)^3", and "1" for power 0."""
    if power == 0 or unit == "1":
        return "1"
    return unit if power == 1 else f"({unit})^{power}"


def time_features(record: Record) -> list[Feature]:
    """Return the twelve parameters in the time domain. Raises RecordError for a record of constant value."""
    _refuse_constant(record)
    return [
        Feature(name, function(record.values), power_of_unit(record.unit, power))
        for name, (function, power) in TIME_PARAMETERS.items()
    ]


def time_frequency_features(record: Record) -> list[Feature]:
    """Return the energies of the IMFs, their shares, and the energy of the Hilbert marginal spectrum.

    Energies are integrals of x^2 over time, in unit^2 s. The decomposition is that of `analysis.emd.decompose` with its
    default stopping rule.
    """
    from analysis.emd import decompose
    from analysis.hilbert import marginal_spectrum

    decomposition = decompose(record)
    unit = f"{power_of_unit(record.unit, 2)} s"
    energies = decomposition.energies
    found = [Feature(f"imf_{i}_energy", float(e), unit) for i, e in enumerate(energies, 1)]
    found += [
        Feature(f"imf_{i}_energy_share", float(e / energies.sum()), "1") for i, e in enumerate(energies, 1)
    ]
    spectrum = marginal_spectrum(decomposition, kind="energy")
    return [*found, Feature("marginal_spectrum_energy", spectrum.total, unit)]


def signal_features(record: Record) -> dict[str, Feature]:
    """Return all parameters of Figure 23 by name, in a fixed order.

    Raises RecordError for a record of constant value, or samples too large or too small for a parameter.
    """
    try:
        with np.errstate(all="ignore"):  # what is no number is refused below
            found = {f.name: f for f in [*time_features(record), *time_frequency_features(record)]}
    except ZeroDivisionError:
        raise RecordError(f"{record.name}: has a mean of zero; the samples are too small") from None
    for f in found.values():
        if not np.isfinite(f.value):
            raise RecordError(
                f"{record.name}: {f.name} is {f.value}; the samples are too large or too small for it"
            )
    return found


def base_parameters(record: Record) -> np.ndarray:
    """Return the eight parameters of Q (Eq. 40) in the order of BASE_PARAMETERS. Raises as `signal_features`."""
    found = signal_features(record)
    return np.array([found[name].value for name in BASE_PARAMETERS])


def _refuse_constant(record: Record) -> None:
    if np.ptp(record.values) == 0:
        raise RecordError(
            f"{record.name}: every sample is {record.values[0]:g}; parameters need a changing signal"
        )
