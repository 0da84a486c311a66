"""The plate's end of the file exchange with the engine (docs/exchange.md)."""

from __future__ import annotations

import math
import os
import select
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

TIMEOUT_s = 600.0  # of silence from a living engine; set-up of a large scene takes minutes
POLL_s = 0.2
CLOSED = -1
FINISHED, CHECKPOINT = -1, -2  # in the place of the step


class ExchangeError(RuntimeError):
    """The other side died, fell silent, or wrote something that is not of the protocol."""


@dataclass(frozen=True)
class Message:
    """`modal_force` (modes,) is the mean over the `co_steps` that ended at DEM step `step`, N kg^-1/2. The engine asks where
    the plate will be `ahead` co-steps later.

    With the step CHECKPOINT the engine says that it has kept its state at DEM step `co_steps`.
    """

    step: int
    co_steps: int
    ahead: int
    modal_force: np.ndarray


class PlatePipes:
    """Two named pipes in `directory`; `alive` tells whether the engine still runs."""

    def __init__(self, directory: Path, modes: int, alive: Callable[[], bool], timeout_s: float = TIMEOUT_s):
        self._names = [directory / "to_plate", directory / "from_plate"]
        self._modes = modes
        self._answer = np.zeros(2 + 2 * modes, dtype="<f8")  # step, which is an integer, reach, amplitude, rate
        self._answer_step = self._answer[:1].view("<i8")
        self._alive = alive
        self._timeout_s = timeout_s
        self._in: int = CLOSED
        self._out: int = CLOSED
        for name in self._names:
            name.unlink(missing_ok=True)
            os.mkfifo(name)

    def open(self) -> None:
        """Open both, in the order in which the engine does. Raises ExchangeError if the engine is gone."""
        self._in = os.open(self._names[0], os.O_RDONLY | os.O_NONBLOCK)
        # Opening to write waits for a reader; without blocking it fails until there is one, so the engine is watched.
        deadline = time.monotonic() + self._timeout_s
        while self._out == CLOSED:
            try:
                self._out = os.open(self._names[1], os.O_WRONLY | os.O_NONBLOCK)
            except OSError:
                self._check(deadline)
                time.sleep(0.01)
        os.set_blocking(self._out, True)

    def close(self) -> None:
        for descriptor in (self._in, self._out):
            if descriptor != CLOSED:
                os.close(descriptor)
        for name in self._names:
            name.unlink(missing_ok=True)

    def receive(self) -> Message | None:
        """The next message, or None when the engine says that it has finished."""
        data = self._read(24 + 8 * self._modes)
        step, co_steps, ahead = struct.unpack_from("<qqq", data)
        if step == FINISHED:
            return None
        force = np.frombuffer(data, dtype="<f8", offset=24)
        if not math.isfinite(force @ force):
            raise ExchangeError(f"the engine sent a force that is no number at step {step}")
        if step != CHECKPOINT and (step < 0 or co_steps < 0 or ahead < 1):
            raise ExchangeError(f"the engine sent step {step}, {co_steps} co-steps and {ahead} ahead; allowed are numbers "
                                "from 0, 0 and 1 on")
        return Message(step, co_steps, ahead, force)

    def answer(self, step: int, reach_m: float, amplitude: np.ndarray, rate: np.ndarray) -> None:
        """Where the plate is predicted to be, as far after `step` as was asked."""
        self._answer_step[0], self._answer[1] = step, reach_m
        self._answer[2:2 + self._modes], self._answer[2 + self._modes:] = amplitude, rate
        data = self._answer.tobytes()
        try:
            while data:
                data = data[os.write(self._out, data):]
        except BrokenPipeError as error:
            raise ExchangeError("the engine does not read any more") from error

    def _read(self, size: int) -> bytes:
        parts, missing = [], size
        deadline = time.monotonic() + self._timeout_s
        while missing:
            ready, _, _ = select.select([self._in], [], [], POLL_s)
            part = os.read(self._in, missing) if ready else b""
            if ready and not part:
                self._check(deadline)  # nobody has the pipe open: not yet, or no more
                time.sleep(0.01)
            elif not ready:
                self._check(deadline)
            parts.append(part)
            missing -= len(part)
        return b"".join(parts)

    def _check(self, deadline: float) -> None:
        if not self._alive():
            raise ExchangeError("the engine ended before the plate did")
        if time.monotonic() > deadline:
            raise ExchangeError(f"the engine said nothing for {self._timeout_s:g} s")
