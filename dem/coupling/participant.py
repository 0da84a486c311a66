"""The plate's half of the coupling: it moves under the forces of the engine and says where it will be.

The engine's wall aims at where the plate is predicted to be at the next message. The prediction extrapolates the modal
force linearly, 2 F0 - F1 from the last two. When the true mean force of that time is known, the plate moves under it,
exactly. The scheme is of second order in the time between messages, and conserves the impulse to round-off.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from dem.coupling.messages import CheckpointMessage, CouplingError, FinishedMessage, ForceMessage
from dem.coupling.pipes import PlatePipes
from dem.deck.time_step import TimeStep
from plate_fem.motion import ModalMotion


@dataclass
class CouplingState:
    """How far the coupling is: the DEM step, the last modal force (modes,), which is None before the first row is
    recorded, the co-steps over which that force is the mean, and the co-steps that the engine then asked to
    extrapolate."""

    dem_step: int = 0
    last_force: np.ndarray | None = None
    co_steps: int = 0
    extrapolated_co_steps: int = 0


Recorder = Callable[[range, np.ndarray, np.ndarray, np.ndarray], None]


@dataclass
class PlateParticipant:
    """A plate in `motion` that answers the engine; `state` says where to go on and is kept up to date.

    `record(dem_steps, states, force, last_force)` is called with one or several rows of the fast stream: amplitude and
    rate (rows, 2, modes) at each, and the force then acting, (modes,), which is another one at the last row. There it
    is the mean over the time that ends there, extrapolated by half of that time to its end.
    """

    motion: ModalMotion
    step: TimeStep
    record: Recorder
    state: CouplingState = field(default_factory=CouplingState)

    def run(self, pipes: PlatePipes, keep: Callable[[int], None] = lambda dem_step: None) -> None:
        """Answer the engine until it has finished. `keep(dem_step)` is called when the engine has written its half of a
        checkpoint. Raises CouplingError."""
        none = np.zeros_like(self.motion.amplitude)
        if self.state.last_force is None:
            self.state.last_force = none
            self.record(range(1), self.motion.state[None], none, none)
        while not isinstance(message := pipes.receive(), FinishedMessage):
            if isinstance(message, CheckpointMessage):
                keep(message.step)
                pipes.confirm(message)
            else:
                amplitude, rate = self._move(message)
                pipes.answer(message.step, self.motion.reach_m(amplitude, rate), amplitude, rate)
        pipes.confirm(message)
        self._advance(none, none, (self.step.steps - self.state.dem_step) // self.step.co_step)

    def _move(self, message: ForceMessage) -> tuple[np.ndarray, np.ndarray]:
        """Move over the time that the message covers; return the state predicted for when the engine asked. Raises
        CouplingError if that time does not begin where the last message ended, or ends after the run."""
        state, force = self.state, message.modal_force
        due = state.dem_step + message.co_steps * self.step.co_step
        if message.step != due or due > self.step.steps:
            raise CouplingError(f"the engine sent step {message.step} after {message.co_steps} co-steps from step "
                                f"{state.dem_step}; allowed is {due}, up to the last one, {self.step.steps}")
        slope = self._trend(message) * (force - state.last_force)
        self._advance(force, force + slope * (message.co_steps / 2), message.co_steps)
        state.last_force, state.co_steps = force, message.co_steps
        state.extrapolated_co_steps = message.extrapolated_co_steps
        extrapolated = force + slope * ((message.co_steps + message.extrapolated_co_steps) / 2)
        amplitude, rate = self.motion.predict(extrapolated, message.extrapolated_co_steps)
        return amplitude, rate

    def _trend(self, message: ForceMessage) -> float:
        """One over the co-steps between the middles of the last two forces, which are means. It is 0 after free flight,
        when there is no trend to extrapolate."""
        gapless = 0 < message.co_steps == self.state.extrapolated_co_steps
        return 2 / (self.state.co_steps + message.co_steps) if gapless else 0.0

    def _advance(self, force: np.ndarray, force_at_end: np.ndarray, co_steps: int) -> None:
        """Move over `co_steps` under a constant force, and record each row of the fast stream."""
        motion, step, now = self.motion, self.step, self.state.dem_step
        end = now + co_steps * step.co_step
        while now < end:
            rows = min((end - now) // step.fast_steps, motion.ROWS)
            if rows > 1 and now % step.fast_steps == 0:
                states = motion.advance_rows(force, step.fast_steps // step.co_step, rows)
                steps = range(now + step.fast_steps, now + rows * step.fast_steps + 1, step.fast_steps)
            else:
                stop = min(end, (now // step.fast_steps + 1) * step.fast_steps)
                motion.advance(force, (stop - now) // step.co_step)
                states, steps = motion.state[None], range(stop, stop + 1)
            now = steps[-1]
            if now % step.fast_steps == 0:
                self.record(steps, states, force, force_at_end if now == end else force)
        self.state.dem_step = now
