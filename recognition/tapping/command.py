"""The command `tap`."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from common.output_directory import is_sealed_as, refuse_file
from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.plate.plate_model import FORMAT, PlateModel
from recognition.tapping.fit import BEYOND, fit_plate
from recognition.tapping.learnt import Learnt, learnt
from recognition.tapping.tap_file import read_taps

LARGEST_UNEXPLAINED = 0.3  # of a sensor's record: more, and the plate, a place or a sensor is not what it is said to be


def tap(arguments: argparse.Namespace) -> int:
    """0, or 3 without any file where the taps do not suit the plate."""
    out = Path(arguments.out)
    refuse_file(arguments.out, is_sealed_as(FORMAT))
    if not 0 < arguments.max_frequency < 1e5:
        raise RecognitionError(f"--max-frequency {arguments.max_frequency:g}: must lie between 0 and 1e5 Hz")
    plate = PlateModel.from_scene(arguments.scene, BEYOND * arguments.max_frequency)
    taps, prior = read_taps(arguments.taps, plate)
    found = learnt(fit_plate(plate, taps, prior), prior)
    for line in lines_of(found):
        print(line)
    try:
        refuse_unexplained(found)
    except NotRecognised as error:
        print(f"NOT EXPLAINED, no plate written: {error}")
        return 3
    found.plate.save(out)
    print(f"plate written to {out}, {out.stat().st_size / 1e3:.0f} kB")
    return 0


def refuse_unexplained(found: Learnt) -> None:
    """Raises NotRecognised where a sensor's record has more that nothing explains than LARGEST_UNEXPLAINED."""
    worst = int(np.argmax(found.unexplained))
    if found.unexplained[worst] > LARGEST_UNEXPLAINED:
        raise NotRecognised(f"sensor {found.plate.sensor_names[worst]!r}: {found.unexplained[worst]:.0%} of its taps, "
                            f"limit {LARGEST_UNEXPLAINED:.0%}")


def lines_of(found: Learnt) -> list[str]:
    """What is printed: a line a mode, then a line a sensor."""
    plate = found.plate
    lines = [f"{'mode':>4} {'Hz':>8} {'+- %':>6} {'damping %':>9} {'+- %':>5} {'shape +- %':>10}"]
    for k in np.flatnonzero(plate.frequency_Hz < found.highest_Hz):
        lines.append(f"{k + 1:4d} {plate.frequency_Hz[k]:8.1f} {100 * plate.frequency_sd[k]:6.2f} "
                     f"{100 * plate.damping_ratio[k]:9.2f} {100 * plate.damping_sd[k]:5.0f} "
                     f"{100 * plate.shape_sd[k]:10.1f}" + ("" if found.identified[k] else "  not identified"))
    for name, gain, sd, left, noise in zip(plate.sensor_names, found.gain, found.gain_sd, found.misfit, found.noise,
                                            strict=True):
        lines.append(f"sensor {name}: gain {gain:.3f} +- {sd:.3f}, left over {100 * left:.1f} % of its taps, "
                     f"noise {100 * noise:.1f} %")
    return lines
