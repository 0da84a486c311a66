"""The command `check`: are the channels of a record as the plate says?"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import isnan, nan
from pathlib import Path

from common.result import Result
from recognition.plate.plate_model import PlateModel
from recognition.plate.records import read_accelerations
from recognition.sensors.channel_check import check_channels


@dataclass(frozen=True)
class CheckResult(Result):
    """told: what is worth knowing; refused: why the record cannot be used, one text each. misfit: rms of the ringing
    that no motion of the plate explains, in shares of the record, and what is expected; NaN where no ringing was looked
    at."""

    told: tuple[str, ...]
    refused: tuple[str, ...]
    misfit: float = nan
    expected_misfit: float = nan

    def words(self) -> Iterator[str]:
        yield from self.told
        if self.refused:
            yield f"REFUSED: {'; '.join(self.refused)}"
        elif isnan(self.misfit):
            yield "too short for a look at free ringing: gains and order of the sensors are not checked"
        else:
            yield (f"{100 * self.misfit:.1f} % of the ringing is not explained, "
                   f"{100 * self.expected_misfit:.1f} % expected")


def check(record: str, plate: str, scale: float = 1.0, unit: str | None = None) -> CheckResult:
    """Look for faults in the channels of a record (see `record_table`), by a plate of `tap`. Raises RecordError,
    RecognitionError."""
    known = PlateModel.load(Path(plate))
    _, signals, rate_Hz = read_accelerations(record, known, scale, unit)
    found = check_channels(signals, rate_Hz, known)
    ringing = found.ringing
    if ringing is None:
        return CheckResult(found.told, found.refused)
    return CheckResult(found.told, found.refused, ringing.misfit, ringing.expected)
