"""The plate's half of the co-simulation: it follows the forces of the engine and says where it will be.

The engine's wall aims at the place where the plate is predicted to be at the next exchange; the prediction takes the modal
force to go on linearly, 2 F0 - F1. When the true mean force of that time is known the plate moves under it, exactly. The
scheme is of second order in the time between exchanges, and conserves the impulse to round-off.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from dem.coupling.pipes import CHECKPOINT, Message, PlatePipes
from dem.deck.time_step import TimeStep
from plate_fem.motion import ModalMotion


@dataclass
class Place:
    """Where the plate is in the exchange: DEM step, the last modal force (modes,), None before the first record, the
    co-steps that it is the mean of, and how many co-steps ahead the engine then asked."""

    dem_step: int = 0
    last_force: np.ndarray | None = None
    co_steps: int = 0
    ahead: int = 0


Record = Callable[[range, Sequence, list[np.ndarray]], None]


def follow(motion: ModalMotion, pipes: PlatePipes, step: TimeStep, record: Record, place: Place | None = None,
           keep: Callable[[int], None] = lambda dem_step: None) -> None:
    """Serve the engine until it has finished, from `place` on, which goes along.

    `record(dem_steps, states, modal_forces)` is called with rows of the fast stream, one or several: the state (amplitude,
    rate) at each, and the force then acting: the mean over the time that ends there, carried on by half of it at its end.
    `keep(dem_step)` is called when the engine has kept its state at that step.
    """
    place = place or Place()
    none = np.zeros_like(motion.amplitude)
    if place.last_force is None:
        place.last_force = none
        record(range(1), [(motion.amplitude, motion.rate)], [none])
    while (message := pipes.receive()) is not None:
        if message.step == CHECKPOINT:
            keep(message.co_steps)
            pipes.answer(CHECKPOINT, 0.0, none, none)
            continue
        force = message.modal_force
        slope = _slope(place, message) * (force - place.last_force)
        place.dem_step = _advance(motion, force, force + slope * (message.co_steps / 2), place.dem_step, message.co_steps,
                                  step, record)
        place.last_force, place.co_steps, place.ahead = force, message.co_steps, message.ahead
        amplitude, rate = motion.predict(force + slope * ((message.co_steps + message.ahead) / 2), message.ahead)
        pipes.answer(message.step, motion.reach_m(amplitude, rate), amplitude, rate)
    _advance(motion, none, none, place.dem_step, (step.steps - place.dem_step) // step.co_step, step, record)


def _slope(place: Place, message: Message) -> float:
    """One over the co-steps between the middles of the last two forces, which are means; 0 after free flight, when there is
    no trend to go on with."""
    followed = 0 < message.co_steps == place.ahead
    return 2 / (place.co_steps + message.co_steps) if followed else 0.0


def _advance(motion, force, force_at_end, now, co_steps, step, record) -> int:
    """Move over `co_steps` under a constant force, stopping at each row of the fast stream."""
    end = now + co_steps * step.co_step
    while now < end:
        rows = min((end - now) // step.fast_steps, motion.ROWS)
        if rows > 1 and now % step.fast_steps == 0:
            states = motion.advance_rows(force, step.fast_steps // step.co_step, rows)
            steps = range(now + step.fast_steps, now + rows * step.fast_steps + 1, step.fast_steps)
        else:
            stop = min(end, (now // step.fast_steps + 1) * step.fast_steps)
            motion.advance(force, (stop - now) // step.co_step)
            states, steps = [(motion.amplitude, motion.rate)], range(stop, stop + 1)
        now = steps[-1]
        if now % step.fast_steps == 0:
            record(steps, states, [force] * (len(steps) - 1) + [force_at_end if now == end else force])
    return now
