"""Stones one by one in noise: what the quiet beginning of a record tells of it."""

import numpy as np
import pytest

from lab.known_truth.machine_noise import noise
from recognition.estimation.errors import NotRecognised
from recognition.innovations.coloured_noise import SensorNoise
from recognition.innovations.prior import StonePrior
from recognition.innovations.whitening import Whitening
from recognition.stream.recognise import RATE_Hz, recognise_stream
from tests.recognition.elastic_stones import CHANNELS, after_noise, surely_told


@pytest.mark.slow
@pytest.mark.parametrize("after_s", [1e-3, 20e-3])
def test_a_record_without_silence_is_refused(heard, plate, forces, after_s):
    """It begins when the plate rings from the second stone, at once or later."""
    values = heard[0].values[:, round((heard[0].truth["t_s"][1] + after_s) * RATE_Hz):]
    prior = StonePrior(forces, (0.025, 0.025), (2.0, 4.0))
    try:
        refused = recognise_stream(plate, CHANNELS, prior, values).refused
    except NotRecognised as error:
        refused = str(error)
    assert "quiet" in refused


@pytest.mark.slow
def test_silence_before_the_stream_changes_nothing(heard, plate, forces):
    """Ten seconds of noise before the first stone: the same stones, none besides, and nothing is left unexplained."""
    stream, _ = heard
    found = recognise_stream(plate, CHANNELS, StonePrior(forces, (0.025, 0.025), (2.0, 4.0)), after_noise(stream, 10.0))
    assert len(found.stones) == len(stream.truth)
    assert np.abs(found.stones["t_s"] - 10 - stream.truth["t_s"]).max() < 50e-6
    assert found.checks.unexplained < 0.02


def autoregression(samples, rng):
    """Three channels that depend on their last two samples and each other, their coefficients, and the covariance of what
    is new."""
    coefficients = np.array([[[0.5, 0.2, 0.0], [0.0, 0.3, -0.2], [0.1, 0.0, 0.6]],
                             [[-0.6, 0.0, 0.1], [0.1, -0.5, 0.0], [0.0, 0.2, -0.3]]])
    root = np.array([[2.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.5, -0.5, 0.3]])
    values = root @ rng.standard_normal((3, samples))
    for t in range(2, samples):
        values[:, t] += coefficients[0] @ values[:, t - 1] + coefficients[1] @ values[:, t - 2]
    return values, coefficients, root @ root.T


def test_noise_is_learnt_from_the_quiet():
    """Whitening filter and spectrum of an autoregression that is known; the half that is louder is seen in either."""
    values, coefficients, covariance = autoregression(20_000, np.random.default_rng(11))
    learnt = SensorNoise.of(values)
    assert learnt.change < 1.1
    inverse = np.linalg.inv(learnt.filter[0])
    assert inverse @ inverse.T == pytest.approx(covariance, abs=0.1)
    assert -inverse @ learnt.filter[1:3] == pytest.approx(coefficients, abs=0.1)  # four standard errors
    white = learnt.whitened(values)[:, 50:]
    assert np.cov(white) == pytest.approx(np.eye(3), abs=0.05)
    assert white[:, 1:] @ white[:, :-1].T / white.shape[1] == pytest.approx(np.zeros((3, 3)), abs=0.05)
    f_Hz = np.array([200.0, 3000.0, 9000.0])
    for f, found in zip(f_Hz, learnt.spectrum(f_Hz, RATE_Hz), strict=True):
        turn = np.exp(-2j * np.pi * f / RATE_Hz)
        transfer = np.linalg.inv(np.eye(3) - coefficients[0] * turn - coefficients[1] * turn**2)
        exact = 2 / RATE_Hz * (transfer @ covariance @ transfer.conj().T).real
        assert found == pytest.approx(exact, abs=0.1 * exact.max())
    for louder in (slice(None, 10_000), slice(10_000, None)):
        changed = values.copy()
        changed[:, louder] *= 2.0
        assert SensorNoise.of(changed).change == pytest.approx(4.0, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["mixture", "drifting tones"])
def test_stones_in_the_noise_of_a_machine(heard, plate, forces, kind):
    """The twelve stones after a second of noise of 10 dB."""
    stream, _ = heard
    values, rng = after_noise(stream, 1.0), np.random.default_rng(9)
    level = np.sqrt(0.1 * np.mean(stream.values**2, axis=1, keepdims=True))
    values = values + level * noise(kind, values.shape, RATE_Hz, rng)
    found = recognise_stream(plate, CHANNELS, StonePrior(forces, (0.025, 0.025), (2.0, 4.0)), values, 1.0)
    assert found.refused == ""
    assert len(found.stones) == len(stream.truth)
    assert np.abs(found.stones["t_s"] - 1.0 - stream.truth["t_s"]).max() < 50e-6
    assert surely_told(found.stones, stream.truth) >= 8


def test_filters_in_turn_are_one():
    """Also the floor: white noise that is learnt besides."""
    rng = np.random.default_rng(4)
    values, *_ = autoregression(20_000, rng)
    first = Whitening(rng.standard_normal((3, 3, 200)) * np.exp(-np.arange(200) / 20))
    learnt = SensorNoise.of(first(values))
    assert first.then(learnt)(values) == pytest.approx(learnt.whitened(first(values)), abs=1e-2)
    half = SensorNoise.of(rng.standard_normal((3, 20_000)), 3.0)
    assert half.filter[0] == pytest.approx(0.5 * np.eye(3), abs=0.02)
