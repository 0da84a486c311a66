"""Faults of channels: each is found, a good record is not refused, and what is taken away is what was put in."""

import numpy as np
import pandas as pd
import pytest

from common.resources import resource
from lab.known_truth.faulty_records import FAULTS, REFUSED, SAYS, volley, with_fault
from recognition.__main__ import main
from recognition.estimation.errors import RecognitionError
from recognition.plate.plate_model import PlateModel
from recognition.sensors.channel_check import channel_faults, check_channels, samples_before_impact
from recognition.sensors.free_ringing import ringing_of

RATE_Hz = 20e3


@pytest.fixture(scope="module")
def plate():
    return PlateModel.from_scene(resource("scenes") / "paper.toml", 6000.0, shape_sd=0.03)


@pytest.fixture(scope="module")
def good(plate):
    return [volley(plate, RATE_Hz, np.random.default_rng(k)) for k in range(4)]


@pytest.mark.parametrize("fault", FAULTS[1:])
def test_fault_is_found(plate, good, fault):
    for k, record in enumerate(good[:2]):
        report = check_channels(with_fault(record, fault, RATE_Hz, np.random.default_rng(k)), RATE_Hz, plate)
        lines = report.refused if fault in REFUSED else report.told
        assert any(SAYS[fault] in line for line in lines), lines
        assert bool(report.refused) == (fault in REFUSED)


def test_good_records_pass(plate, good):
    for record in good:
        report = check_channels(record, RATE_Hz, plate)
        assert report.told == report.refused == () and np.array_equal(report.signals, record)


@pytest.mark.parametrize("silence", [True, False])
def test_offset_and_hum_are_taken_away(plate, good, silence):
    """Whether the record begins with silence or with the impact."""
    start = 0 if silence else round(6e-3 * RATE_Hz)
    record = np.hstack([0.0 * good[0][:, :1000], good[0]])[:, start + (0 if silence else 1000):]
    peak, t_s = abs(record).max(), np.arange(record.shape[1]) / RATE_Hz
    added = 0.05 * peak * (1 + np.sin(2 * np.pi * 50 * t_s + 0.4))
    humming = record.copy()
    humming[2] += added
    report = check_channels(humming, RATE_Hz, plate)
    left = report.signals[2] - record[2]
    assert report.hum.mains_Hz == 50.0
    assert np.sqrt(np.mean(left**2)) < 0.1 * np.sqrt(np.mean(added**2))
    assert abs(report.signals[[0, 1, 3]] - record[[0, 1, 3]]).max() < 0.01 * peak


def test_gains_of_a_ringing_plate(plate):
    """A pulse at an unknown place, no noise: gains to a thousandth, none for a gain that all have in common."""
    force = np.zeros((1, 600))
    force[0, :5] = 1000.0
    ringing = plate.response(force, [[0.06, -0.11]], RATE_Hz)[:, 100:300]
    gain = np.array([1.0, 0.9, 1.2, 1.0])
    found = ringing_of(3.0 * gain[:, None] * ringing, RATE_Hz, plate, np.zeros(4))
    assert found.gain == pytest.approx(gain, rel=5e-3)
    assert found.misfit < 1e-2 and found.order == (0, 1, 2, 3)


def test_a_second_blow_is_named_beside_another_plate(plate):
    force = np.zeros((2, 600))
    for k, at in enumerate((0.005, 0.015)):
        force[k, round(at * RATE_Hz):round(at * RATE_Hz) + 5] = 1000.0
    (refused,) = check_channels(plate.response(force, [[0.06, -0.11], [-0.09, 0.02]], RATE_Hz), RATE_Hz, plate).refused
    assert "is no motion of this plate" in refused and "or there was a second blow within 18 ms" in refused


@pytest.mark.slow
@pytest.mark.parametrize(("apart_s", "blows"), [(0.05, "6 of 6"), (0.02, "6 of 6")])
def test_a_sensor_that_loosens_after_some_blows_is_found(plate, apart_s, blows):
    """And blows that come before the ringing of the one before has gone are no fault."""
    rng, at_s = np.random.default_rng(4), 0.01 + apart_s * np.arange(6)
    force = np.zeros((6, round((at_s[-1] + 0.05) * RATE_Hz)))
    for row, k in zip(force, np.rint(at_s * RATE_Hz).astype(int), strict=True):
        row[k:k + 4] = 1000.0
    clean = plate.response(force, rng.uniform(-0.15, 0.15, (6, 2)), RATE_Hz)
    record = clean + 0.03 * clean.std(axis=1, keepdims=True) * rng.standard_normal(clean.shape)
    report = check_channels(record, RATE_Hz, plate)
    assert not report.refused and len(report.told) == 1 and f"{blows} blows are followed by free ringing" in report.told[0]
    record[2, round((at_s[3] - 1e-3) * RATE_Hz):] *= 0.3
    (refused,) = check_channels(record, RATE_Hz, plate).refused
    found_s, why = refused.removeprefix("from ").split(" s: ")
    assert abs(at_s[3:] - float(found_s)).min() < 2e-3 and why.startswith(f"{plate.sensor_names[2]}: gain 0.3")


def test_wrong_input_is_refused(plate, good):
    with pytest.raises(RecognitionError, match="needs 4 channels"):
        check_channels(good[0][:3], RATE_Hz, plate)
    broken = good[0].copy()
    broken[1, 7] = np.nan
    with pytest.raises(RecognitionError, match="not finite"):
        check_channels(broken, RATE_Hz, plate)


@pytest.mark.parametrize(("fault", "code", "said"), [
    ("none", 0, "not explained"), ("offset", 0, "offset"), ("swapped", 3, "REFUSED: sensors swapped")])
def test_command_says_what_it_found(plate, good, tmp_path, capsys, fault, code, said):
    plate.save(tmp_path / "plate.json")
    record = with_fault(good[0], fault, RATE_Hz, np.random.default_rng(0))
    columns = {f"acc_{name}_m_s2": row for name, row in zip(plate.sensor_names, record, strict=True)}
    times = {"t_s": np.arange(record.shape[1]) / RATE_Hz}
    pd.DataFrame(times | columns).to_csv(tmp_path / "record.csv", index=False)
    assert main(["check", str(tmp_path / "record.csv"), "--plate", str(tmp_path / "plate.json")]) == code
    assert said in capsys.readouterr().out
    main(["--quiet", "check", str(tmp_path / "record.csv"), "--plate", str(tmp_path / "plate.json")])
    assert (said in capsys.readouterr().out) == (code == 3)
    assert main(["check", str(tmp_path / "record.csv"), "--plate", str(tmp_path / "record.csv")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_silence_before_an_impact_is_counted():
    """A ringing from the first sample on has none; the same 15 ms later has them."""
    t_s = np.arange(267) / 6667.0
    rings = np.array([np.sin(2 * np.pi * 300 * t_s + phase) * np.exp(-60 * t_s) for phase in (0.5, 1.0, 2.0)])
    assert samples_before_impact(rings) == 0
    noise = 0.02 * np.random.default_rng(0).standard_normal((3, 367))
    assert samples_before_impact(np.hstack([np.zeros((3, 100)), rings]) + noise) in (98, 99, 100)
    rings[1] *= 1e-3
    assert channel_faults(rings, ("north", "west", "south")) == ["west: dead: it hardly moves"]
