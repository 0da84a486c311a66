"""The plate's end of the two pipes between plate and engine (docs/coupling.md), and whether the engine is stuck.

That is told from its processor time, which a working process uses even on a crowded machine. A time-out cannot tell,
since set-up and free flight may take minutes without a message. Ticks of the kernel, of ten milliseconds, are too
coarse for it: on a machine with many processes, ranks that leave the processor to whom they wait for get some
microseconds at a time. The kernel is asked by /proc for this process family alone. psutil looks through every process
of the machine to find children, which on a busy node costs more than a tenth of a core at the pace of these looks.
"""

import math
import os
import select
import struct
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

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


TIMEOUT_s = 600.0  # of silence from a living engine; set-up of a large scene takes minutes
POLL_s = 0.2
CLOSED = -1  # in the place of a file descriptor
FINISHED, CHECKPOINT = -1, -2  # in the place of the step: the kind of the message
HEADER = struct.Struct("<qqq")  # step, co-steps, extrapolated co-steps; of a checkpoint its kind, its step, nothing
STUCK_s = 10.0  # without any processor time
TICK_ns = 10**9 // os.sysconf("SC_CLK_TCK")
HAS_SCHEDSTAT = Path("/proc/self/schedstat").exists()  # else ticks have to do
LONGEST_POLL_s = 0.5  # what one look counts at most: time in which this process was itself stopped does not count


class PlatePipes:
    """Two named pipes in `directory` for a plate of `modes` modes, made at once, since the engine must find them."""

    def __init__(self, directory: Path, modes: int, timeout_s: float = TIMEOUT_s):
        self._names = [directory / "to_plate", directory / "from_plate"]
        self._modes = modes
        self._answer = np.zeros(2 + 2 * modes, dtype="<f8")  # step, which is an integer, reach, amplitude, rate
        self._answer_step = self._answer[:1].view("<i8")
        self._alive: Callable[[], bool] = lambda: True
        self._timeout_s = timeout_s
        self._in: int = CLOSED
        self._out: int = CLOSED
        for name in self._names:
            name.unlink(missing_ok=True)
            os.mkfifo(name)

    def open(self, alive: Callable[[], bool]) -> None:
        """Open both pipes, in the order in which the engine does. `alive` tells, from now on, whether the engine still
        runs. Raises CouplingError if the engine is gone."""
        self._alive = alive
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

    def receive(self) -> Message:
        """Wait for the next message. Raises CouplingError if none comes, or one that is not of the protocol."""
        data = self._read(HEADER.size + 8 * self._modes)
        step, co_steps, extrapolated = HEADER.unpack_from(data)
        if step == FINISHED:
            return FinishedMessage()
        if step == CHECKPOINT:
            return CheckpointMessage(co_steps)
        force = np.frombuffer(data, dtype="<f8", offset=HEADER.size)
        if not math.isfinite(force @ force):
            raise CouplingError(f"the engine sent a force that is no number at step {step}")
        if step < 0 or co_steps < 0 or extrapolated < 1:
            raise CouplingError(f"the engine sent step {step}, {co_steps} co-steps and {extrapolated} to extrapolate; "
                                "allowed are numbers from 0, 0 and 1 on")
        return ForceMessage(step, co_steps, extrapolated, force)

    def confirm(self, message: CheckpointMessage | FinishedMessage) -> None:
        """Tell the engine that the plate's half of the checkpoint is on disk, or that the plate knows of the end."""
        still = np.zeros(self._modes)
        self.answer(CHECKPOINT if isinstance(message, CheckpointMessage) else FINISHED, 0.0, still, still)

    def answer(self, step: int, reach_m: float, amplitude: np.ndarray, rate: np.ndarray) -> None:
        """Tell the engine where the plate is predicted to be, as far after `step` as it asked: `amplitude` and `rate`
        (modes,), and the bound `reach_m` of the deflection. Raises CouplingError if these are no numbers, or the engine
        is gone."""
        self._answer_step[0], self._answer[1] = step, reach_m
        self._answer[2:2 + self._modes], self._answer[2 + self._modes:] = amplitude, rate
        if not np.isfinite(self._answer[1:]).all() or reach_m < 0:
            raise CouplingError(f"the plate's motion at step {step} is no number")
        data = self._answer.tobytes()
        try:
            while data:
                data = data[os.write(self._out, data):]
        except BrokenPipeError as error:
            raise CouplingError("the engine does not read any more") from error

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
            raise CouplingError("the engine ended before the plate did")
        if time.monotonic() > deadline:
            raise CouplingError(f"the engine said nothing for {self._timeout_s:g} s")


class EngineWatchdog:
    """Call it often while the engine is waited for: it tells whether the engine is alive. Raises CouplingError if it is
    stuck.

    A process that waits for a disk is not taken for stuck. The engine may be one of several processes below the one
    that was started (mpirun).
    """

    def __init__(self, engine: subprocess.Popen[bytes]):
        self._engine = engine
        self._used_ns, self._still_s, self._last = -1, 0.0, time.monotonic()

    def __call__(self) -> bool:
        if self._engine.poll() is not None:
            return False
        used_ns, states = _usage(self._engine.pid)
        now = time.monotonic()
        if used_ns != self._used_ns or "D" in states:
            self._still_s = 0.0
        else:
            self._still_s += min(now - self._last, LONGEST_POLL_s)
        self._used_ns, self._last = used_ns, now
        if self._still_s > STUCK_s:
            what = "is stopped by a signal" if states & {"T", "t"} else "is stuck"
            raise CouplingError(f"the engine (process {self._engine.pid}) {what}: no processor time in {STUCK_s:g} s")
        return True


def _usage(pid: int) -> tuple[int, set[str]]:
    """Processor time in ns and the states (man 5 proc) of a process and all below it."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
        tasks = list(Path(f"/proc/{pid}/task").iterdir())
        children = [int(child) for task in tasks for child in (task / "children").read_text().split()]
        used_ns = sum(int((task / "schedstat").read_text().split()[0]) for task in tasks if HAS_SCHEDSTAT)
    except OSError:
        return 0, set()  # gone meanwhile
    used_ns, states = used_ns + (int(fields[11]) + int(fields[12])) * TICK_ns, {fields[0]}
    for child in children:
        more_ns, other = _usage(child)
        used_ns, states = used_ns + more_ns, states | other
    return used_ns, states
