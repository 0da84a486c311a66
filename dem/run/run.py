"""One run from scene to run directory: engine and plate side by side, from the start of the engine to its last step,
and how a run can end earlier.
"""

import hashlib
import shutil
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from common.files.cache import user_cache
from common.files.output_directory import Busy, hash_of, refuse_place
from common.files.whole import write_json
from common.input_error import CommandError
from common.run_summary import RunSummary, read_summary
from common.scene.scene import Scene, scene_hash
from common.tables import InputError
from dem.coupling.launch import ENGINE, check_engine, engine_error, engine_running
from dem.coupling.pipes import STOPPED, CouplingError, EngineWatchdog
from dem.deck.render import streams, write_deck
from dem.run.directory import STARTED, SUFFIX, Identity, RunDirectory, last_whole, latest, name_of
from dem.run.energy_balance import Unstable, read_ledger
from dem.run.participants import PlateOfRun, participant_of
from dem.run.prepare import PreparedRun, prepare
from dem.run.progress import Progress
from dem.run.results import own_version, summary_of, write_results
from dem.stones.arrangement import gangue_ratio as ratio_of

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


LEAST_FREE_BYTES = 1 << 16


def resume(directory: str | Path, show_progress: bool = True, walltime_s: float | None = None) -> dict[str, Any]:
    """Go on with the run that was to become `directory` (its name, or that with .partial), see `run_scene`. A run that
    is finished is left alone. Raises InputError if there is nothing to go on with.

    >>> from common.scene.scene import read_scene
    >>> first = run_scene(read_scene("scenes/hertz_coal.toml"), "scenes/hertz_coal.toml", Path("runs/once"))
    >>> resume(Path("runs/once")) == first
    True
    """
    directory = Path(directory)
    refuse_place(directory)
    out = directory.with_name(directory.name.removesuffix(SUFFIX))
    work = RunDirectory(out)
    started = work.started()
    if started is None:
        finished = read_summary(out / "run.json")
        if finished is None:
            raise InputError(f"{directory}: no run was started here; allowed is the --out of one that was")
        return finished.as_json()
    try:
        scene = Scene.model_validate(started["scene"], strict=False)
        source = str(started["source"])
    except (KeyError, ValidationError) as error:
        raise InputError(f"{work.started_file}: not what this version writes ({str(error).splitlines()[0]})") from None
    return run_scene(scene, source, out, show_progress, walltime_s)


def run_scene(scene: Scene, source: str | Path, out: str | Path, show_progress: bool = False,
              walltime_s: float | None = None, overwrite: bool = False) -> dict[str, Any]:
    """Run a scene and leave `out` whole: it is written beside and renamed at the end. Returns what run.json says.

    A run that was stopped or killed goes on from its last checkpoint. After `walltime_s` it is asked to take one and
    stop. What is at `out` must be of this scene, or with `overwrite` of any. Raises InputError for bad input, Stopped
    after that time, RunError if the run could not be finished.

    >>> from common.scene.scene import read_scene
    >>> run_scene(read_scene("scenes/hertz_coal.toml"), "scenes/hertz_coal.toml", Path("runs/sphere"))["status"]
    'finished'
    """
    check_engine()
    source, out = str(source), Path(out)
    stop_at = None if walltime_s is None else time.monotonic() + walltime_s
    refuse_place(out)
    RunDirectory(out).refuse(scene_hash(scene), overwrite)
    prepared = prepare(scene, source, user_cache(), show_progress)
    return run_prepared(prepared, out, show_progress, stop_at, overwrite)


def run_prepared(prepared: PreparedRun, out: Path, show_progress: bool = False,
                 stop_at: float | None = None, overwrite: bool = False) -> dict[str, Any]:
    """Run what `prepare` made ready, or that with, say, another plate's modes. `stop_at` is a time of `time.monotonic`,
    see `run_scene`."""
    prepared = replace(prepared, stages=prepared.stages.copy())
    refuse_place(out)
    work = RunDirectory(out)
    work.refuse(prepared.scene_hash, overwrite)
    try:
        with work.claimed() as lock:
            identity, step = _take_up(work, prepared, overwrite)
            summary = work.finished(identity)
            if summary is None:
                start = EngineStart(work.path / "deck", step, lock, stop_at, name_of(identity))
                summary = _run_in(work, identity["deck"], start, prepared, show_progress)
                write_json(work.file("run.json"), summary.as_json())
                work.note_finished(without=_working_files(prepared))
            for name in _working_files(prepared):
                work.remove(name)
            work.publish()
            return summary.as_json()
    except (RunError, CouplingError, Unstable, Busy) as error:
        full = ", whose disk is full" if shutil.disk_usage(work.path).free < LEAST_FREE_BYTES else ""
        raise RunError(f"{prepared.source}: {error} (what there is of the run is in {work.path}{full})") from error


def _take_up(work: RunDirectory, prepared: PreparedRun, overwrite: bool) -> tuple[Identity, int]:
    """Put the deck in its place; return what the run is known by, and the step of the checkpoint to go on from, 0 if
    from the start.

    Only a run with the same deck, plate, program and engine goes on; any other starts anew in an empty directory, as
    with `overwrite` each does that is not finished.
    """
    deck, fresh = work.path / "deck", work.path / "deck.fresh"
    work.remove(fresh.name)
    with prepared.stages("deck"):
        deck_hash = write_deck(fresh, prepared.scene, prepared.assembly, prepared.step, prepared.modes)
    files = sorted(work.file(f"deck/{file.name}") for file in fresh.iterdir() if file.is_file())
    identity = _identity(prepared, deck_hash)
    if _identity_of(work) != identity or (overwrite and work.finished(identity) is None):
        work.clear(keep=(fresh.name,))
        fresh.rename(deck)
        work.start(identity, prepared.given.model_dump(mode="json"), prepared.source)
        return identity, 0
    deck.mkdir(exist_ok=True)
    for file in files:  # the engine reads what was written now, whatever became of the deck meanwhile
        if hash_of(file) != hash_of(fresh / file.name):
            note(f"{file}: missing or damaged; it was written anew")
        (fresh / file.name).replace(file)
    work.remove(fresh.name)
    if work.finished(identity):
        return identity, 0
    work.clear(keep=(STARTED, "deck"))
    names = streams(prepared.scene, prepared.assembly)
    step = last_whole(deck, names, prepared.flexible, name_of(identity), note)
    if not step:
        for name in names:
            work.remove(f"deck/{name}")
    return identity, step


def _identity_of(work: RunDirectory) -> Identity | None:
    """What the run is known by that was begun here, None if there is none or one cannot tell any more."""
    try:
        started = work.started()
    except InputError:
        return None
    return None if started is None else started["identity"]


def note(line: str) -> None:
    """Say what was found and put right."""
    print(f"note: {line}", file=sys.stderr)


def _identity(prepared: PreparedRun, deck_hash: str) -> Identity:
    modes = prepared.modes
    plate = [] if modes is None else [modes.frequency_Hz, modes.damping_ratio, modes.rod_force]
    return {"scene": prepared.scene_hash, "deck": deck_hash, "version": own_version(),
            "plate": hashlib.sha256(b"".join(values.tobytes() for values in plate)).hexdigest(),
            "engine": hashlib.sha256(ENGINE.read_bytes()).hexdigest()}


def _run_in(work: RunDirectory, deck_hash: str, start: EngineStart, prepared: PreparedRun,
            show_progress: bool) -> RunSummary:
    """Simulate in the run directory, from the checkpoint if there is one, and write the results."""
    scene, stages, plate = prepared.scene, prepared.stages, participant_of(prepared)
    resumed_at_s: list[float] = []
    if start.resume_step:
        resumed_at_s = work.note_resumed(start.resume_step * prepared.step.dt_s)
        plate.restore(start.deck, start.resume_step, start.identity)
    stones = list(prepared.assembly.stones)
    ratio = ratio_of(scene, stones, prepared.assembly.stone_mass_kg)
    progress = Progress(f"{scene.name} {ratio:4.0%}", scene.time.duration_s, show_progress,
                        [stone.arrival_s for stone in stones])
    with stages("engine and plate"):
        simulate(prepared, start, plate, progress)
    with stages("output"):
        results = write_results(work.file, start.deck, prepared, plate)
    return RunSummary(**summary_of(prepared, plate, results), deck_hash=deck_hash, wall_time_s=stages.wall_time_s,
                      resumed_at_s=resumed_at_s)


def _working_files(prepared: PreparedRun) -> list[str]:
    """What the engine wrote for this program alone."""
    return [f"deck/{name}" for name in (*streams(prepared.scene, prepared.assembly), "engine.out", "engine.log",
                                        "log.liggghts", "checkpoint")]
