"""The arrangement likelihood on another plate than that of its training, which taps taught."""

from dataclasses import replace

import numpy as np
import pytest

from lab.known_truth import other_plates
from recognition import RecognitionError
from recognition.__main__ import main
from recognition.estimation.window import Window
from recognition.models import Model
from recognition.physics.arrangement_likelihood import MISFIT
from recognition.physics.arrangement_method import ArrangementLikelihood, on_plate
from recognition.plate.plate_model import PlateModel, modal_steps
from tests.recognition.test_arrangement_likelihood import NAMES, SAMPLES, STEP_s, draw, plate


@pytest.fixture(scope="module")
def method():
    X, ratios = draw(30, 1)
    return ArrangementLikelihood(exact_trigger=True).fit(X, ratios, groups=np.arange(30))


def learnt(thickness_m=0.008):
    return PlateModel.from_scene(plate(thickness_m), plate().max_frequency_Hz)


def channels(plate, force_N, place_m):
    """Accelerations and rod forces under forces on places."""
    amplitude, _, acceleration = modal_steps(plate, -plate.shape(*place_m.T).T @ force_N, 1 / STEP_s)
    return np.vstack([plate.sensor_shape @ acceleration, plate.rod_force_N_m @ amplitude])


@pytest.mark.parametrize("residual", [False, True])
def test_on_the_plate_of_the_training_nothing_changes(method, residual):
    """Residual modes stand for those that the finite elements have."""
    plate_of_it = learnt()
    if residual:
        plate_of_it = plate_of_it.with_residual_modes(PlateModel.from_scene(plate(), 2 * plate().max_frequency_Hz))
        assert plate_of_it.residual_modes == len(plate_of_it.sensor_names)
    found = on_plate(method.model_, plate_of_it)
    assert found.hat == pytest.approx(method.model_.hat, abs=1e-12 * abs(method.model_.hat).max())
    assert found.scatter == [] and found.names == method.model_.names


@pytest.mark.slow
def test_stones_on_another_plate_are_counted_once_it_was_tapped(method):
    """Of 8.2 instead of 8 mm: refused by the model of the training, right by that of the tapped plate. What modes above
    those that were learnt add is that of 8 mm."""
    X, ratios = draw(20, 5)
    other = learnt(0.0082)
    for k, x in enumerate(X):
        force_N, place_m = x.force_record.force_N, x.force_record.fall.place_m
        thick, thin = (channels(one, force_N, place_m) for one in (other, learnt()))
        X[k] = replace(x, signals=x.signals + (thick - thin)[:, :5 * SAMPLES:5])
    assert all(MISFIT in answer.out_of_distribution for answer in method.answer(X))
    found = method.on_plate(other).answer(X)
    assert np.mean([round(5 * r.ratio) == round(5 * b) for r, b in zip(found, ratios, strict=True)]) >= 0.95
    assert sum(answer.out_of_distribution != "" for answer in found) <= 1


def middle_response(model, one, moved_m=(0.0, 0.0), stones=slice(None)):
    """Of a plate to the mean force of coal and gangue on the places, samples at a row, in shares of the model's scale."""
    law, steps = model.law.mean_force.mean(axis=0), np.arange(model.hat.shape[1]) + 0.5
    force_N = sum(c * np.maximum(0, 1 - abs(steps - (b + 1) * model.width) / model.width) for b, c in enumerate(law))
    place_m = (model.place_m + moved_m)[stones]
    found = channels(one, np.tile(force_N, (len(place_m), 1)), place_m) / model.scale[:, None]
    return found[:, :SAMPLES * 5:5].ravel()


def scattered_covariance(model):
    rows = np.concatenate(model.scatter, axis=2)[:, :SAMPLES * 5:5]
    rows = rows.reshape(-1, rows.shape[2])
    return rows @ rows.T


@pytest.mark.slow
@pytest.mark.parametrize("what", ["frequency", "damping"])
def test_what_is_not_known_of_a_mode_scatters_records(method, what):
    """A frequency or a damping ratio that is off by its standard deviation, against two responses of the whole plate to
    the mean force on all places: one direction of scatter, whose covariance is that of the difference."""
    sd, exact = {"frequency": 0.004, "damping": 0.3}[what], learnt()
    only = (np.arange(exact.frequency_Hz.size) == np.argmax(exact.frequency_Hz > 500.0)).astype(float)
    model = on_plate(method.model_, replace(exact, **{f"{what}_sd": sd * only}))
    value = "frequency_Hz" if what == "frequency" else "damping_ratio"
    off = replace(exact, **{value: getattr(exact, value) * (1 + sd * only)})
    flat = middle_response(model, off) - middle_response(model, exact)
    assert scattered_covariance(model) == pytest.approx(np.outer(flat, flat), abs=1e-3 * np.max(flat**2))


def test_where_stones_touch_scatters_records_along_both_axes(method):
    """What a deviation of 1 mm adds, by moving each stone to either side along x and along y."""
    exact, expected = learnt(), 0
    model = on_plate(replace(method.model_, place_deviation_m=1e-3), exact)
    for stone in range(len(model.place_m)):
        for axis in np.eye(2):
            ends = [middle_response(model, exact, side * 5e-4 * axis, [stone]) for side in (1, -1)]
            expected = expected + np.outer(ends[0] - ends[1], ends[0] - ends[1])
    assert np.linalg.norm(scattered_covariance(model) - expected) < 0.05 * np.linalg.norm(expected)


def test_errors_of_shapes_are_independent_from_sensor_to_sensor(method):
    model = on_plate(method.model_, replace(learnt(), shape_sd=np.full(learnt().frequency_Hz.size, 0.02)))
    every = np.concatenate(model.scatter, axis=2)
    assert np.sqrt(np.mean(np.sum(every**2, axis=2))) == pytest.approx(0.03, abs=0.02)  # in shares of the signals
    north, west = (every[k].reshape(-1, every.shape[2]) for k in (0, 1))
    across = np.sum(north * west) / np.sqrt(np.sum(north**2) * np.sum(west**2))
    assert abs(across) < 0.5  # what they share is the error of the shape where stones fall


def test_a_plate_without_rods_leaves_their_channels_out(method):
    exact = learnt()
    bare = replace(exact, rod_force_N_m=np.zeros((0, exact.frequency_Hz.size)))
    assert on_plate(method.model_, bare).names == NAMES[:3]
    nameless = replace(bare, sensor_names=("a", "b", "c"))
    with pytest.raises(RecognitionError, match="none of the channels acc_s0"):
        on_plate(method.model_, nameless)


def test_other_methods_are_left_out(method):
    """They know nothing of the plate but what it was in their training."""
    model = Model(Window(20000.0, SAMPLES), {"arrangement_likelihood": method, "fusion_q": object()}, {"groups": 30})
    on_other = model.on_plate(other_plates.scattered(learnt(), 0.01, np.random.default_rng(0)))
    assert list(on_other.methods) == ["arrangement_likelihood"]
    assert on_other.left_out == {"fusion_q": "learnt on another plate"}
    with pytest.raises(RecognitionError, match="no method that knows of the plate"):
        replace(model, methods={"fusion_q": object()}).on_plate(learnt())


def test_command_takes_the_plate(monkeypatch, tmp_path, capsys):
    seen = []
    model = Model(Window(20000.0, SAMPLES), {}, {"groups": 30})
    monkeypatch.setattr(Model, "load", classmethod(lambda cls, path: model))
    monkeypatch.setattr(Model, "on_plate", lambda self, there: seen.append(there) or self)
    record, file = tmp_path / "record.csv", tmp_path / "plate.json"
    record.write_text("t_s,acc_s0_m_s2\n0,1\n1e-4,2\n")
    missing = main(["recognise", str(record), "--model", "model.json", "--plate", str(file)])
    assert (missing, capsys.readouterr().err.count("\n"), seen) == (2, 1, [])
    learnt().save(file)
    main(["recognise", str(record), "--model", "model.json", "--plate", str(file)])
    assert seen[0].frequency_Hz == pytest.approx(learnt().frequency_Hz)
