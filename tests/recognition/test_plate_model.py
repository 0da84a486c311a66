"""The plate as its sensors know it, against the finite elements and against an integrator of scipy."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from common.files.cache import user_cache
from common.resources import resource
from common.scene.plate import read_plate
from common.tables import InputError, Refused
from plate_fem.modes import plate_modes
from recognition.estimation.errors import RecognitionError
from recognition.plate.plate_model import PlateModel, modal_steps

SCENE = resource("scenes") / "paper.toml"


@pytest.fixture(scope="module")
def model():
    return PlateModel.from_scene(SCENE, 3000.0)


def test_shapes_and_sensors_are_those_of_the_finite_elements(model):
    plate = read_plate(SCENE).model_copy(update={"max_frequency_Hz": 3000.0})
    modes = plate_modes(plate, user_cache())
    points = np.random.default_rng(1).uniform(-0.25, 0.25, (200, 2))
    assert model.frequency_Hz == pytest.approx(modes.frequency_Hz)
    assert model.shape(*points.T) == pytest.approx(modes.shape_at(points), abs=1e-3 * abs(modes.shape).max())
    assert model.sensor_names == ("north", "west", "south", "east")
    assert model.sensor_shape[1] == pytest.approx(modes.shape_at(np.array([[-0.15, 0.05]]))[0])


@pytest.mark.parametrize("highest_Hz", [0.0, -5.0, np.nan])
def test_modes_up_to_no_frequency_are_refused(highest_Hz):
    with pytest.raises(InputError, match="paper.toml: plate.max_frequency_Hz = .*: must be above 0"):
        PlateModel.from_scene(SCENE, highest_Hz)
    with pytest.raises(Refused, match="^max_frequency_Hz = "):
        plate_modes(read_plate(SCENE).model_copy(update={"max_frequency_Hz": highest_Hz}))


@pytest.mark.parametrize("off_m, left", [((0.0, 0.0), 0.1), ((0.02, -0.01), 0.1), ((0.1, -0.2), 1.0)])
def test_residual_modes_stand_for_all_modes_above(model, off_m, left):
    """The steady motion of every mode by its formula: of what is missed up to 0.8 of the highest mode that is kept, little
    is left about an accelerometer, and nothing is worse far away."""
    wide, f_Hz = PlateModel.from_scene(SCENE, 6000.0), np.linspace(200, 2400, 50)[:, None]

    def seen(plate):
        shapes = plate.sensor_shape[0] * plate.shape(*(plate.sensor_m[0] + off_m)[:, None])[0]
        w, own, zeta = 2 * np.pi * f_Hz, 2 * np.pi * plate.frequency_Hz, plate.damping_ratio
        return np.sum(-w**2 * shapes / (own**2 - w**2 + 2j * zeta * own * w), axis=1)

    missed, still = (abs(seen(plate) - seen(wide)) for plate in (model, model.with_residual_modes(wide)))
    assert np.sqrt(np.mean(still**2)) < left * np.sqrt(np.mean(missed**2))


def test_response_is_that_of_an_integrator(model):
    """DOP853, restarted where a force jumps, which is at every sample."""
    rng, rate_Hz = np.random.default_rng(2), 20e3
    force, places = rng.uniform(0, 1000, (2, 40)), np.array([[0.1, 0.0], [-0.07, 0.11]])
    omega, zeta, down = 2 * np.pi * model.frequency_Hz, model.damping_ratio, -model.shape(*places.T)
    state, before, expected, rods = np.zeros(2 * len(omega)), np.zeros(len(omega)), [], []
    for column in force.T:
        push = column @ down
        amplitude, speed = np.split(state, 2)
        free = -2 * zeta * omega * speed - omega**2 * amplitude
        expected.append(model.sensor_shape @ ((push + before) / 2 + free))
        rods.append(model.rod_force_N_m @ amplitude)
        state = solve_ivp(lambda t, y, f=push: np.concatenate(
            [y[len(f):], f - 2 * zeta * omega * y[len(f):] - omega**2 * y[:len(f)]]),
            (0, 1 / rate_Hz), state, method="DOP853", rtol=1e-10, atol=1e-14).y[:, -1]
        before = push
    assert model.response(force, places, rate_Hz) == pytest.approx(np.array(expected).T, rel=1e-7, abs=1e-6)
    assert model.rod_force_N_m @ modal_steps(model, down.T @ force, rate_Hz)[0] == pytest.approx(np.array(rods).T, rel=1e-7, abs=1e-6)


def test_a_rigid_mode_goes_as_far_as_its_constant_force_pushes_it():
    """f t^2/2 under a force that lasts, and on at its speed once it ends."""
    free, t = SimpleNamespace(frequency_Hz=np.zeros(1), damping_ratio=np.zeros(1)), np.arange(9) / 20e3
    amplitude, rate, _ = modal_steps(free, np.array([[3.0] * 5 + [0.0] * 4]), 20e3)
    pushed, after = np.minimum(t, t[5]), np.maximum(t - t[5], 0)
    assert amplitude[0] == pytest.approx(1.5 * pushed**2 + 3 * t[5] * after)
    assert rate[0] == pytest.approx(3 * pushed)


def test_a_free_plate_keeps_its_momentum():
    plate = read_plate(SCENE).model_copy(update={"rods": ()})
    model = PlateModel.from_scene(plate, 1000.0)
    force = np.zeros((1, 2000))
    force[0, :10] = 500.0
    rate_Hz = 20e3
    assert (model.frequency_Hz == 0).sum() == 3 and model.rod_force_N_m.shape[0] == 0
    velocity = np.cumsum(model.response(force, [[0.0, 0.0]], rate_Hz)[:, :], axis=1) / rate_Hz
    mass_kg = plate.density_kg_m3 * 0.02 * 0.25
    rigid = -force.sum() / rate_Hz / mass_kg  # about which the bending modes ring
    assert velocity[:, 100:].mean(axis=1) == pytest.approx(rigid, rel=0.02)


def test_a_file_comes_back_and_a_damaged_one_is_refused(model, tmp_path):
    file = tmp_path / "plate.json"
    model.save(file)
    again = PlateModel.load(file)
    assert np.array_equal(again.grid_shape, model.grid_shape) and again.sensor_names == model.sensor_names
    content = json.loads(file.read_text())
    content["frequency_Hz"][0] *= 1.01
    file.write_text(json.dumps(content))
    with pytest.raises(RecognitionError, match="plate.json"):
        PlateModel.load(file)


def test_a_place_beside_the_plate_is_refused(model):
    with pytest.raises(RecognitionError, match="x_m = 0.3"):
        model.shape(np.array([0.3]), np.array([0.0]))


def test_forces_that_are_not_finite_and_no_rate_are_refused(model):
    for force, place, rate_Hz in ((np.nan, 0.0, 1e4), (1.0, np.inf, 1e4), (1.0, 0.0, 0.0), (1.0, 0.0, -1.0), (1.0, 0.0, np.nan)):
        with pytest.raises(RecognitionError, match="finite"):
            model.response([[force, 0.0]], [[place, 0.0]], rate_Hz)


@pytest.mark.parametrize("places", [[[0.0, 0.0, 0.02]], [[0.0, 0.0], [0.1, 0.0]]])
def test_a_force_acts_at_one_point_of_the_plate(model, places):
    with pytest.raises(RecognitionError, match="needs \\(x, y\\) of each"):
        model.response([[1.0, 0.0]], places, 1e4)
