"""The results of a finished simulation: the tables of the run directory, and what run.json says."""

import importlib.metadata
import logging
import math
import platform
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import cumulative_simpson

from common.channels import DAMPING_IMPULSE, RODS_MOMENTUM, rod_column
from common.files.parquet import Columns, write_parquet
from common.run_summary import RecordedScene, YieldReport
from common.scene.error_laws import expected_error
from common.scene.scene import Scene
from dem.coupling.launch import library_version
from dem.deck.contact import read_contacts, yield_report
from dem.deck.plausible import breakage_scales, deflection_warnings, momentum_warnings, unfinished_warnings
from dem.deck.render import wall_file
from dem.deck.time_step import TimeStep, accuracy_settings
from dem.record.energy_balance import (
    StoneLedger,
    check_closure,
    energy_ledger,
    energy_table,
    read_ledger,
    stone_energies,
)
from dem.record.recorder import Pushes, fast_stream, read_events, read_forces, read_text_columns, samples_of
from dem.run.paraview import write_view
from dem.run.participants import PlateOfRun
from dem.run.prepare import PreparedRun, warned
from dem.stones.arrangement import gangue_ratio
from dem.stones.assembly import Assembly
from plate_fem.motion import FILE, RecordedMotion

_log = logging.getLogger(__name__)
# Of the bodies that were taken out when they had left the plate for good, in order of time.
LEFT = {"agglomerate": int, "subspheres": int, **dict.fromkeys((
    "mass_kg", "x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s", "kinetic_J", "elastic_J"), float)}


@dataclass(frozen=True)
class Results:
    """The tables of a run. `pushes` on the plate are those of the engine; `stone_mass_kg` (stones,);
    `energy` is that of dem.record.energy_balance.energy_ledger; `walls` that of `read_walls`; `motion` the plate's."""

    events: Columns
    fast: Columns
    signals: Columns
    pushes: Pushes
    ledger: StoneLedger
    stone_mass_kg: np.ndarray
    energy: dict[str, Any]
    walls: Columns | None
    motion: RecordedMotion | None


def write_results(file: Callable[[str], Path], deck: Path, prepared: PreparedRun, plate: PlateOfRun) -> Results:
    """Write the tables and pictures of a run, from what the engine left in `deck`, to the path that `file` gives for
    each name. Raises Unstable if the energy does not close."""
    scene, step, assembly = prepared.scene, prepared.step, prepared.assembly
    n = len(assembly.sizes)
    events = read_events(deck / "events.csv", step)
    pushes = read_forces(deck / "forces.bin")
    fast = fast_stream(step, pushes, plate.signals(range(0, step.steps + 1, step.fast_steps)),
                       0 if assembly.is_stream else n)
    write_parquet(fast, file("fast.parquet"))
    signals = samples_of(fast, step.sample_steps // step.fast_steps, scene.time.anti_alias)
    write_parquet(signals, file("signals.parquet"))
    motion = plate.recorded_motion()
    if motion is not None:
        motion.write(file(FILE))
    write_parquet(events, file("breakage.parquet"))
    contacts = read_contacts(deck / "contacts.bin", step.dt_s)
    write_parquet(contacts, file("contacts.parquet"))
    if scene.time.view_interval_s is not None:
        write_view(file, deck, prepared, events, plate.meshes)
    walls = read_walls(scene, deck, step)
    if walls is not None:
        write_parquet(walls, file("walls.parquet"))
    ledger = read_ledger(deck / "ledger.bin", n)
    left = read_text_columns(deck / "left.csv", step, LEFT)
    if assembly.is_stream:
        write_parquet(left, file("left.parquet"))
    write_parquet(stones_table(assembly, step, pushes, events, left, ledger), file("stones.parquet"))
    parts = stone_energies(ledger, scene.time.gravity_m_s2, assembly.mass_height_kg_m)
    write_parquet(energy_table(parts, ledger, step.dt_s), file("energy.parquet"))
    energy = energy_ledger(parts, plate.energy(), ledger.has_entered[-1] * assembly.kinetic_start_J)
    check_closure(energy)
    return Results(events, fast, signals, pushes, ledger, assembly.stone_mass_kg, energy, walls, motion)


def summary_of(prepared: PreparedRun, plate: PlateOfRun, results: Results) -> dict[str, Any]:
    """The fields of common.run_summary.RunSummary that follow from a run and its results."""
    outcome = _outcome(prepared, plate, results)
    pushes, mass_kg = results.pushes, results.stone_mass_kg
    ends = pushes.step == prepared.step.steps
    end_N = np.bincount(pushes.stone[ends], pushes.mean_N[ends], len(mass_kg))
    peak_N = pushes.of_stones(len(mass_kg))
    late = warned(prepared.source, [*unfinished_warnings(prepared.scene, end_N, peak_N, mass_kg),
                                     *momentum_warnings(outcome.get("momentum_missing")),
                                     *deflection_warnings(prepared.scene.plate, results.motion)])
    return {"status": "finished", **_origin(prepared), **_numerics(prepared, plate, results), **outcome,
            "warnings": prepared.warnings + late}


def _origin(prepared: PreparedRun) -> dict[str, Any]:
    """What was run, and by what."""
    scene, assembly = prepared.scene, prepared.assembly
    share = partial(gangue_ratio, scene, list(assembly.stones), assembly.stone_mass_kg)
    return {
        "scene": RecordedScene.model_validate(scene.model_dump(mode="json")),
        "scene_hash": prepared.scene_hash,
        "assumptions": list(scene.assumptions),
        "gangue_ratio": share(),
        "gangue_ratio_by_mass": share("mass"),
        "materials": assembly.stone_materials,
        "versions": versions(),
        "stones": {name: values.tolist() for name, values in stones_given(assembly).items()
                   } if scene.scatter.drawn else None,
        "seeds": [stone.seed for stone in assembly.stones] if assembly.n_bonds else [],
    }


def _numerics(prepared: PreparedRun, plate: PlateOfRun, results: Results) -> dict[str, Any]:
    """Steps, their limits, and how much was computed."""
    scene, step, assembly = prepared.scene, prepared.step, prepared.assembly
    return {
        "dt_s": step.dt_s,
        "dt_limits_s": {name: float(limit) for name, limit in step.limits_s.items()},
        "bond_time_s": step.bond_time_s,
        "expected_error": expected_error(accuracy_settings(scene, assembly, step)),
        "co_step": step.co_step,
        "steps": step.steps,
        "n_particles": assembly.n_particles,
        "n_bonds": assembly.n_bonds,
        "n_modes": plate.n_modes,
        **breakage_scales(scene, assembly),
        "plate_energy_left_out": prepared.plate_energy_left_out,
        "n_samples": len(results.signals["t_s"]),
    }


def _outcome(prepared: PreparedRun, plate: PlateOfRun, results: Results) -> dict[str, Any]:
    """What the stones and the plate did."""
    scene, step, pushes = prepared.scene, prepared.step, results.pushes
    end = {name: values[-1] for name, values in results.ledger.column.items()}
    stones = range(1, len(results.stone_mass_kg) + 1)
    broken = np.bincount(results.events["agglomerate"], minlength=len(stones) + 1)[1:]
    momentum_start = results.ledger.has_entered[-1] * prepared.assembly.momentum_start_kg_m_s[:, 2]
    yielded = yield_report(scene.plate, prepared.assembly, pushes.of_stones(len(stones)), end["wall_deepest"],
                           plate.bending())
    return {
        "n_bonds_broken": len(results.events["t_s"]),
        "n_bonds_broken_by_agglomerate": broken.tolist(),
        "peak_force_N": float(pushes.all_largest_N.max(initial=0.0)),
        "impulse_N_s": float(pushes.all_mean_N.sum() * step.fast_steps * step.dt_s),
        "momentum_change_kg_m_s": float(end["momentum_z_kg_m_s"].sum()
                                        - momentum_start.sum()),
        **plate_momentum(prepared, results.fast),
        **({} if results.walls is None else {"wall_impulse_N_s": wall_impulse_N_s(scene, results.walls, step)}),
        "plate": plate_maxima(results.fast),
        "yield_": YieldReport.model_validate(yielded),
        "energy": results.energy,
        "rebound_speed_m_s": (end["momentum_z_kg_m_s"] / results.stone_mass_kg).tolist(),
    }


def plate_momentum(prepared: PreparedRun, fast: Columns) -> dict[str, list[float] | float]:
    """What the feet of the rods got, downwards, and upwards the momentum of plate and rods and what modal damping took
    at the end, where nothing else holds the plate.

    The impulse of the stones on the plate is the first less the others. What misses of it at any time, as a share of
    the impulse, is `momentum_missing`.
    """
    modes = prepared.modes
    if modes is None or RODS_MOMENTUM not in fast:
        return {}
    t_s, plate = fast["t_s"], modes.mass_kg * fast["v_m_s"]
    rods = -np.array([fast[rod_column(k + 1)] for k in range(len(modes.rod_force))]).reshape(-1, len(t_s)).T
    impulse = cumulative_simpson(rods, x=t_s, axis=0, initial=0)
    given = np.cumsum(fast["force_N"]) * (t_s[1] - t_s[0])
    missing = abs(given - impulse.sum(axis=1) + plate + fast[RODS_MOMENTUM] + fast[DAMPING_IMPULSE]).max()
    return {"rod_impulse_N_s": impulse[-1].tolist(), "plate_momentum_kg_m_s": float(plate[-1]),
            RODS_MOMENTUM: float(fast[RODS_MOMENTUM][-1]), DAMPING_IMPULSE: float(fast[DAMPING_IMPULSE][-1]),
            "momentum_missing": float(missing / given[-1]) if given[-1] else 0.0}


def plate_maxima(fast: Columns) -> dict[str, float]:
    """Largest absolute value of each signal of the plate, in its unit."""
    names = [c for c in fast if c != "t_s" and not c.startswith("force_")]
    return {f"max_{name}": float(abs(fast[name]).max()) for name in names}


def versions() -> dict[str, str]:
    """Versions of what the numbers depend on."""
    packages = ["numpy", "scipy", "pandas", "meshio"]
    return {"liggghts": library_version(), "python": platform.python_version(), "machine": platform.machine(),
            **{name: importlib.metadata.version(name) for name in packages},
            "coal-gangue-impact": own_version()}


def own_version() -> str:
    try:
        return importlib.metadata.version("coal-gangue-impact")
    except importlib.metadata.PackageNotFoundError:
        _log.warning("note: the package is not installed, its version is not in run.json")
        return "not installed"


def stones_table(assembly: Assembly, step: TimeStep, pushes: Pushes, events: Columns,
                 left: Columns, ledger: StoneLedger) -> Columns:
    """A row a stone, in order, with what each is (dem.stones.stone.Stone), and:

    waited_s until nothing was in its way, first_contact_s (to the end of a row of the fast stream), first_x_m,
    first_y_m, peak_force_N (mean over a co-step),
    impulse_N_s on the plate, broken_area_m2, left_mass_kg of its pieces that have left the plate for good, left_s when
    the last of them did, and where then, left_x_m, left_y_m. What did not happen is not a number.
    """
    n = len(assembly.stones)
    hit, row = np.unique(pushes.stone, return_index=True)  # the first of each
    contact_s, place = np.full(n, np.nan), np.full((n, 2), np.nan)
    contact_s[hit], place[hit] = pushes.step[row] * step.dt_s, pushes.place_m[row]
    impulse = np.bincount(pushes.stone, pushes.mean_N, n) * step.fast_steps * step.dt_s
    area = [math.fsum(events["area_m2"][events["agglomerate"] == k]) for k in range(1, n + 1)]
    return {
        "stone": np.arange(1, n + 1), **stones_given(assembly), "mass_kg": assembly.stone_mass_kg,
        "subspheres": assembly.sizes,
        "waited_s": np.where(ledger.has_entered[-1], ledger.column["waited_steps"][-1] * step.dt_s, np.nan),
        "first_contact_s": contact_s, "first_x_m": place[:, 0], "first_y_m": place[:, 1],
        "peak_force_N": pushes.of_stones(n), "impulse_N_s": impulse, "broken_area_m2": np.array(area),
        **_gone(left, assembly)}


def stones_given(assembly: Assembly) -> Columns:
    """What each stone is, as the scene gave it or as it was drawn."""
    stones = assembly.stones
    table = {name: np.array([getattr(stone, name) for stone in stones]) for name in (
        "material", "shape", "radius_m", "arrival_s", "strength_factor")}
    substances = [stone.substance for stone in stones]
    table["kind"] = np.array([one.kind for one in substances])
    table["density_kg_m3"] = np.array([stone.density_kg_m3 for stone in stones])
    table["youngs_modulus_Pa"] = np.array([one.material.youngs_modulus_Pa for one in substances])
    table["restitution"] = np.array([one.plate_contact.restitution for one in substances])
    table["seed"] = np.array([str(stone.seed) for stone in stones])  # may be beyond a column of whole numbers
    for name, axes, unit in (("place", "xy", "_m"), ("velocity", "xyz", "_m_s"), ("spin", "xyz", "_rad_s"),
                             ("attitude", "wxyz", "")):
        for k, axis in enumerate(axes):
            table[f"{name}_{axis}{unit}"] = np.array([getattr(stone, name + unit)[k] for stone in stones], dtype=float)
    return table


def _gone(left: Columns, assembly: Assembly) -> Columns:
    """Of each stone: mass that has left, and of one of which nothing is left when and where its last piece was."""
    n = len(assembly.stones)
    stone = left["agglomerate"] - 1
    all_gone = np.bincount(stone, left["subspheres"], n) == assembly.sizes
    last = np.full(n, -1)
    np.maximum.at(last, stone, np.arange(len(stone)))
    at = {name: np.where(all_gone, np.append(left[name], np.nan)[last], np.nan)
          for name in ("t_s", "x_m", "y_m")}
    return {"left_mass_kg": np.bincount(stone, left["mass_kg"], n), "left_s": at["t_s"],
            "left_x_m": at["x_m"], "left_y_m": at["y_m"]}


def read_walls(scene: Scene, deck: Path, step: TimeStep) -> Columns | None:
    """The mean forces on the walls (dem/engine/wall/fix_wall_side.h) at each row of the fast stream at which something
    pushed on one: t_s, at the end of the row, wall, force_x_N, force_y_N, force_z_N in the frame of the plate. None
    without walls."""
    walls = list(scene.plate.wall_height_m)
    if not walls:
        return None
    row = np.dtype([("step", "<i8"), ("force", "<f8", (3,))])
    of_walls = [np.fromfile(deck / wall_file(edge), row) for edge in walls]
    rows, edges = np.concatenate(of_walls), np.repeat(walls, [len(one) for one in of_walls])
    t_s = rows["step"] * step.dt_s
    order = np.argsort(t_s, kind="stable")
    return {"t_s": t_s[order], "wall": edges[order],
            **{f"force_{axis}_N": rows["force"][order, k] for k, axis in enumerate("xyz")}}


def wall_impulse_N_s(scene: Scene, walls: Columns, step: TimeStep) -> dict[str, list[float]]:
    """Impulse (x, y, z) on each wall, from what `read_walls` gave."""
    row_s = step.fast_steps * step.dt_s
    return {edge: [float(walls[f"force_{axis}_N"][walls["wall"] == edge].sum() * row_s) for axis in "xyz"]
            for edge in scene.plate.wall_height_m}
