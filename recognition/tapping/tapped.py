"""The command `tap`: a plate that is learnt from taps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from common.files.output_directory import is_sealed_as, refuse_file
from common.process.messages import told
from common.result import Result
from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.plate.plate_model import FORMAT, PlateModel
from recognition.tapping.fit import BEYOND, fit_plate
from recognition.tapping.learnt import Learnt, learnt
from recognition.tapping.tap_file import read_taps
from recognition.tapping.uff_modes import is_own, write_modes

LARGEST_UNEXPLAINED = 0.3  # of a sensor's record: more, and the plate, a place or a sensor is not what it is said to be


@dataclass(frozen=True)
class TapResult(Result):
    """What the taps say of the modes in the band of the fit and of the sensors; `not_explained` is why no plate is
    written, "" where one is.

    modes: columns, standard deviations (sd) in shares of the values; identified: do the taps tell anything of a mode?
    sensors: by name gain, its sd, and rms of what is left of the taps and of noise, in shares of the records."""

    plate: Path | None
    plate_bytes: int
    modes: Mapping[str, list[Any]]
    sensors: Mapping[str, Mapping[str, float]]
    not_explained: str

    def words(self) -> Iterator[str]:
        yield f"{'mode':>4} {'Hz':>8} {'+- %':>6} {'damping %':>9} {'+- %':>5} {'shape +- %':>10}"
        for number, hz, hz_sd, damping, damping_sd, shape_sd, known in zip(*self.modes.values(), strict=True):
            yield (f"{number:4d} {hz:8.1f} {100 * hz_sd:6.2f} {100 * damping:9.2f} {100 * damping_sd:5.0f} "
                   f"{100 * shape_sd:10.1f}" + ("" if known else "  not identified"))
        for name, one in self.sensors.items():
            yield (f"sensor {name}: gain {one['gain']:.3f} +- {one['gain_sd']:.3f}, "
                   f"left over {100 * one['misfit']:.1f} % of its taps, noise {100 * one['noise']:.1f} %")
        if self.not_explained:
            yield f"NOT EXPLAINED, no plate written: {self.not_explained}"
        else:
            yield f"plate written to {self.plate}, {self.plate_bytes / 1e3:.0f} kB"


def tap(scene_file: str, taps: str, out: str, max_frequency_Hz: float = 6000.0, uff: str | None = None) -> TapResult:
    """Learn the plate of a scene from taps at known places, and write it to `out` (.json) if they suit it; its modes to
    `uff` as well. Raises RecognitionError, InputError."""
    refuse_file(out, is_sealed_as(FORMAT))
    if uff is not None:
        refuse_file(uff, is_own)
    if not 0 < max_frequency_Hz < 1e5:
        raise RecognitionError(f"--max-frequency {max_frequency_Hz:g}: must lie between 0 and 1e5 Hz")
    with told(f"{scene_file}: modes"):
        plate = PlateModel.from_scene(scene_file, BEYOND * max_frequency_Hz)
    given, prior = read_taps(taps, plate)
    with told(f"{taps}: fit"):
        found = learnt(fit_plate(plate, given, prior), prior)
    modes, sensors = _modes(found), _sensors(found)
    try:
        refuse_unexplained(found)
    except NotRecognised as error:
        return TapResult(None, 0, modes, sensors, str(error))
    found.plate.save(Path(out))
    if uff is not None:
        write_modes(Path(uff), found.plate)
    return TapResult(Path(out), Path(out).stat().st_size, modes, sensors, "")


def refuse_unexplained(found: Learnt) -> None:
    """Raises NotRecognised where a sensor's record has more that nothing explains than LARGEST_UNEXPLAINED."""
    worst = int(np.argmax(found.unexplained))
    if found.unexplained[worst] > LARGEST_UNEXPLAINED:
        raise NotRecognised(f"sensor {found.plate.sensor_names[worst]!r}: {found.unexplained[worst]:.0%} of its taps, "
                            f"limit {LARGEST_UNEXPLAINED:.0%}")


def _modes(found: Learnt) -> dict[str, list[Any]]:
    plate, here = found.plate, np.flatnonzero(found.plate.frequency_Hz < found.highest_Hz)
    names = ("frequency_Hz", "frequency_sd", "damping_ratio", "damping_sd", "shape_sd")
    return {"number": (here + 1).tolist(), **{name: getattr(plate, name)[here].tolist() for name in names},
            "identified": found.identified[here].tolist()}


def _sensors(found: Learnt) -> dict[str, dict[str, float]]:
    names = ("gain", "gain_sd", "misfit", "noise")
    return {sensor: {name: float(getattr(found, name)[k]) for name in names}
            for k, sensor in enumerate(found.plate.sensor_names)}
