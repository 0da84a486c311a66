"""Files of LabVIEW: text (LVM), and TDMS by npTDMS (extra `records`)."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from analysis.files.array_files import Arrays
from analysis.files.text_tables import encoding_of
from analysis.signals.records import RecordError

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
    try:
        from nptdms import TdmsFile
    except ImportError:
        raise RecordError(f"{path}: reading TDMS needs the package npTDMS (pip install npTDMS)") from None

    arrays = Arrays()
    try:
        for group in TdmsFile.read(path).groups():
            for channel in group.channels():
                name, about = f"{group.name}/{channel.name}", channel.properties
                arrays.add(name, channel[:])
                arrays.units[name] = str(about.get("unit_string") or about.get("NI_UnitDescription") or "1")
                if about.get("wf_increment", 0.0) > 0:
                    arrays.numbers[f"{name}/dt"] = float(about["wf_increment"])
    except Exception as error:  # noqa: BLE001  npTDMS raises of every kind for a broken file
        raise RecordError(f"{path}: not a readable TDMS file ({' '.join(str(error).split())})") from None
    return arrays
