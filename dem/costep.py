"""The plate's half of the co-simulation: it follows the forces of the engine and says where it will be.

The engine's wall aims at the place where the plate is predicted to be at the end of the coming co-step; the prediction
takes the modal force to go on linearly, 2 F0 - F1. When the true mean force of that co-step is known the plate moves
under it, exactly. The scheme is of second order in the co-step, and conserves the impulse to round-off.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dem.exchange import CHECKPOINT, PlatePipes
from dem.time_step import TimeStep
from plate_fem.motion import ModalMotion


@dataclass
class Place:
    """Where the plate is in the exchange: DEM step and the last modal force (modes,), None before the first record."""

    dem_step: int = 0
    last_force: np.ndarray | None = None


Record = Callable[[int, np.ndarray, np.ndarray, np.ndarray], None]


def follow(motion: ModalMotion, pipes: PlatePipes, step: TimeStep, record: Record, place: Place | None = None,
           keep: Callable[[int], None] = lambda dem_step: None) -> None:
    """Serve the engine until it has finished, from `place` on, which goes along.

    `record(dem_step, amplitude, rate, modal_force)` is called at each row of the fast stream with the state at that
    instant and the force then acting: the mean over the co-step that ends there, carried on by half a co-step.
    `keep(dem_step)` is called when the engine has kept its state at that step.
    """
    place = place or Place()
    none = np.zeros_like(motion.amplitude)
    if place.last_force is None:
        place.last_force = none
        record(0, motion.amplitude, motion.rate, none)
    while (message := pipes.receive()) is not None:
        if message.step == CHECKPOINT:
            keep(message.co_steps)
            pipes.answer(CHECKPOINT, 0.0, none, none)
            continue
        force = message.modal_force
        # After free flight there is no trend to go on with.
        trend = force - place.last_force if message.co_steps == 1 else none
        place.dem_step = _advance(motion, force, force + trend / 2, place.dem_step, message.co_steps, step, record)
        place.last_force = force
        amplitude, rate = motion.predict(force + trend)
        pipes.answer(message.step, motion.reach_m(amplitude, rate), amplitude, rate)
    _advance(motion, none, none, place.dem_step, (step.steps - place.dem_step) // step.co_step, step, record)


def _advance(motion, force, force_at_end, now, co_steps, step, record) -> int:
    """Move over `co_steps` under a constant force, stopping at each row of the fast stream."""
    end = now + co_steps * step.co_step
    while now < end:
        rows = min((end - now) // step.fast_steps, motion.ROWS)
        if rows > 1 and now % step.fast_steps == 0 and not force.any():
            now = _fly(motion, force, now, rows, step, record)
            continue
        stop = min(end, (now // step.fast_steps + 1) * step.fast_steps)
        motion.advance(force, (stop - now) // step.co_step)
        now = stop
        if now % step.fast_steps == 0:
            record(now, motion.amplitude, motion.rate, force_at_end)
    return now


def _fly(motion, no_force, now, rows, step, record) -> int:
    """`rows` rows of free motion at once; the same as one after the other."""
    for amplitude, rate in motion.free_states(step.fast_steps // step.co_step, rows):
        now += step.fast_steps
        record(now, amplitude, rate, no_force)
    return now
