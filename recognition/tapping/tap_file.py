"""The file that says which records are taps, and where the plate was tapped."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from common.tables import Table, about, check, read_toml
from recognition.plate.plate_model import PlateModel
from recognition.plate.records import numbers, read_accelerations
from recognition.tapping.fit import Prior
from recognition.tapping.taps import Tap

Deviation = Annotated[float, Field(ge=1e-9, le=1)]


class TapTable(Table):
    """One tap."""

    record: Annotated[str, about("beside this file: t_s, acc_NAME_m_s2 and, where measured, force_N; or FRFs")]
    x_m: Annotated[float, about("place along the plate's length, from its centre")]
    y_m: Annotated[float, about("place along the plate's width, from its centre")]
    unknown_force: Annotated[bool, about("take no notice of force_N")] = False


class PriorTable(Table):
    """Standard deviations of what is not known beforehand."""

    frequency: Annotated[Deviation, about("of a frequency, relative")] = Prior.frequency
    damping: Annotated[Deviation, about("of the logarithm of a damping ratio")] = Prior.damping
    gain: Annotated[Deviation, about("of a sensor's gain, relative")] = Prior.gain
    place_m: Annotated[Deviation, about("of the place of a sensor or a tap along x and y")] = Prior.place_m


class TapFile(Table):
    """The whole file."""

    taps: Annotated[tuple[TapTable, ...], Field(min_length=1), about("the taps")]
    prior: PriorTable = PriorTable()
    scale: Annotated[float, about("factor on the samples of accelerations")] = 1.0
    unit: Annotated[str | None, about("unit of the scaled samples, where their names do not say it")] = None


def read_taps(path: str | Path, plate: PlateModel) -> tuple[list[Tap], Prior]:
    """The taps that a file names, with the plate's sensors in their order, and what is known beforehand.

    Raises InputError for the file, RecordError or RecognitionError for a record.
    """
    content: TapFile = check(TapFile, read_toml(path), path)
    taps = [_tap(Path(path).parent / table.record, table, plate, content) for table in content.taps]
    return taps, Prior(**content.prior.model_dump())


def _tap(file: Path, table: TapTable, plate: PlateModel, content: TapFile) -> Tap:
    found, acceleration, rate_Hz = read_accelerations(file, plate, content.scale, content.unit)
    force = None if table.unknown_force or "force_N" not in found.columns else numbers(found, "force_N", file)
    place = np.array([table.x_m, table.y_m])
    plate.shape(*place[:, None])  # refuses a place beside the plate
    return Tap(place, acceleration, rate_Hz, force, str(file))
