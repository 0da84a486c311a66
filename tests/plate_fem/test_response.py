"""The modes' answer to a short push, against the equation of motion integrated in small steps."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from plate_fem.motion import pulse_response

STEP_s, COUNT = 2e-5, 300


@pytest.mark.parametrize(("frequency_Hz", "damping"), [(0.0, 0.0), (300.0, 0.01), (9000.0, 0.02), (25000.0, 0.3)])
def test_a_push_of_one_step(frequency_Hz, damping):
    modes = SimpleNamespace(frequency_Hz=np.array([frequency_Hz]), damping_ratio=np.array([damping]))
    amplitude, rate, acceleration = (a[:, 0] for a in pulse_response(modes, STEP_s, COUNT))
    omega = 2 * np.pi * frequency_Hz

    def moved(start, span, force):
        times = np.linspace(*span, 1 + round((span[1] - span[0]) / STEP_s))
        found = solve_ivp(lambda t, y: [y[1], force - 2 * damping * omega * y[1] - omega**2 * y[0]], span, start,
                          method="DOP853", rtol=1e-11, atol=1e-18, t_eval=times)
        return found.y

    pushed = moved([0, 0], (0, STEP_s), 1.0)
    free = moved(pushed[:, -1], (STEP_s, (COUNT - 1) * STEP_s), 0.0)
    q, r = np.hstack([pushed[:, :1], free])
    assert np.abs(amplitude - q).max() < 1e-7 * np.abs(q).max()
    assert np.abs(rate - r).max() < 1e-7 * np.abs(r).max()
    a = -2 * damping * omega * r - omega**2 * q
    a[:2] += 0.5  # mean of both sides of the jump
    assert np.abs(acceleration - a).max() < 1e-7 * np.abs(a).max()
