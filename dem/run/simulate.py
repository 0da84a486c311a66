"""Engine and plate side by side, from the start of the engine to its last step, and how a run can end earlier."""

from __future__ import annotations

import subprocess
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from common.input_error import CommandError
from dem.coupling.checkpoint import latest
from dem.coupling.launch import engine_error, engine_running
from dem.coupling.messages import STOPPED, CouplingError
from dem.coupling.pipes import EngineWatchdog
from dem.record.energy_balance import read_ledger
from dem.run.directory import SUFFIX
from dem.run.participants import PlateOfRun
from dem.run.prepare import PreparedRun
from dem.run.progress import Progress

POLL_s = 0.05


@dataclass(frozen=True)
class EngineStart:
    """Where and how the engine starts: in `deck`, from the checkpoint at DEM step `resume_step`, 0 if from the
    beginning. It inherits the file descriptor `lock`. It stops at the first checkpoint from the time `stop_at` of
    `time.monotonic` on, if that is given. Checkpoints carry the `identity` of the run."""

    deck: Path
    resume_step: int
    lock: int
    stop_at: float | None
    identity: str


def simulate(prepared: PreparedRun, start: EngineStart, plate: PlateOfRun, progress: Progress) -> None:
    """Run engine and plate until the engine has finished. Raises RunError, CouplingError, Unstable or Stopped."""
    try:
        walltime = "never" if start.stop_at is None else max(0.0, start.stop_at - time.monotonic())
        with plate.connected(start.deck), engine_running(
                start.deck, prepared.scene.ranks, (start.lock,), resume=start.resume_step, walltime=walltime,
                identity=start.identity) as engine:
            watchdog = EngineWatchdog(engine)
            try:
                plate.take_part(start.deck, watchdog, lambda dem_step: progress(dem_step * prepared.step.dt_s),
                                start.identity)
            except CouplingError as error:
                with suppress(subprocess.TimeoutExpired):  # pipes of an engine close a moment before it is gone
                    engine.wait(timeout=5)
                if engine.returncode:
                    _check_not_stopped(prepared, start.deck, engine.returncode)
                    raise RunError(f"LIGGGHTS stopped: {engine_error(start.deck)}") from error
                raise
            while watchdog():
                time.sleep(POLL_s)
    finally:
        progress.end()
    _check_not_stopped(prepared, start.deck, engine.returncode)
    _check_finished(prepared, start.deck, engine.returncode)


def _check_not_stopped(prepared: PreparedRun, deck: Path, code: int) -> None:
    if code != STOPPED:
        return
    step = latest(deck / "checkpoint", prepared.flexible)
    raise Stopped(f"{prepared.scene.name}: stopped at the checkpoint at t = {step * prepared.step.dt_s:.6g} s of "
                  f"{prepared.scene.time.duration_s:g} s; "
                  f"`gangue resume {deck.parent.with_name(deck.parent.name.removesuffix(SUFFIX))}` goes on")


def _check_finished(prepared: PreparedRun, deck: Path, code: int) -> None:
    """LIGGGHTS ends with 0 also when particles were lost or the energy blew up, so the ledger is asked."""
    if code != 0:
        raise RunError(f"LIGGGHTS stopped: {engine_error(deck)}")
    ledger = read_ledger(deck / "ledger.bin", len(prepared.assembly.sizes))
    if len(ledger.step) == 0 or ledger.step[-1] != prepared.step.steps:
        raise RunError(f"LIGGGHTS ended before the last step: {engine_error(deck)}")
    if not all(np.all(np.isfinite(values)) for values in ledger.column.values()):
        raise RunError("the energies of LIGGGHTS hold a value that is no number: the run is not stable")


class RunError(CommandError, RuntimeError):
    """A run that started and could not be finished; one line that says why."""


class Stopped(CommandError, RuntimeError):
    """A run that was asked to stop before its end and did; one line that says how to go on."""

    exit_code = STOPPED
