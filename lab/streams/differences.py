"""What a stream may differ in from what `listen` is told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from common.scene.plate import FlexiblePlate, read_plate
from lab.known_truth.faults import FAULTS, Fault
from lab.known_truth.simulated import Stream
from lab.known_truth.stone_histories import histories
from lab.streams.known_streams import SCENE, Case, TRUE_Hz, scaled, true_plate
from recognition.plate.plate_model import PlateModel
from recognition.stone_forces.forces import History
from recognition.stream.recognise import RATE_Hz

Changed = Callable[[Stream], Stream]


def with_fault(fault: Fault) -> Changed:
    return lambda record: replace(record, values=fault(record.values, RATE_Hz))


def _late(record: Stream) -> Stream:
    """The record from the tenth stone on: no silence before."""
    cut_s = record.truth["t_s"].iloc[9] + 1e-3
    truth = record.truth.iloc[10:].reset_index(drop=True)
    truth = truth.assign(t_s=truth["t_s"] - cut_s, centre_s=truth["centre_s"] - cut_s)
    return replace(record, values=record.values[:, round(cut_s * RATE_Hz):], truth=truth)


def _thinner() -> PlateModel:
    table = read_plate(SCENE)
    assert isinstance(table, FlexiblePlate)
    return PlateModel.from_scene(table.model_copy(update={"thickness_m": 0.99 * table.thickness_m}), TRUE_Hz)


def _moved_sensor(plate: PlateModel) -> PlateModel:
    shape = plate.sensor_shape.copy()
    shape[0] = plate.shape(plate.sensor_m[:1, 0], plate.sensor_m[:1, 1] - 0.02)[0]
    return replace(plate, sensor_shape=shape)


@dataclass(frozen=True)
class Difference:
    """What is other than `listen` is told: the true plate, the record, or the stones."""

    name: str
    plate: Callable[[], PlateModel] | None = None
    record: Changed | None = None
    stones: Callable[[list[History]], list[History]] | None = None
    case: Case = Case()
    untapped: bool = False


def differences() -> list[Difference]:
    first = lambda: true_plate("1")  # noqa: E731
    exact = lambda: PlateModel.from_scene(SCENE, TRUE_Hz)  # noqa: E731
    return [
        Difference("radius 20 mm", stones=lambda pool: [scaled(h, 0.8) for h in pool]),
        Difference("two stones at once", case=Case(at_once=2)),
        Difference("three stones at once", case=Case(at_once=3)),
        Difference("bonds 25 % weaker or stronger", stones=lambda _: histories("other_rock")),
        Difference("nothing"),
        Difference("radius 30 mm", stones=lambda pool: [scaled(h, 1.2) for h in pool]),
        Difference("radii 15 to 35 mm", case=Case(all_sizes=True)),
        Difference("noise of 10 dB", case=Case(noise_db=10.0)),
        Difference("a sensor 20 mm off", lambda: _moved_sensor(first())),
        Difference("five stones at once", case=Case(at_once=5)),
        Difference("speed 1 to 1.5 m/s", stones=lambda pool: [scaled(h, 1.0, 0.5) for h in pool if h.speed_m_s < 2.9]),
        Difference("all modes 1 % higher than tapped",
                   lambda: replace(first(), frequency_Hz=1.01 * first().frequency_Hz)),
        Difference("another plate's taps", lambda: true_plate("2")),
        *(Difference(name, record=with_fault(fault)) for name, fault in FAULTS.items()),
        Difference("record begins amid the stream", record=_late),
        Difference("plate not tapped, damping twice", lambda: replace(exact(), damping_ratio=2 * exact().damping_ratio),
                   untapped=True),
        Difference("plate not tapped, modes 1 % off", first, untapped=True),
        Difference("plate not tapped, 1 % thinner", _thinner, untapped=True),
        Difference("plate not tapped, other theory", lambda: true_plate("other theory"), untapped=True),
    ]
