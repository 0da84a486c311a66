"""Named arrays with their sample rates: MATLAB files by scipy, HDF5 and MATLAB 7.3 by h5py, LabVIEW's text (LVM), and
TDMS by npTDMS (extra `records`).

A signal is an array of numbers, or one row or column of a narrow matrix, `acc:0`, `acc:1` and so on. Its time is an
array of the same length in the same group whose name says so. Without one the rate is a number that an attribute, or an
array of one value, gives under one of RATES or INTERVALS, in its group or one above.
"""

import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from analysis.files.text_tables import encoding_of
from analysis.signals.records import RecordError
from common.channels import unit_of
from common.input_error import optional_library

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
        for place in _places(name):
            told = {key: numbers.get(f"{place}/{key}".lstrip("/").lower()) for key in (*RATES, *INTERVALS)}
            for key, value in told.items():
                if value is not None and (key in RATES or value > 0):
                    return value if key in RATES else 1.0 / value
        return None

    def unit(self, name: str) -> str:
        """That of the signal, by its name, or of the groups that hold it; "1" where none is told."""
        told = [self.units.get(place, "") for place in _places(name)]
        named = unit_of(name.rsplit("/", 1)[-1])
        return next((unit for unit in (*told[:2], named, *told[2:]) if unit not in ("", "1")), "1")

    def beside(self, name: str) -> dict[str, np.ndarray]:
        """Arrays of the same length in the group of a signal, by the last part of their names."""
        group, size = _groups(name)[0], self.signals[name].size
        return {key.rsplit("/", 1)[-1]: values for key, values in self.signals.items()
                if _groups(key)[0] == group and values.size == size and key != name}


def _places(name: str) -> list[str]:
    """Where a file may say something of a signal."""
    return [name, name.split(":")[0], *_groups(name)]


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
        if isinstance(value, str) and name.rsplit("/", 1)[-1].lower() in UNITS:
            arrays.units[_groups(name)[0]] = value
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
    h5py = optional_library("h5py", f"{path}: reading HDF5", "h5py", RecordError)
    arrays = Arrays()

    def take(name: str, node: Any) -> None:
        for key, value in ((key.lower().replace(" ", "_"), value) for key, value in node.attrs.items()):
            if key in UNITS and isinstance(value, (str, bytes)):
                arrays.units[name] = value.decode(errors="replace") if isinstance(value, bytes) else value
            elif key in (*RATES, *INTERVALS):
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


END = "***End_of_Header***"
SEPARATORS = {"Tab": "\t", "Comma": ","}
LARGEST_CONTRADICTION = 0.01  # of two rates that a file gives
_log = logging.getLogger(__name__)


def read_lvm(path: Path) -> Arrays:
    """Channels of an LVM file with rates and units; of several measurements `0/name`, `1/name` and so on. Raises
    RecordError."""
    lines = [line.rstrip("\r") for line in path.read_text(encoding_of(path), errors="replace").split("\n")]
    ends = [k for k, line in enumerate(lines) if line.startswith(END)]
    if not lines[0].startswith("LabVIEW Measurement") or len(ends) < 2:
        raise RecordError(f"{path}: not a readable LVM file (no header of LabVIEW, or no measurement)")
    kind = next((line[10:].strip(", \t") for line in lines[:ends[0]] if line.startswith("Separator")), "Tab")
    separator = SEPARATORS.get(kind, "\t")
    about = dict(cells for line in lines[:ends[0]] if len(cells := line.rstrip(separator).split(separator)) == 2)
    arrays = Arrays()
    for number, end in enumerate(ends[1:]):
        below = next((k for k in range(end + 1, len(lines)) if not lines[k].strip(separator + " ")), len(lines))
        header = {key: cells for line in lines[ends[number] + 1:end] for key, *cells in [line.split(separator)]}
        rows = [line.split(separator) for line in lines[end + 1:below]]
        group = f"{number}/" if len(ends) > 2 else ""
        try:
            _add(arrays, group, header, rows, about)
        except (ValueError, LookupError) as error:
            raise RecordError(f"{path}: not a readable LVM file (measurement {number}: {error})") from None
    _tell_contradictions(arrays, path)
    return arrays


def _add(arrays: Arrays, group: str, header: dict[str, list[str]], rows: list[list[str]],
         about: dict[str, str]) -> None:
    """Take in the channels of a measurement, whose first row has the names."""
    decimal, kind = about.get("Decimal_Separator", "."), about.get("X_Columns", "One")
    names, data = rows[0], rows[1:]
    for k in range(int(header["Channels"][0])):
        at = 2 * k + 1 if kind == "Multi" else k + 1
        cells = [row[at] if at < len(row) else "" for row in data]
        size = max((i + 1 for i, cell in enumerate(cells) if cell.strip()), default=0)  # channels end one by one
        name = f"{group}{names[at].strip()}"
        if name in arrays.signals:
            raise ValueError(f"channel {name!r} appears twice")
        arrays.add(name, [float(cell.replace(decimal, ".")) for cell in cells[:size]])
        arrays.units[name] = _cell(header, "Y_Unit_Label", k) or "1"
        interval_s = float(_cell(header, "Delta_X", k).replace(decimal, ".") or 0.0)
        if _cell(header, "X_Dimension", k) in ("", "Time") and interval_s > 0:
            arrays.numbers[f"{name}/dt"] = interval_s


def _cell(header: dict[str, list[str]], key: str, k: int) -> str:
    cells = header.get(key, [])
    return cells[k].strip() if k < len(cells) else ""


def _tell_contradictions(arrays: Arrays, path: Path) -> None:
    """Warn where a channel of times does not rise by the interval that the header gives."""
    for name, values in arrays.signals.items():
        if name.rsplit("/", 1)[-1].lower() != "time":
            continue
        interval_s = float(np.mean(np.diff(values)))
        others = [arrays.numbers[key] for key in arrays.numbers if key != f"{name}/dt"]
        if any(abs(interval_s / other - 1) > LARGEST_CONTRADICTION for other in others):
            _log.warning("note: %s: its channel %r rises by %.6g s a sample, its header says %s s; the header is taken",
                         path, name, interval_s, " or ".join(f"{one:.6g}" for one in dict.fromkeys(others)))


def read_tdms(path: Path) -> Arrays:
    """Channels of a TDMS file, `group/channel`, with rates and units. Raises RecordError."""
    nptdms = optional_library("nptdms", f"{path}: reading TDMS", "npTDMS", RecordError)
    arrays = Arrays()
    try:
        for group in nptdms.TdmsFile.read(path).groups():
            for channel in group.channels():
                name, about = f"{group.name}/{channel.name}", channel.properties
                arrays.add(name, channel[:])
                arrays.units[name] = str(about.get("unit_string") or about.get("NI_UnitDescription") or "1")
                if about.get("wf_increment", 0.0) > 0:
                    arrays.numbers[f"{name}/dt"] = float(about["wf_increment"])
    except Exception as error:  # noqa: BLE001  npTDMS raises of every kind for a broken file
        raise RecordError(f"{path}: not a readable TDMS file ({' '.join(str(error).split())})") from None
    return arrays
