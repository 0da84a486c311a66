"""Elastic stones, and streams of them, that tests of listening share."""

import numpy as np
from scipy.integrate import solve_ivp

from recognition.innovations.coloured_noise import SensorNoise
from recognition.innovations.signatures import FINE_S, Channels
from recognition.stone_forces.forces import PULSE_S, History
from recognition.stream.recognise import RATE_Hz

CHANNELS = Channels((0, 1, 2, 3))
#: Contact modulus with the steel plate, Pa, and density of coal and gangue as in scenes/paper.toml.
ELASTIC = {False: (5.49e9, 1380.0), True: (10.32e9, 2400.0)}


def elastic_stone(gangue, radius_m, speed_m_s):
    """Force of an elastic sphere on a rigid half-space, by integration of its motion."""
    modulus, density = ELASTIC[gangue]
    stiffness, mass = 4 / 3 * modulus * np.sqrt(radius_m), 4 / 3 * np.pi * radius_m**3 * density

    def motion(_, y):
        return [y[1], -stiffness * max(y[0], 0.0) ** 1.5 / mass]

    t_s = (np.arange(round(PULSE_S / FINE_S)) + 0.5) * FINE_S
    found = solve_ivp(motion, (0, t_s[-1]), [0.0, speed_m_s], t_eval=t_s, rtol=1e-8, atol=1e-12)
    return History(stiffness * np.maximum(found.y[0], 0) ** 1.5, FINE_S, gangue, radius_m, density, speed_m_s)


def surely_told(stones, truth):
    """How many stones have a material that is no doubt, which is right: of speeds from 2.2 to 3.8 m/s a few are in doubt."""
    sure = abs(stones["gangue"] - 0.5) > 0.3
    assert ((stones["gangue"] > 0.5) == truth["gangue"])[sure].all()
    return sure.sum()


def after_noise(stream, seconds):
    """The record with so much of its white noise before it."""
    deviation = stream.values[:, :round(0.04 * RATE_Hz)].std(axis=1, keepdims=True)
    before = deviation * np.random.default_rng(3).standard_normal((len(deviation), round(seconds * RATE_Hz)))
    return np.hstack([before, stream.values])


def white(deviation):
    """Independent white noise of sensors, of standard deviations (c,)."""
    return SensorNoise(np.diag(1 / deviation)[None], 1.0)
