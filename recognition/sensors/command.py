"""The command `check`."""

from __future__ import annotations

import argparse
from pathlib import Path

from recognition.plate.plate_model import PlateModel
from recognition.plate.records import read_accelerations
from recognition.sensors.channel_check import check_channels


def check(arguments: argparse.Namespace) -> int:
    """0, or 3 where the channels of a record cannot be explained."""
    plate = PlateModel.load(Path(arguments.plate))
    _, signals, rate_Hz = read_accelerations(arguments.record, plate)
    report = check_channels(signals, rate_Hz, plate)
    for line in report.told:
        print(line)
    if report.refused:
        print(f"REFUSED: {'; '.join(report.refused)}")
        return 3
    if report.ringing is None:
        print("too short for a look at free ringing: gains and order of the sensors are not checked")
    else:
        print(f"{100 * report.ringing.misfit:.1f} % of the ringing is not explained, "
              f"{100 * report.ringing.expected:.1f} % expected")
    return 0
