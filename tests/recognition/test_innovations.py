"""What a stone looks like in a record, and what a record says beyond the ringing, against independent references."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import expm

from lab.known_truth.machine_noise import noise
from lab.known_truth.simulated import draw_stones, scattered, stream_of
from recognition.innovations.bank import FIT_LAGS, LAGS, SHAPE_STEP_M, TIME, Bank
from recognition.innovations.coloured_noise import SensorNoise
from recognition.innovations.prior import StonePrior
from recognition.innovations.retuning import retuned, shifted
from recognition.innovations.signatures import DURATIONS_S, FINE_S, LEAD, Channels, low_passed
from recognition.innovations.whitening import Whitening, _free_motion, _observation, _seen
from recognition.stream.listen import BLOCK
from recognition.stream.recognise import LEAST_FREQUENCY_SD, PHASE_LOSS, RATE_Hz, recognise_stream
from tests.recognition.elastic_stones import CHANNELS, after_noise, elastic_stone, white


@pytest.mark.slow
def test_signature_is_the_whitened_response(plate, forces):
    """Against the plate model's own exact response to the force, low-passed and whitened as a record is."""
    whitening = Whitening.of(plate, CHANNELS, RATE_Hz, white(np.ones(4)), np.full(4, 10.0))
    bank = Bank.of(plate, CHANNELS, forces, whitening, RATE_Hz)
    stone = np.array([30.33, np.log(42e-6), 0.0525, -0.0775, -1.2, np.log(0.7)])
    first, whole = bank.whole(stone)
    t_s = (np.arange(4000) + 0.5) * FINE_S - stone[TIME] / RATE_Hz
    force = 0.7 * (forces.pulse(0, 42e-6, t_s) - 1.2 * forces.pulse(1, 42e-6, t_s))
    record = low_passed(plate.response(force, np.array([[0.0525, -0.0775]]), 1 / FINE_S), 10)
    expected = whitening(record)[:, first:first + LAGS]
    assert first == 30 - LEAD
    size = np.sqrt(np.mean(expected**2))
    assert np.sqrt(np.mean((whole - expected) ** 2)) < 0.02 * size
    fitted = bank.signature(stone)[1][0].reshape(FIT_LAGS, 4).T
    assert np.sqrt(np.mean((fitted - expected[:, :FIT_LAGS]) ** 2)) < 0.02 * np.sqrt(np.mean(expected[:, :FIT_LAGS] ** 2))


def test_a_signature_ends_when_one_channel_rings_no_more(plate, forces):
    """What was left of strong stones beyond the end would be heard as stones."""
    uncertain = replace(plate, frequency_sd=np.full(len(plate.frequency_Hz), LEAST_FREQUENCY_SD))
    noise = white(np.ones(1))
    whitening = Whitening.of(uncertain, Channels((0,)), RATE_Hz, noise, np.full(1, 30.0), PHASE_LOSS)
    force = 1.2 * forces.pulse(0, 42e-6, (np.arange(8000) + 0.5) * FINE_S - 1e-3)
    for place in [(0.06, -0.07), (0.15, 0.1), (-0.18, 0.02)]:
        record = low_passed(plate.response(force[None], np.array([place]), 1 / FINE_S), 10)[:1]
        ringing = whitening(record / np.sqrt(np.mean(record**2)) * 30)[0]
        energy = np.convolve(ringing**2, np.ones(BLOCK), "valid")
        first = round(1e-3 * RATE_Hz) - LEAD
        assert energy[first + LAGS:].max() < BLOCK + 6 * np.sqrt(2 * BLOCK)  # from which a stone is searched for


@pytest.mark.slow
def test_derivatives_of_a_signature(plate, forces):
    """By the signatures of the neighbours on the grids of times, durations and places."""
    whitening = Whitening.of(plate, CHANNELS, RATE_Hz, white(np.ones(4)), np.full(4, 10.0))
    bank = Bank.of(plate, CHANNELS, forces, whitening, RATE_Hz)
    stone = np.array([30.3, np.log(DURATIONS_S[11]), 0.0525, -0.0775, 0.3, np.log(0.7)])
    rows = bank.signature(stone)[1].astype(float)
    one_duration = np.log(DURATIONS_S[12] / DURATIONS_S[11])
    for k, step in enumerate([1 / bank.phases, one_duration, SHAPE_STEP_M, SHAPE_STEP_M, 0.5, 1e-2]):
        up, down = (bank.signature(stone + s * step * np.eye(6)[k])[1][0].astype(float) for s in (1, -1))
        slope = (up - down) / (2 * step)
        assert np.abs(slope - rows[1 + k]).max() < 0.02 * np.abs(slope).max()


def test_free_motion_is_that_of_damped_oscillators():
    w, zeta, step_s = np.array([300.0, 4000.0]), np.array([0.02, 0.1]), 1e-4
    rate = np.block([[np.zeros((2, 2)), np.eye(2)], [np.diag(-(w**2)), np.diag(-2 * zeta * w)]])
    assert _free_motion(w, zeta, step_s) == pytest.approx(expm(rate * step_s), rel=1e-9, abs=1e-12)


def test_channels_of_free_motion_and_what_a_filter_makes_of_them(plate):
    """Accelerometers feel how the rates change, and a filter of noise passes the modes' earlier samples, too."""
    kept, rng = (plate.frequency_Hz > 0) & (plate.frequency_Hz < 3000), np.random.default_rng(4)
    w, zeta, n = 2 * np.pi * plate.frequency_Hz[kept], np.full(kept.sum(), 0.05), kept.sum()
    observed = _observation(plate, CHANNELS, kept, w, zeta)
    start = np.concatenate([rng.standard_normal(n), w * rng.standard_normal(n)])
    little = 1e-4 / w.max()
    faster = (_free_motion(w, zeta, little) - _free_motion(w, zeta, -little))[n:] @ start / (2 * little)
    expected = plate.sensor_shape[list(CHANNELS.accelerometers)][:, kept] @ faster
    assert observed @ start == pytest.approx(expected, rel=1e-5, abs=1e-7 * np.abs(expected).max())
    step, white = _free_motion(w, zeta, 1 / RATE_Hz), rng.standard_normal((3, len(observed), len(observed)))
    states = [start, step @ start, step @ step @ start]
    passed = sum(white[lag] @ observed @ states[2 - lag] for lag in range(3))
    assert _seen(observed, white, step) @ states[2] == pytest.approx(passed, rel=1e-6, abs=1e-9 * np.abs(passed).max())


def test_innovations_of_free_ringing_are_noise(plate):
    """Ringing that began long before is predicted, and what is left is white with the sensors' noise."""
    rng = np.random.default_rng(2)
    truth = pd.DataFrame({"t_s": [0.001], "x_m": [0.05], "y_m": [0.08], "history": [0]})
    stone = elastic_stone(True, 0.025, 3.0)
    stream = stream_of(plate, CHANNELS, [stone], truth, RATE_Hz, None, rng, after_s=0.3)
    deviation = 0.1 * stream.values[:, :2000].std(axis=1)
    values = stream.values + deviation[:, None] * rng.standard_normal(stream.values.shape)
    whitening = Whitening.of(plate, CHANNELS, RATE_Hz, white(deviation),
                              stream.values.std(axis=1) / deviation)
    late = whitening(values)[:, 1000:]
    assert np.std(late) < 1.1
    assert np.std(whitening(values)[:, 15:60]) > 5 * np.std(late)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["white", "tones"])
def test_frequencies_from_the_ringing(plate, histories, kind):
    rng = np.random.default_rng(3)
    truth = draw_stones(histories, 40, 60.0, 0.24, 0.5, rng)
    stream = stream_of(plate, CHANNELS, histories, truth, RATE_Hz, 20.0, rng)
    wrong = scattered(plate, 0.005, rng)
    values, before_s = stream.values, 0.04
    if kind != "white":  # as loud as the stones
        values, before_s = after_noise(stream, 1.0), 1.0
        values = values + np.std(values, axis=1, keepdims=True) * noise(kind, values.shape, RATE_Hz, rng)
    quiet = round(before_s * RATE_Hz)
    right = retuned(wrong, CHANNELS, values[:, quiet if kind != "white" else 0:], RATE_Hz, SensorNoise.of(values[:, :quiet]))
    kept = plate.frequency_Hz < 6000
    before, after = (np.median(np.abs(p.frequency_Hz / plate.frequency_Hz - 1)[kept]) for p in (wrong, right))
    assert after < 0.6 * before
    damping = np.log(right.damping_ratio / plate.damping_ratio)[kept & (plate.frequency_Hz > 60)]  # was known, and is kept
    assert abs(damping.mean()) < 4 * damping.std() / np.sqrt(len(damping))


@pytest.mark.slow
def test_a_plate_that_is_warmer_than_when_it_was_tapped(plate, histories, forces):
    """All frequencies are 1 % off; a plate that is as it was, or is farther off, stays as it was thought to be."""
    rng = np.random.default_rng(5)
    truth = draw_stones(histories, 12, 60.0, 0.2, 0.5, rng)
    quiet = round(0.02 * RATE_Hz)
    for factor, followed in ((0.99, 0.99), (1.0, 1.0), (1.04, 1.0)):
        true = replace(plate, frequency_Hz=factor * plate.frequency_Hz)
        values = stream_of(true, CHANNELS, histories, truth, RATE_Hz, 20.0, rng).values
        found = shifted(plate, CHANNELS, values[:, quiet:], RATE_Hz, SensorNoise.of(values[:, :quiet]))
        assert found.frequency_Hz == pytest.approx(followed * plate.frequency_Hz, rel=2e-3)
        if factor < 1:
            heard = recognise_stream(plate, CHANNELS, StonePrior(forces, (0.025, 0.025), (2.0, 4.0)), values)
            assert heard.refused == "" and len(heard.stones) == len(truth)
    assert found is plate
