"""Records that others measured, where they are at hand: what was struck is told, and what is no volley stays refused."""

import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat

from analysis import RecordError
from analysis.files.readers import read_signals
from lab.real import records
from lab.real.records import FRAME, LEVELS, band_levels
from recognition.estimation.errors import RecognitionError
from recognition.plate.plate_model import PlateModel
from recognition.sensors.channel_check import check_channels


def at_hand(name):
    folder = records.real(name)
    return pytest.mark.skipif(folder is None, reason=f"real records {name!r} are not at hand")


@at_hand("balls")
def test_balls_of_6_and_10_mm_are_told_apart_by_the_pulse_of_a_stone():
    found = records.balls(records.real("balls"))
    assert found["records"] >= 12 and found["told_percent"] >= 95
    assert found["size_ratio"] == pytest.approx(10 / 6, rel=0.05)


@at_hand("plate_hits")
def test_one_hit_predicts_the_next_the_worse_the_longer():
    found = records.hits(records.real("plate_hits"))
    assert 3 < found["least_percent_10_ms"] < found["most_percent_10_ms"] < 12
    assert 15 < found["least_percent_200_ms"] < found["most_percent_200_ms"] < 35


@pytest.mark.slow
@at_hand("ramp")
def test_what_runs_down_a_ramp_is_told_from_recordings_that_were_held_out():
    found = records.ramp(records.real("ramp"))
    assert found["windows"] >= 100 and found["told_percent"] >= 85


def test_duration_and_impulse_of_a_pulse_in_noise(tmp_path):
    """A half sine to the power 1.5, whose standard deviation follows from quadrature, and its echo."""
    rng, t_s = np.random.default_rng(3), np.arange(3127) / 625e3
    found = []
    for length_s in (30e-6, 50e-6):
        phase = (t_s - 8e-4) / length_s
        pulse = np.where((phase > 0) & (phase < 1), np.sin(np.pi * np.clip(phase, 0, 1)) ** 1.5, 0.0)
        echo = 0.5 * np.roll(pulse, round(1.2 * length_s * 625e3))
        x = -0.2 * (pulse + echo) + 0.001 * rng.standard_normal(t_s.size)
        pd.DataFrame({"t_s": t_s, "u": x}).to_csv(tmp_path / "x.csv", index=False)
        s, impulse = records.contact(tmp_path / "x.csv")
        found.append((s, impulse / (0.2 * pulse.sum() / 625e3)))
        exact = np.sqrt(np.sum(pulse * (t_s - np.sum(pulse * t_s) / pulse.sum()) ** 2) / pulse.sum())
        assert s == pytest.approx(exact, rel=0.1)
    assert found[1][0] / found[0][0] == pytest.approx(5 / 3, rel=0.03)
    assert [push for _, push in found] == pytest.approx([1.0, 1.0], rel=0.1)


def test_band_levels_are_those_of_a_periodogram_and_rare_blows_raise_the_mean_power():
    rng = np.random.default_rng(1)
    hiss = rng.standard_normal((2, 65_536))
    mean, log_mean, spread = band_levels(hiss).reshape(2, 3, LEVELS).swapaxes(0, 1)
    exact = np.log(np.sum(np.hanning(FRAME) ** 2) * FRAME / 2 / LEVELS)  # of white noise of unit variance
    assert mean == pytest.approx(exact, abs=0.3) and np.all(log_mean < mean) and np.all(spread < 0.7)
    blows = hiss * np.where(np.arange(65_536) % 4096 < 64, 30.0, 1.0)
    of_blows = band_levels(blows).reshape(2, 3, LEVELS)
    assert np.all(of_blows[:, 0] - mean > 1.5) and np.all(of_blows[:, 1] - log_mean < 1.5)
    assert np.all(of_blows[:, 2] > spread)
    tone = band_levels(np.sin(2 * np.pi * 100.5 / 512 * np.arange(4096))[None]).reshape(3, LEVELS)[0]
    assert tone.argmax() == 12  # bins 97 to 104 of 1 to 256
    with pytest.raises(RecordError, match="needs 1024"):
        band_levels(hiss[:, :1000])
    with pytest.raises(RecordError, match="silent"):
        band_levels(np.zeros((1, 2000)))


def foreign():
    """Accelerations (4, n) of what no plate of ours has measured, with their rates."""
    for name in ("hit_a", "hit_b"):
        yield name, loadmat(records.real("plate_hits") / f"{name}.mat")["Data"].T[1:, :3000], 10e3
    for file in sorted(records.real("ramp").glob("*_2.wav")):
        signals = read_signals(file).drop(columns="t_s").to_numpy().T
        yield file.stem, np.concatenate([signals[:, 40_000:44_000], signals[:, 50_000:54_000]]), 44_100.0


@pytest.mark.slow
@at_hand("plate_hits")
@at_hand("ramp")
def test_records_of_another_plate_are_refused():
    from common.resources import resource

    plate = PlateModel.from_scene(resource("scenes") / "paper.toml", 3000.0)
    judged = {}
    for name, signals, rate_Hz in foreign():
        try:
            judged[name] = bool(check_channels(signals.astype(float), rate_Hz, plate).refused)
        except RecognitionError:
            judged[name] = True
    assert len(judged) >= 7 and all(judged.values()), judged
