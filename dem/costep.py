"""The plate's half of the co-simulation: it follows the forces of the engine and says where it will be.

The engine's wall aims at the place where the plate is predicted to be at the end of the coming co-step; the prediction
takes the modal force to go on linearly, 2 F0 - F1. When the true mean force of that co-step is known the plate moves
under it, exactly. The scheme is of second order in the co-step, and conserves the impulse to round-off.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dem.exchange import PlatePipes
from dem.time_step import TimeStep
from plate_fem.motion import ModalMotion


def follow(motion: ModalMotion, pipes: PlatePipes, step: TimeStep, record: Callable[[int, np.ndarray], None]) -> None:
    """Serve the engine until it has finished.

    `record(dem_step, modal_force)` is called at each row of the fast stream, `motion` standing at that instant and
    `modal_force` acting: the mean over the co-step that ends there, carried on by half a co-step.
    """
    last_force = np.zeros_like(motion.amplitude)
    record(0, last_force)
    now = 0
    while (message := pipes.receive()) is not None:
        force = message.modal_force
        if message.co_steps != 1:  # after free flight there is no trend to go on with
            last_force = force
        trend = force - last_force
        now = _advance(motion, force, force + trend / 2, now, message.co_steps, step, record)
        predicted = force + trend
        last_force = force
        amplitude, rate = motion.predict(predicted)
        pipes.answer(message.step, motion.reach_m(amplitude, rate), amplitude, rate)
    none = np.zeros_like(last_force)
    _advance(motion, none, none, now, step.steps // step.co_step - now // step.co_step, step, record)


def _advance(motion, force, force_at_end, now, co_steps, step, record) -> int:
    """Move over `co_steps` under a constant force, stopping at each row of the fast stream."""
    end = now + co_steps * step.co_step
    while now < end:
        stop = min(end, (now // step.fast_steps + 1) * step.fast_steps)
        motion.advance(force, (stop - now) // step.co_step)
        now = stop
        if now % step.fast_steps == 0:
            record(now, force_at_end)
    return now
