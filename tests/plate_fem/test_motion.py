"""Modal motion against an independent integrator, and its conservation laws."""

from types import SimpleNamespace

import numpy as np
import pytest
from plates import plate
from scipy.integrate import solve_ivp

from common.input_error import InputError
from plate_fem.impact import deflection_warnings
from plate_fem.modes import plate_modes
from plate_fem.motion import ModalMotion, RecordedMotion, pulse_response

FREQUENCY_Hz = np.array([0.0, 0.0, 3.0, 180.0, 181.0, 2345.0, 19900.0])


def motion_of(damping, interval_s, frequency_Hz=FREQUENCY_Hz, seed=0):
    modes = SimpleNamespace(frequency_Hz=frequency_Hz, damping_ratio=np.full(len(frequency_Hz), damping))
    motion = ModalMotion(modes, interval_s)
    rng = np.random.default_rng(seed)
    amplitude, rate = rng.normal(size=(2, len(frequency_Hz)))
    motion.set_state({"amplitude": amplitude * 1e-4, "rate": rate})
    return motion


def integrate(motion, damping, force, duration_s):
    """Amplitude, rate, work and damped energy by DOP853."""
    n, omega = len(FREQUENCY_Hz), 2 * np.pi * FREQUENCY_Hz

    def slope(t, y):
        q, v = y[:n], y[n : 2 * n]
        loss = 2 * damping * omega * v
        return np.concatenate([v, force - loss - omega**2 * q, [force @ v, loss @ v]])

    start = np.concatenate([motion.amplitude, motion.rate, [0, 0]])
    y = solve_ivp(slope, (0, duration_s), start, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    return y[:n], y[n : 2 * n], y[-2], y[-1]


@pytest.mark.parametrize("damping", [0.0, 0.02])
@pytest.mark.parametrize("interval_s", [5e-6, 2.2e-4])  # the second turns the highest mode four times
def test_agrees_with_dop853(damping, interval_s):
    motion = motion_of(damping, interval_s)
    force = np.random.default_rng(3).normal(size=len(FREQUENCY_Hz)) * 50
    amplitude, rate, work, damped = integrate(motion, damping, force, interval_s)
    motion.advance(force)
    assert motion.amplitude == pytest.approx(amplitude, rel=1e-9, abs=1e-9 * abs(amplitude).max())
    assert motion.rate == pytest.approx(rate, rel=1e-9, abs=1e-9 * abs(rate).max())
    assert motion.work_J == pytest.approx(work, rel=1e-9)
    assert motion.damped_J == pytest.approx(damped, rel=1e-9, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("steps", [100_000, pytest.param(1_000_000, marks=pytest.mark.validate)])
def test_free_steps_keep_the_energy_of_every_mode(steps):
    motion = motion_of(0.0, 5e-6, FREQUENCY_Hz[2:])
    omega, force = 2 * np.pi * FREQUENCY_Hz[2:], np.zeros(5)

    def energy():
        return (motion.rate**2 + (omega * motion.amplitude) ** 2) / 2

    start = energy()
    for _ in range(steps):
        motion.advance(force)
    assert energy().sum() == pytest.approx(start.sum(), rel=1e-12, abs=0)
    assert energy() == pytest.approx(start, rel=1e-12, abs=0)


def test_many_intervals_at_once_are_many_single_ones():
    one, many = motion_of(0.01, 5e-6), motion_of(0.01, 5e-6)
    force = np.linspace(-30, 40, len(FREQUENCY_Hz))
    for _ in range(700):
        one.advance(force)
    many.advance(force, 700)
    assert one.amplitude == pytest.approx(many.amplitude, rel=1e-11, abs=1e-17)
    assert one.rate == pytest.approx(many.rate, rel=1e-11, abs=1e-12)
    assert one.damped_J == pytest.approx(many.damped_J, rel=1e-9)


@pytest.mark.parametrize("push", [0.0, 30.0])
def test_rows_at_once_are_those_of_single_steps(push):
    one, many = motion_of(0.01, 5e-6), motion_of(0.01, 5e-6)
    force = push * np.linspace(-1, 1.3, len(FREQUENCY_Hz))
    states = np.concatenate([many.advance_rows(force, 3, ModalMotion.ROWS), many.advance_rows(force, 3, 72)])
    for amplitude, rate in states:
        one.advance(force, 3)
        assert one.amplitude == pytest.approx(amplitude, rel=1e-11, abs=1e-13 * abs(amplitude).max())
        assert one.rate == pytest.approx(rate, rel=1e-11, abs=1e-13 * abs(rate).max())
    assert np.array_equal(many.amplitude, states[-1, 0]) and np.array_equal(many.rate, states[-1, 1])
    assert many.damped_J == pytest.approx(one.damped_J, rel=1e-11)


@pytest.mark.parametrize("interval_s", [0.0, -1e-6, np.nan, np.inf])
def test_an_interval_that_is_no_length_of_time_is_refused(interval_s):
    with pytest.raises(InputError, match="interval_s = .*: must be above 0 and finite"):
        motion_of(0.01, interval_s)


@pytest.mark.parametrize("damping", [-0.01, 1.0, 1.2, np.nan])
def test_a_mode_that_does_not_oscillate_is_refused(damping):
    with pytest.raises(InputError, match="damping_ratio: must be from 0 to below 1"):
        motion_of(damping, 5e-6)


def test_what_is_not_finite_is_refused_and_moves_nothing():
    motion, bad = motion_of(0.01, 5e-6), np.full(len(FREQUENCY_Hz), np.nan)
    state = motion.state.copy()
    for move in (lambda: motion.advance(bad), lambda: motion.advance_rows(bad, 1, 3),
                 lambda: motion.set_state({"amplitude": bad, "rate": bad})):
        with pytest.raises(InputError, match="must be finite"):
            move()
        assert np.array_equal(motion.state, state)
    with pytest.raises(InputError, match="count = 1"):
        pulse_response(motion._modes, 1e-5, 1)


def test_predict_is_advance_without_the_change():
    motion = motion_of(0.01, 5e-6)
    before, force = motion.get_state(), np.ones(len(FREQUENCY_Hz))
    amplitude, rate = motion.predict(force)
    assert all(np.array_equal(before[k], motion.get_state()[k]) for k in before)
    motion.advance(force)
    assert np.array_equal(motion.amplitude, amplitude) and np.array_equal(motion.rate, rate)


def test_state_round_trip_repeats_the_run_to_the_bit():
    motion, force = motion_of(0.01, 5e-6), np.ones(len(FREQUENCY_Hz))
    motion.advance(force)
    state = motion.get_state()
    motion.advance(2 * force)
    again = motion_of(0.01, 5e-6, seed=9)
    again.set_state(state)
    again.advance(2 * force)
    assert np.array_equal(again.amplitude, motion.amplitude) and again.work_J == motion.work_J
    assert again.damped_J == motion.damped_J


@pytest.mark.parametrize("damping", [0.01, 0.5])
def test_acceleration_is_the_derivative_of_the_rate(damping):
    motion, force, h = motion_of(damping, 1e-9), np.full(len(FREQUENCY_Hz), 7.0), 1e-9
    acceleration = motion.acceleration_at(motion.amplitude, motion.rate, force)
    _, rate = motion.predict(force)
    assert (rate - motion.rate) / h == pytest.approx(acceleration, rel=1e-3, abs=1e-4)


def test_reach_bounds_free_motion_and_is_attained():
    frequency = np.array([100.0, 271.8])
    modes = SimpleNamespace(frequency_Hz=frequency, damping_ratio=np.zeros(2), largest_shape=np.array([0.4, 0.7]))
    motion = ModalMotion(modes, 1e-5)
    motion.set_state({"amplitude": np.array([1e-4, -2e-4]), "rate": np.array([0.1, 0.05])})
    reach, largest = motion.reach_m(motion.amplitude, motion.rate), 0.0
    for _ in range(30_000):
        motion.advance(np.zeros(2))
        largest = max(largest, modes.largest_shape @ abs(motion.amplitude))
    assert 0.99 * reach < largest <= reach


def test_a_moving_rigid_body_mode_has_no_bound():
    modes = SimpleNamespace(frequency_Hz=np.zeros(1), damping_ratio=np.zeros(1), largest_shape=np.ones(1))
    motion = ModalMotion(modes, 1e-5)
    assert motion.reach_m(np.array([1e-3]), np.zeros(1)) == pytest.approx(1e-3)
    assert motion.reach_m(np.zeros(1), np.array([1e-9])) >= 1e9


def test_a_deflection_beyond_linear_theory_is_warned_of():
    """By half of the thickness: of a simply supported plate in its first mode, 2/sqrt(m) sin sin with four nodes about
    the middle, a seventh of the side apart; of a free one from its mean plane, wherever that is."""
    for edges, number in (("simply_supported", 0), ("free", 3)):
        table = plate(edges=edges, max_frequency_Hz=600.0)
        modes = plate_modes(table)
        amplitude = np.zeros((300, len(modes.frequency_Hz)), np.float32)
        amplitude[:, :number] = 10.0  # rigid
        peak = 2 / np.sqrt(modes.mass_kg) * np.cos(np.pi / 14)**2
        if edges == "free":
            peak = abs(modes.shape[:, number]).max()
        for share in (0.49, 0.51):
            amplitude[200, number] = share * table.thickness_m / peak
            lines = deflection_warnings(table, RecordedMotion(modes, np.arange(300.0), *3 * [amplitude]))
            assert [f"deflects by {share:g} of it" in line for line in lines] == [True] * (share > 0.5)
