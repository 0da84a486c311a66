"""The command `volley`."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from analysis.readers import read_table
from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.plate.plate_model import PlateModel
from recognition.stream.command import channels_of
from recognition.stream.law_file import load_forces
from recognition.volley.impulses import WRONG_SPEED
from recognition.volley.recognise import Found, recognise_volley
from recognition.volley.responses import Stones

COUNTS, RADII_m, SPEEDS_m_s = (2, 30), (0.005, 0.1), (2.0, 3.2)  # faster coal breaks, and pushes less


def volley(arguments: argparse.Namespace) -> int:
    """0, or 3 without any ratio where the record is not explained by such stones on this plate."""
    stones = _stones_of(arguments)
    plate = PlateModel.load(Path(arguments.plate))
    path = Path(arguments.record)
    table = read_table(path / "signals.parquet" if path.is_dir() else path)
    channels, values = channels_of(table, plate, str(path))
    sensors = channels.accelerometers
    try:
        found = recognise_volley(plate, sensors, stones, load_forces(), values[:len(sensors)])
    except NotRecognised as error:
        print(f"REFUSED: {error}")
        return 3
    if found.refused:
        print(f"NOT EXPLAINED, no ratio can be trusted: {found.refused}")
        return 3
    print(f"stones at {found.arrival_s + float(table['t_s'].iloc[0]):.4f} s, misfit {found.likelihood.misfit:.2f}")
    for name, by_mass in (("number", False), ("mass", True)):
        low, middle, high = found.ratio(by_mass)
        print(f"mixing ratio by {name} {100 * middle:.1f} %, 90 % interval {100 * low:.1f} to {100 * high:.1f}")
    print("the record does not tell whether the stones are those told; by number it would be "
          + ", ".join(f"{text} {100 * found.ratio(stones=other)[1]:.0f} %" for text, other in _others(found)))
    return 0


def _others(found: Found) -> Iterator[tuple[str, Stones]]:
    """Stones a little different from those told."""
    (fewest, most), radius_m, (low, high) = found.stones.counts, found.stones.radius_m, found.stones.speeds_m_s
    for more in (-1, 1):
        yield f"with one stone {'more' if more > 0 else 'fewer'}", Stones((fewest + more, most + more), radius_m,
                                                                       (low, high))
    for factor in (1 - WRONG_SPEED, 1 + WRONG_SPEED):
        yield f"{WRONG_SPEED:.0%} {'faster' if factor > 1 else 'slower'}", Stones((fewest, most), radius_m,
                                                                                  (low * factor, high * factor))


def _stones_of(arguments: argparse.Namespace) -> Stones:
    """What the command line says of the stones."""
    counts, speeds = _between("stones", arguments.stones, COUNTS), _between("speed", arguments.speed, SPEEDS_m_s)
    radius_m, _ = _between("radius", [arguments.radius], RADII_m)
    return Stones((int(counts[0]), int(counts[1])), radius_m, speeds)


def _between(name: str, values: list[float], limits: tuple[float, float]) -> tuple[float, float]:
    """One value, or the lower and the higher of two."""
    low, high = values[0], values[-1]
    if len(values) > 2 or not limits[0] <= low <= high <= limits[1]:
        given = " ".join(f"{value:g}" for value in values)
        raise RecognitionError(f"--{name} {given}: must be a number between {limits[0]:g} and {limits[1]:g}, "
                               "or two such numbers, the lower first")
    return low, high
