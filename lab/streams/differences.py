"""What a stream may differ in from what `listen` is told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from common.scene.plate import FlexiblePlate, read_plate
from lab.known_truth.faults import FAULTS, Fault
from lab.known_truth.simulated import Stream
from lab.streams.known_streams import SCENE, TRUE_Hz, true_plate
from recognition.plate.plate_model import PlateModel
from recognition.stream.recognise import RATE_Hz

Changed = Callable[[Stream], Stream]


def with_fault(fault: Fault) -> Changed:
    return lambda record: replace(record, values=fault(record.values, RATE_Hz))


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
    """What is other than `listen` is told: the true plate, or the record."""

    name: str
    plate: Callable[[], PlateModel] | None = None
    record: Changed | None = None
    untapped: bool = False


def differences() -> list[Difference]:
    first = lambda: true_plate("1")  # noqa: E731
    exact = lambda: PlateModel.from_scene(SCENE, TRUE_Hz)  # noqa: E731
    return [
        Difference("a sensor 20 mm off", lambda: _moved_sensor(first())),
        Difference("all modes 1 % higher than tapped",
                   lambda: replace(first(), frequency_Hz=1.01 * first().frequency_Hz)),
        Difference("another plate's taps", lambda: true_plate("2")),
        *(Difference(name, record=with_fault(fault)) for name, fault in FAULTS.items()),
        Difference("plate not tapped, damping twice", lambda: replace(exact(), damping_ratio=2 * exact().damping_ratio),
                   untapped=True),
        Difference("plate not tapped, modes 1 % off", first, untapped=True),
        Difference("plate not tapped, 1 % thinner", _thinner, untapped=True),
        Difference("plate not tapped, other theory", lambda: true_plate("other theory"), untapped=True),
    ]
