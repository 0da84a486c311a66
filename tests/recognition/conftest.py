"""A plate known exactly, elastic stones, and a stream of them that was listened to."""

import numpy as np
import pytest

from lab.known_truth.simulated import draw_stones, stream_of
from recognition.innovations.prior import StonePrior
from recognition.plate.plate_model import PlateModel
from recognition.stone_forces.forces import StoneForces
from recognition.stream.recognise import RATE_Hz, recognise_stream
from tests.recognition.elastic_stones import CHANNELS, elastic_stone


@pytest.fixture(scope="session")
def histories():
    return [elastic_stone(g, 0.025, v) for g in (False, True) for v in (2.2, 2.6, 3.0, 3.4, 3.8)]


@pytest.fixture(scope="session")
def forces(histories):
    return StoneForces.fit(histories)


@pytest.fixture(scope="session")
def plate():
    return PlateModel.from_scene("scenes/single.toml", 12000.0)


@pytest.fixture(scope="session")
def heard(plate, histories, forces):
    """Twelve stones at 60 a second, and what was made of them with the plate known exactly."""
    rng = np.random.default_rng(5)
    truth = draw_stones(histories, 12, 60.0, 0.2, 0.5, rng)
    stream = stream_of(plate, CHANNELS, histories, truth, RATE_Hz, 20.0, rng)
    return stream, recognise_stream(plate, CHANNELS, StonePrior(forces, (0.025, 0.025), (2.0, 4.0)), stream.values)
