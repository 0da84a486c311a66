"""Named arrays with their sample rates: MATLAB files by scipy, HDF5 and MATLAB 7.3 by h5py (extra `records`).

A signal is an array of numbers, or one row or column of a narrow matrix, `acc:0`, `acc:1` and so on. Its time is an
array of the same length in the same group whose name says so. Without one the rate is a number that an attribute, or an
array of one value, gives under one of RATES or INTERVALS, in its group or one above.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from analysis.signals.records import RecordError

RATES = ("rate_hz", "fs", "fs_hz", "rate", "sample_rate", "samplerate", "sampling_rate", "sampling_frequency", "srate")
INTERVALS = ("dt", "dt_s", "sample_interval_s", "sampling_interval", "wf_increment", "ts")
UNITS = ("unit", "units", "unit_string")
MOST_CHANNELS = 64  # of a matrix
NO_NUMBERS = (b"char", b"cell", b"struct", b"function_handle")  # MATLAB_class in HDF5


@dataclass
class Arrays:
    """Arrays (n,), numbers and units of a file by their path in it, `group/name`."""

    signals: dict[str, np.ndarray] = field(default_factory=dict)
    numbers: dict[str, float] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)

    def add(self, name: str, value: Any) -> None:
        """Take in an array of numbers; whatever else a file holds is passed over."""
        values = np.squeeze(np.asarray(value))
        if values.dtype.kind not in "iuf":
            return
        if values.ndim == 0:
            self.numbers[name] = float(values)
        elif values.ndim == 1 and values.size > 1:
            self.signals[name] = values.astype(float)
        elif values.ndim == 2 and min(values.shape) <= MOST_CHANNELS:
            for k, channel in enumerate(values if values.shape[0] < values.shape[1] else values.T):
                self.signals[f"{name}:{k}"] = channel.astype(float)

    def rate_Hz(self, name: str) -> float | None:
        """The sample rate that the file gives for a signal, the nearest group first."""
        numbers = {key.lower(): value for key, value in self.numbers.items()}
        for place in (name, name.split(":")[0], *_groups(name)):
            for key in RATES:
                if f"{place}/{key}".lstrip("/").lower() in numbers:
                    return numbers[f"{place}/{key}".lstrip("/").lower()]
            for key in INTERVALS:
                interval_s = numbers.get(f"{place}/{key}".lstrip("/").lower(), 0.0)
                if interval_s > 0:
                    return 1.0 / interval_s
        return None

    def beside(self, name: str) -> dict[str, np.ndarray]:
        """Arrays of the same length in the group of a signal, by the last part of their names."""
        group, size = _groups(name)[0], self.signals[name].size
        return {key.rsplit("/", 1)[-1]: values for key, values in self.signals.items()
                if _groups(key)[0] == group and values.size == size and key != name}


def _groups(name: str) -> list[str]:
    """The groups that hold a signal, from the nearest to the file, ""."""
    parts = name.split("/")[:-1]
    return ["/".join(parts[:k]) for k in range(len(parts), -1, -1)]


def read_matlab(path: Path) -> Arrays:
    """Arrays of a MATLAB file. Raises RecordError."""
    from scipy.io import loadmat

    try:
        content = loadmat(path, simplify_cells=True)
    except NotImplementedError:  # version 7.3 is HDF5
        return read_hdf5(path)
    except Exception as error:  # noqa: BLE001  scipy raises of every kind for a broken file, see tests/fuzz
        raise RecordError(f"{path}: not a readable MATLAB file ({' '.join(str(error).split())})") from None
    arrays = Arrays()
    for name, value in _flat(content):
        arrays.add(name, value)
    return arrays


def _flat(content: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Variables, and the fields of structures as `structure/field`."""
    for name, value in content.items():
        if name.startswith("__"):
            continue
        if isinstance(value, Mapping):
            yield from _flat(value, f"{above}{name}/")
        else:
            yield above + name, value


def read_hdf5(path: Path) -> Arrays:
    """Arrays of an HDF5 file, with the rates and units that attributes give. Raises RecordError."""
    try:
        import h5py
    except ImportError:
        raise RecordError(f"{path}: reading HDF5 needs the package h5py (pip install h5py)") from None

    arrays = Arrays()

    def take(name: str, node: Any) -> None:
        for key, value in node.attrs.items():
            if key.lower() in UNITS and isinstance(value, (str, bytes)):
                arrays.units[name] = value.decode(errors="replace") if isinstance(value, bytes) else value
            elif key.lower() in (*RATES, *INTERVALS):
                arrays.add(f"{name}/{key}".lstrip("/"), value)
        data = isinstance(node, h5py.Dataset) and node.attrs.get("MATLAB_class") not in NO_NUMBERS
        if data and not name.startswith("#") and node.dtype.kind in "iuf":
            arrays.add(name, node[()])

    try:
        with h5py.File(path, "r") as file:
            take("", file)
            file.visititems(take)
    except Exception as error:  # noqa: BLE001  h5py raises of every kind for a broken file, see tests/fuzz
        raise RecordError(f"{path}: not a readable HDF5 file ({' '.join(str(error).split())})") from None
    return arrays
