"""The file that says which records are of stones that one knows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from common.tables import Table, about, check, read_toml
from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.plate.plate_model import PlateModel
from recognition.plate.records import record_table
from recognition.stone_forces.forces import MATERIALS
from recognition.stream.listen import Heard
from recognition.stream.prior import StonePrior
from recognition.stream.recognise import QUIET_S, channels_of, hear


class KnownTable(Table):
    """One record of stones that fall on the tapped plate."""

    record: Annotated[str, about("beside this file, as `listen` takes it")]
    kind: Annotated[Literal["coal", "gangue"], about("of all stones of the record")]
    silence_s: Annotated[float, Field(ge=QUIET_S, le=1e3), about("beginning without stones")] = QUIET_S


class KnownFile(Table):
    """The whole file."""

    known: Annotated[tuple[KnownTable, ...], Field(min_length=1), about("the records")]


def read_known(path: str | Path, plate: PlateModel, prior: StonePrior, scale: float,
               unit: str | None) -> Sequence[tuple[Sequence[Heard], int]]:
    """The stones of each record that a file names, and their material. Raises InputError for the file, RecordError or
    RecognitionError for a record."""
    content: KnownFile = check(KnownFile, read_toml(path), path)
    return [(_stones(Path(path).parent / one.record, one, plate, prior, scale, unit), MATERIALS.index(one.kind))
            for one in content.known]


def _stones(file: Path, one: KnownTable, plate: PlateModel, prior: StonePrior, scale: float,
            unit: str | None) -> Sequence[Heard]:
    table, source = record_table(str(file), scale, unit)
    channels, values = channels_of(table, plate, source)
    try:
        found = hear(plate, channels, prior, values, one.silence_s)
        reason = found.checks.reason()
    except NotRecognised as error:
        reason = str(error)
    if reason:
        raise RecognitionError(f"{source}: known stones are not explained: {reason}")
    return found.heard
