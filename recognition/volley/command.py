"""The command `volley`."""

from __future__ import annotations

import argparse
from pathlib import Path

from analysis.readers import read_table
from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.plate.plate_model import PlateModel
from recognition.stream.command import channels_of
from recognition.stream.law_file import load_forces
from recognition.volley.recognise import recognise_volley
from recognition.volley.responses import Stones

MOST_STONES = 30
RADII_m, SPEEDS_m_s = (0.005, 0.1), (2.0, 3.2)  # faster coal breaks, and pushes less by an amount that scatters


def volley(arguments: argparse.Namespace) -> int:
    """0, or 3 without any ratio where the record is not explained by such stones on this plate."""
    stones = _stones_of(arguments)
    plate = PlateModel.load(Path(arguments.plate))
    path = Path(arguments.record)
    table = read_table(path / "signals.parquet" if path.is_dir() else path)
    channels, values = channels_of(table, plate, str(path))
    sensors, forces = channels.accelerometers, load_forces()
    try:
        found = recognise_volley(plate, sensors, stones, forces, values[:len(sensors)])
    except NotRecognised as error:
        print(f"REFUSED: {error}")
        return 3
    if found.refused:
        print(f"NOT EXPLAINED, no ratio can be trusted: {found.refused}")
        return 3
    coal, gangue = (float(density) for density in forces.density_kg_m3)
    print(f"{stones.count} stones at {found.arrival_s + float(table['t_s'].iloc[0]):.4f} s, misfit {found.misfit:.2f}")
    for name, weight in (("number", (1.0, 1.0)), ("mass", (coal, gangue))):
        low, middle, high = found.ratio(weight)
        print(f"mixing ratio by {name} {100 * middle:.1f} %, 90 % interval {100 * low:.1f} to {100 * high:.1f}")
    return 0


def _stones_of(arguments: argparse.Namespace) -> Stones:
    """What the command line says of the stones."""
    stones = Stones(arguments.stones, arguments.radius, arguments.speed)
    for name, value, (low, high) in (("stones", stones.count, (2, MOST_STONES)), ("radius", stones.radius_m, RADII_m),
                                     ("speed", stones.speed_m_s, SPEEDS_m_s)):
        if not low <= value <= high:
            raise RecognitionError(f"--{name} {value:g}: must lie between {low:g} and {high:g}")
    return stones
