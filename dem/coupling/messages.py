"""What the engine tells the plate (docs/coupling.md)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.input_error import CommandError

STOPPED = 75


class CouplingError(CommandError, RuntimeError):
    """The other side died, fell silent, or wrote something that is not of the protocol."""


@dataclass(frozen=True)
class ForceMessage:
    """The stones pushed the plate until DEM step `step`.

    `modal_force` (modes,) is the mean force over the `co_steps` co-steps that ended there, N kg^-1/2. The engine asks
    where the plate will be `extrapolated_co_steps` co-steps later, and waits for the answer.
    """

    step: int
    co_steps: int
    extrapolated_co_steps: int
    modal_force: np.ndarray


@dataclass(frozen=True)
class CheckpointMessage:
    """The engine has its state of DEM step `step` on disk, and waits until the plate has its own."""

    step: int


@dataclass(frozen=True)
class FinishedMessage:
    """The engine has made its last step, and waits until the plate knows."""


Message = ForceMessage | CheckpointMessage | FinishedMessage
