"""Motion of the modes under a force that lasts one step; the motion under any other force is a sum of such."""

from __future__ import annotations

import numpy as np

from plate_fem.modes import PlateModes
from plate_fem.motion import ModalMotion


def pulse_response(modes: PlateModes, step_s: float, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return amplitude, rate and acceleration (count, n) of every mode under a unit modal force from 0 to step_s.

    They are exact. Rows belong to the times 0, step_s, 2 step_s ...; units are those of `ModalMotion` per N kg^-1/2. At
    0 and at step_s, where the force jumps, the acceleration is the mean of both sides.

    >>> modes = plate_modes(read_plate("scenes/small.toml").model_copy(update={"max_frequency_Hz": 500.0}))
    >>> amplitude, rate, acceleration = pulse_response(modes, step_s=1e-4, count=200)
    >>> amplitude.shape == (200, modes.frequency_Hz.size)
    True
    """
    motion = ModalMotion(modes, step_s)
    n = len(modes.frequency_Hz)
    states = np.zeros((count, 2, n))
    motion.advance(np.ones(n))
    states[1] = motion.amplitude, motion.rate
    for start in range(2, count, motion.ROWS):
        rows = min(motion.ROWS, count - start)
        states[start:start + rows] = motion.advance_rows(np.zeros(n), 1, rows)
    force = np.zeros((count, 1))
    force[:2] = 0.5
    amplitude, rate = states[:, 0], states[:, 1]
    return amplitude, rate, motion.acceleration_at(amplitude, rate, force)
