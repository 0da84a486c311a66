"""The command `volley`: the mixing ratio of stones that arrive at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from common.result import Result
from recognition.estimation.answer import Answer
from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.plate.plate_model import PlateModel
from recognition.plate.records import record_table
from recognition.stone_forces.law_file import load_forces
from recognition.stream.recognise import channels_of
from recognition.volley.impulses import WRONG_SPEED
from recognition.volley.recognise import Found, recognise_volley
from recognition.volley.responses import Stones

COUNTS, RADII_m, SPEEDS_m_s = (2, 30), (0.005, 0.1), (2.0, 3.2)  # faster coal breaks, and pushes less


@dataclass(frozen=True)
class VolleyResult(Result):
    """Mixing ratio, by number and by mass, of stones that arrive from `arrival_s` on; others: that by number if the
    stones were a little different from those told.

    refused: why the record was not looked at; not_explained: why it is not of such stones; "" of both for an answer."""

    arrival_s: float | None = None
    misfit: float | None = None
    mixing_ratio: Mapping[str, Answer] = field(default_factory=dict)
    others: Mapping[str, float] = field(default_factory=dict)
    refused: str = ""
    not_explained: str = ""

    def words(self) -> Iterator[str]:
        if self.refused:
            yield f"REFUSED: {self.refused}"
        elif self.not_explained:
            yield f"NOT EXPLAINED, no ratio can be trusted: {self.not_explained}"
        else:
            yield f"stones at {self.arrival_s:.4f} s, misfit {self.misfit:.2f}"
            for name, answer in self.mixing_ratio.items():
                yield f"mixing ratio by {name} {answer.text}"
            yield ("the record does not tell whether the stones are those told; by number it would be "
                   + ", ".join(f"{text} {100 * ratio:.0f} %" for text, ratio in self.others.items()))


def volley(record: str, plate: str, stones: Sequence[int], radius_m: float, speed_m_s: Sequence[float],
           scale: float = 1.0, unit: str | None = None) -> VolleyResult:
    """Judge a record on a plate of `tap` by what is told of the stones: how many, or the fewest and the most; their
    radius; their speed, or the lowest and the highest. Raises RecordError, RecognitionError."""
    counts, speeds_m_s = _between("stones", stones, COUNTS), _between("speed", speed_m_s, SPEEDS_m_s)
    _between("radius", [radius_m], RADII_m)
    known = PlateModel.load(Path(plate))
    table, source = record_table(record, scale, unit)
    channels, values = channels_of(table, known, source)
    sensors, told = channels.accelerometers, Stones((int(counts[0]), int(counts[1])), radius_m, speeds_m_s)
    try:
        found = recognise_volley(known, sensors, told, load_forces(), values[:len(sensors)])
    except NotRecognised as error:
        return VolleyResult(refused=str(error))
    if found.refused:
        return VolleyResult(not_explained=found.refused)
    return VolleyResult(found.arrival_s + float(table["t_s"].iloc[0]), found.likelihood.misfit,
                        {name: Answer.between(*found.ratio(name == "mass")) for name in ("number", "mass")},
                        {text: found.ratio(stones=other)[1] for text, other in _others(found)})


def _others(found: Found) -> Iterator[tuple[str, Stones]]:
    """Stones a little different from those told."""
    (fewest, most), radius_m, (low, high) = found.stones.counts, found.stones.radius_m, found.stones.speeds_m_s
    for more in (-1, 1):
        yield f"with one stone {'more' if more > 0 else 'fewer'}", Stones((fewest + more, most + more), radius_m,
                                                                       (low, high))
    for factor in (1 - WRONG_SPEED, 1 + WRONG_SPEED):
        yield f"{WRONG_SPEED:.0%} {'faster' if factor > 1 else 'slower'}", Stones((fewest, most), radius_m,
                                                                                  (low * factor, high * factor))


def _between(name: str, values: Sequence[float], limits: tuple[float, float]) -> tuple[float, float]:
    """One value, or the lower and the higher of two."""
    low, high = values[0], values[-1]
    if len(values) > 2 or not limits[0] <= low <= high <= limits[1]:
        given = " ".join(f"{value:g}" for value in values)
        raise RecognitionError(f"--{name} {given}: must be a number between {limits[0]:g} and {limits[1]:g}, "
                               "or two such numbers, the lower first")
    return low, high
