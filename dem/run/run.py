"""One run from scene to run directory."""

from __future__ import annotations

import hashlib
import importlib.metadata
import platform
import shutil
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from common.plate import FlexiblePlate
from common.scene import Scene, read_scene, scene_hash
from common.tables import InputError, refused_in
from dem.coupling.checkpoint import (
    State,
    check_engine_file,
    engine_file,
    keep_plate,
    latest,
    plate_file,
    read_plate,
)
from dem.coupling.launch import ENGINE, LIGGGHTS_VERSION, STOPPED, check_engine, engine_error, start_engine
from dem.coupling.monitor import PlateMonitor, Unstable, check_closure
from dem.coupling.pipes import ExchangeError, PlatePipes
from dem.coupling.scheme import Place, follow
from dem.coupling.watchdog import EngineWatch
from dem.deck.plate_yield import read_contacts, yield_report
from dem.deck.render import streams, view_steps, write_deck
from dem.deck.time_step import (
    TimeStep,
    accuracy_settings,
    plate_mobility_1_kg,
    stone_contact_time_s,
    time_step,
)
from dem.deck.tolerance import expected_error, with_tolerance
from dem.run.directory import SUFFIX, Busy, Unfinished, read_json, write_json
from dem.run.energy_balance import PlateEnergy, energy_ledger, energy_table, read_ledger, stone_energies
from dem.run.paraview import write_view
from dem.run.progress import Progress
from dem.run.recorder import PlateRecorder, fast_stream, read_events, read_forces, write_streams
from dem.stones.arrangement import Arrangement, arrange
from dem.stones.assembly import Assembly, assemble
from plate_fem.modes import PlateModes, plate_modes
from plate_fem.motion import ModalMotion
from plate_fem.truncation import energy_left_out

POLL_s = 0.05


class RunError(RuntimeError):
    """A run that started and could not be finished; one line that says why."""


class Stopped(RuntimeError):
    """A run that was asked to stop before its end and did; one line that says how to go on."""


@dataclass
class Model:
    """A scene made ready to run."""

    given: Scene  # as the file gives it
    scene: Scene  # with what the file left to be found filled in
    scene_hash: str  # of the scene as the file gives it
    arrangement: Arrangement
    assembly: Assembly
    step: TimeStep
    modes: PlateModes | None


@dataclass
class Stages:
    """Wall time by stage, s."""

    wall_time_s: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def __call__(self, name: str):
        start = time.perf_counter()
        yield
        self.wall_time_s[name] = self.wall_time_s.get(name, 0.0) + time.perf_counter() - start


def prepare(scene: Scene, source: str, cache: Path | None, stages: Stages) -> Model:
    """Check, pack, choose the step and find the modes. `source` is the scene's file, for messages.
    Raises InputError before anything is written."""
    arrangement = arrange(scene, source)
    with stages("packing"):
        assembly = assemble(scene, arrangement)
    time_step(scene, assembly, source)  # what can be refused without the plate is refused before its modes are sought
    modes, mobility, resolved = None, None, scene
    if scene.plate.model == "flexible":
        with stages("modes"):
            plate = with_tolerance(scene.plate, scene.tolerance, stone_contact_time_s(scene, assembly),
                                   assembly.n_bonds > 0)
            resolved = scene.model_copy(update={"plate": plate})
            # The stones' places get the static compliance of the modes left out.
            with refused_in(source, "plate"):
                modes = plate_modes(plate, cache, arrangement.position_m)
        mobility = plate_mobility_1_kg(modes, arrangement.position_m)
    step = time_step(scene, assembly, source, mobility)
    return Model(scene, resolved, scene_hash(scene), arrangement, assembly, step, modes)


def run(scene_file: str | Path, out: Path, gangue_ratio: float | None = None, show_progress: bool = True,
        walltime_s: float | None = None) -> dict:
    """Run a scene file, see `run_scene`."""
    return run_scene(read_scene(scene_file, gangue_ratio), str(scene_file), out, show_progress, walltime_s)


def resume(directory: Path, show_progress: bool = True, walltime_s: float | None = None) -> dict:
    """Go on with the run that was to become `directory` (its name, or that with .partial), see `run_scene`. A run that is
    finished is left alone. Raises InputError if there is nothing to go on with."""
    out = directory.with_name(directory.name.removesuffix(SUFFIX))
    begun = Unfinished(out).begun()
    if begun is None:
        finished = read_json(out / "run.json")
        if finished is None:
            raise InputError(f"{directory}: no run was begun here; allowed is the --out of one that was")
        return finished
    try:
        scene = Scene.model_validate(begun["scene"], strict=False)
        source = str(begun["source"])
    except (KeyError, ValidationError) as error:
        raise InputError(f"{Unfinished(out).path / 'begun.json'}: not what this version writes "
                         f"({str(error).splitlines()[0]})") from None
    return run_scene(scene, source, out, show_progress, walltime_s)


def run_scene(scene: Scene, source: str, out: Path, show_progress: bool = False, walltime_s: float | None = None) -> dict:
    """Run a scene and leave `out` whole: it is written beside and renamed at the end. Returns what run.json says.

    A run that was stopped or killed goes on from its last checkpoint. After `walltime_s` it is asked to take one and
    stop. Raises InputError for bad input, Stopped after that time, RunError if the run could not be finished.
    """
    stages = Stages()
    check_engine()
    stop_at = None if walltime_s is None else time.monotonic() + walltime_s
    model = prepare(scene, source, out.parent / ".modes", stages)
    return run_model(model, source, out, stages, show_progress, stop_at)


def run_model(model: Model, source: str, out: Path, stages: Stages, show_progress: bool = False,
              stop_at: float | None = None) -> dict:
    """Run what `prepare` made ready, or another model with, say, another plate's modes. `stop_at` is a time of
    `time.monotonic`, see `run_scene`."""
    unfinished = Unfinished(out)
    try:
        with unfinished.claimed() as lock:
            identity, step = _take_up(unfinished, model, source, stages)
            summary = unfinished.finished(identity)
            if summary is None:
                summary = _run_in(unfinished, identity["deck"], step, lock, model, stages, show_progress, stop_at)
                write_json(unfinished.path / "run.json", summary)
            deck = unfinished.path / "deck"
            for name in (*streams(model.scene, model.assembly), "engine.out", "engine.log", "log.liggghts"):
                (deck / name).unlink(missing_ok=True)
            shutil.rmtree(deck / "checkpoint", ignore_errors=True)
            unfinished.publish()
            return summary
    except (RunError, ExchangeError, Unstable, Busy) as error:
        raise RunError(f"{source}: {error} (what there is of the run is in {unfinished.path})") from error


def _take_up(unfinished: Unfinished, model: Model, source: str, stages: Stages) -> tuple[dict, int]:
    """The deck in its place, what the run is known by, and the step of the checkpoint to go on from, 0 if from the start.

    Only a run with the same deck, plate, program and engine goes on; any other starts anew in an empty directory.
    """
    deck, fresh = unfinished.path / "deck", unfinished.path / "deck.fresh"
    shutil.rmtree(fresh, ignore_errors=True)
    with stages("deck"):
        deck_hash = write_deck(fresh, model.scene, model.assembly, model.step, model.modes)
    plate = [] if model.modes is None else [model.modes.frequency_Hz, model.modes.damping_ratio, model.modes.rod_force]
    identity = {"scene": model.scene_hash, "deck": deck_hash, "version": own_version(),
                "plate": hashlib.sha256(b"".join(values.tobytes() for values in plate)).hexdigest(),
                "engine": hashlib.sha256(ENGINE.read_bytes()).hexdigest()}
    begun = unfinished.begun()
    if begun is None or begun.get("identity") != identity:
        unfinished.clear(keep=(fresh.name,))
        fresh.rename(deck)
        unfinished.begin(identity, model.given.model_dump(mode="json"), source)
        return identity, 0
    shutil.rmtree(fresh)
    if unfinished.finished(identity):
        return identity, 0
    unfinished.clear(keep=("begun.json", "deck"))
    step = latest(deck / "checkpoint", model.modes is not None)
    if step:
        check_engine_file(engine_file(deck / "checkpoint", step))
    else:
        for name in streams(model.scene, model.assembly):
            (deck / name).unlink(missing_ok=True)
    return identity, step


def _run_in(unfinished: Unfinished, deck_hash: str, resume_step: int, lock: int, model: Model, stages: Stages,
            show_progress: bool, stop_at: float | None) -> dict:
    deck = unfinished.path / "deck"
    resumed_at_s = unfinished.note_resumed(resume_step * model.step.dt_s) if resume_step else []
    motion, plate, place = None, None, Place()
    if model.modes is not None:
        motion = ModalMotion(model.modes, model.step.co_step * model.step.dt_s)
        plate = PlateRecorder(model.scene, model.modes, motion, model.step, view_steps(model.scene, model.step),
                              PlateMonitor(model.scene, model.assembly))
    progress = Progress(f"{model.scene.name} {model.scene.stones.gangue_ratio:4.0%}", model.scene.time.duration_s,
                        show_progress)
    if resume_step and motion is not None and plate is not None:
        set_plate_state(read_plate(plate_file(deck / "checkpoint", resume_step)), motion, plate, place)
    with stages("engine and plate"):
        simulate(deck, model, motion, plate, place, progress, resume_step, lock, stop_at)
    with stages("output"):
        summary = _write_results(unfinished.path, model, motion, plate, stages, deck_hash)
    return summary | {"resumed_at_s": resumed_at_s}


def plate_state(motion: ModalMotion, plate: PlateRecorder, place: Place) -> State:
    """The plate's half of a checkpoint."""
    assert place.last_force is not None
    return {"place": np.array([place.dem_step, place.co_steps, place.ahead]), "last_force": place.last_force,
            **{f"motion_{name}": value for name, value in motion.get_state().items()},
            **{f"plate_{name}": value for name, value in plate.get_state().items()}}


def set_plate_state(state: State, motion: ModalMotion, plate: PlateRecorder, place: Place) -> None:
    place.dem_step, place.co_steps, place.ahead = (int(number) for number in state["place"])
    place.last_force = state["last_force"]
    motion.set_state({name.removeprefix("motion_"): value for name, value in state.items() if name.startswith("motion_")})
    plate.set_state({name.removeprefix("plate_"): value for name, value in state.items() if name.startswith("plate_")})


def simulate(deck: Path, model: Model, motion: ModalMotion | None, plate: PlateRecorder | None, place: Place,
             progress: Progress, resume_step: int, lock: int, stop_at: float | None) -> None:
    """Engine and plate side by side until the engine has finished. Raises RunError, ExchangeError or Stopped."""
    engine: subprocess.Popen | None = None
    watch: EngineWatch | None = None
    timer = None
    pipes = None
    try:
        if motion is not None:  # makes the pipes, which the engine must find
            pipes = PlatePipes(deck, len(motion.amplitude), lambda: watch is not None and watch())
        engine = start_engine(deck, model.scene.engine.np, resume_step, (lock,))
        watch = EngineWatch(engine)
        if stop_at is not None:
            timer = threading.Timer(max(0.0, stop_at - time.monotonic()), engine.send_signal, [signal.SIGUSR1])
            timer.daemon = True
            timer.start()
        if motion is not None and plate is not None and pipes is not None:
            def record(dem_steps, *rows):
                plate(dem_steps, *rows)
                progress(dem_steps[-1] * model.step.dt_s)
            try:
                pipes.open()
                follow(motion, pipes, model.step, record, place,
                       keep_plate(deck / "checkpoint", lambda: plate_state(motion, plate, place)))
            except ExchangeError as error:
                if _exit_code(engine) not in (None, 0):
                    _check_not_stopped(deck, engine.returncode, model)
                    raise RunError(f"LIGGGHTS stopped: {engine_error(deck)}") from error
                raise
        while watch():
            time.sleep(POLL_s)
    finally:
        if timer is not None:
            timer.cancel()
        if pipes is not None:
            pipes.close()
        if engine is not None and engine.poll() is None:
            engine.kill()
            engine.wait()
        progress.end()
    _check_not_stopped(deck, engine.returncode, model)
    _check_finished(deck, engine.returncode, model)


def _check_not_stopped(deck: Path, code: int, model: Model) -> None:
    if code not in (STOPPED, -signal.SIGUSR1):  # the second before it listened
        return
    step = latest(deck / "checkpoint", model.modes is not None)
    where = f"at the checkpoint at t = {step * model.step.dt_s:.6g} s" if step else "before the first checkpoint"
    raise Stopped(f"{model.scene.name}: stopped {where} of {model.scene.time.duration_s:g} s; "
                  f"`python -m dem resume {deck.parent.with_name(deck.parent.name.removesuffix(SUFFIX))}` goes on")


def _exit_code(engine: subprocess.Popen) -> int | None:
    """Of an engine that has fallen silent: its pipes close a moment before it is gone."""
    try:
        return engine.wait(timeout=5)
    except subprocess.TimeoutExpired:
        return None


def _check_finished(deck: Path, code: int, model: Model) -> None:
    """LIGGGHTS ends with 0 also when particles were lost or the energy blew up, so the ledger is asked."""
    if code != 0:
        raise RunError(f"LIGGGHTS stopped: {engine_error(deck)}")
    ledger = read_ledger(deck / "ledger.bin", len(model.assembly.sizes))
    if len(ledger.step) == 0 or ledger.step[-1] != model.step.steps:
        raise RunError(f"LIGGGHTS ended before the last step: {engine_error(deck)}")
    if not all(np.all(np.isfinite(values)) for values in ledger.column.values()):
        raise RunError("the energies of LIGGGHTS hold a value that is no number: the run is not stable")


def _write_results(work: Path, model: Model, motion, plate, stages: Stages, deck_hash: str) -> dict:
    deck, scene, step, assembly = work / "deck", model.scene, model.step, model.assembly
    n = len(assembly.sizes)
    events = read_events(deck / "events.csv", step)
    forces = read_forces(deck / "forces.bin", n)
    fast = fast_stream(scene, step, forces, plate)
    signals = write_streams(work, fast, step)
    events.to_parquet(work / "breakage.parquet", index=False)
    contacts = read_contacts(deck / "contacts.bin", step.dt_s)
    contacts.to_parquet(work / "contacts.parquet", index=False)
    ledger = read_ledger(deck / "ledger.bin", n)
    if scene.output.view_interval_s is not None:
        write_view(work, deck / "view.dump", scene, assembly, step, events, contacts, model.modes,
                   plate.view_amplitude if plate else [])

    plate_energy = PlateEnergy() if motion is None else PlateEnergy(
        motion.kinetic_J, motion.internal_J, motion.damped_J, motion.work_J)
    mass = np.bincount(assembly.agglomerate, assembly.mass_kg)
    height = np.bincount(assembly.agglomerate, assembly.mass_kg * assembly.center_m[:, 2])
    parts = stone_energies(ledger, scene.time.gravity_m_s2, height)
    energy_table(parts, ledger.step * step.dt_s).to_parquet(work / "energy.parquet", index=False)
    energy = energy_ledger(parts, plate_energy, 0.5 * mass * scene.stones.speed_m_s**2)
    check_closure(energy)
    broken = events.groupby("agglomerate").size().reindex(range(1, n + 1), fill_value=0)
    return {
        "status": "finished",
        "scene": scene.model_dump(mode="json"),
        "scene_hash": model.scene_hash,
        "assumptions": list(scene.assumptions),
        "gangue_ratio": scene.stones.gangue_ratio,
        "materials": model.arrangement.material,
        "versions": versions(),
        "seeds": [scene.stones.seed + k for k in range(n)] if assembly.n_bonds else [],
        "deck_hash": deck_hash,
        "dt_s": step.dt_s,
        "dt_limits_s": step.limits_s,
        "bond_time_s": step.bond_time_s,
        "expected_error": expected_error(accuracy_settings(scene, assembly, step)),
        "co_step": step.co_step,
        "steps": step.steps,
        "n_particles": assembly.n_particles,
        "n_bonds": assembly.n_bonds,
        "n_bonds_broken": len(events),
        "n_bonds_broken_by_agglomerate": broken.tolist(),
        "n_modes": 0 if motion is None else len(motion.amplitude),
        "plate_energy_left_out": plate_energy_left_out(scene, assembly),
        "peak_force_N": float(forces[1].sum(axis=1).max(initial=0.0)),
        "impulse_N_s": float(forces[1].sum() * step.co_step * step.dt_s),
        "momentum_change_kg_m_s": float(ledger.column["momentum_z_kg_m_s"][-1].sum()
                                        + mass.sum() * scene.stones.speed_m_s),
        "plate": plate_maxima(fast),
        "yield": yield_report(scene, assembly, model.arrangement.material, forces[1].max(axis=0, initial=0.0),
                              ledger.column["wall_deepest"][-1], plate.bending if plate else None),
        "energy": energy,
        "rebound_speed_m_s": (ledger.column["momentum_z_kg_m_s"][-1] / mass).tolist(),
        "n_samples": len(signals),
        "wall_time_s": stages.wall_time_s,
    }


def plate_energy_left_out(scene: Scene, assembly: Assembly) -> float | None:
    """Share of the plate's energy that would belong to modes above those kept, for the shortest contact of a stone."""
    if not isinstance(scene.plate, FlexiblePlate) or scene.plate.max_frequency_Hz is None:
        return None
    return energy_left_out(scene.plate.max_frequency_Hz, stone_contact_time_s(scene, assembly))


def plate_maxima(fast) -> dict[str, float]:
    """Largest absolute value of each signal of the plate, in its unit."""
    names = [c for c in fast.columns if c != "t_s" and not c.startswith("force_")]
    return {f"max_{name}": float(fast[name].abs().max()) for name in names}


def versions() -> dict[str, str]:
    """Versions of what the numbers depend on."""
    packages = ["numpy", "scipy", "scikit-fem", "pandas", "meshio"]
    return {"liggghts": LIGGGHTS_VERSION, "python": platform.python_version(), "machine": platform.machine(),
            **{name: importlib.metadata.version(name) for name in packages},
            "coal-gangue-impact": own_version()}


def own_version() -> str:
    try:
        return importlib.metadata.version("coal-gangue-impact")
    except importlib.metadata.PackageNotFoundError:
        print("note: the package is not installed, its version is not in run.json", file=sys.stderr)
        return "not installed"
