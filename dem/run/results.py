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

from common.channels import DAMPING_IMPULSE, RODS_MOMENTUM, force_column, rod_column
from common.files.parquet import Columns, write_parquet
from common.run_summary import RecordedScene, YieldReport
from common.scene.error_laws import expected_error
from common.scene.scene import Scene
from dem.coupling.launch import library_version
from dem.deck.contact import read_contacts, yield_report
from dem.deck.plausible import breakage_scales, momentum_warnings, unfinished_warnings
from dem.deck.render import wall_file
from dem.deck.time_step import TimeStep, accuracy_settings
from dem.run.energy_balance import StoneLedger, check_closure, energy_ledger, energy_table, read_ledger, stone_energies
from dem.run.paraview import write_view
from dem.run.participants import PlateOfRun
from dem.run.prepare import PreparedRun, warned
from dem.stones.arrangement import gangue_ratio
from dem.stones.assembly import Assembly
from plate_fem.impact import deflection_warnings
from plate_fem.motion import FILE

_log = logging.getLogger(__name__)
# Of the broken bonds; bond and agglomerate count from 1.
EVENTS = {"bond": int, "agglomerate": int, "x_m": float, "y_m": float, "z_m": float, "mode": str, "stress_Pa": float,
          "energy_J": float, "area_m2": float}
# Of the bodies that were taken out when they had left the plate for good, in order of time.
LEFT = {"agglomerate": int, "subspheres": int, **dict.fromkeys((
    "mass_kg", "x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s", "kinetic_J", "elastic_J"), float)}


@dataclass(frozen=True)
class Pushes:
    """Rows of the push on the plate over an interval that ends at the DEM step `step` (k,): of the stone `stone` (k,),
    0-based, its mean `mean_N`, the largest mean over a co-step `largest_N`, and where, `place_m` (k, 2). `all_step`,
    `all_mean_N`, `all_largest_N` are those of all stones together."""

    step: np.ndarray
    stone: np.ndarray
    mean_N: np.ndarray
    largest_N: np.ndarray
    place_m: np.ndarray
    all_step: np.ndarray
    all_mean_N: np.ndarray
    all_largest_N: np.ndarray

    def of_stones(self, n_stones: int) -> np.ndarray:
        """(n_stones,) the largest push of each."""
        largest = np.zeros(n_stones)
        np.maximum.at(largest, self.stone, self.largest_N)
        return largest


def read_forces(file: Path) -> Pushes:
    """Read the forces that the engine wrote (contact_recorder.h)."""
    data = np.fromfile(file, dtype=[("step", "<i8"), ("agglomerate", "<i8"), ("number", "<f8", (4,))])
    of_all = data["agglomerate"] == 0
    one, all_ = data[~of_all], data[of_all]
    return Pushes(one["step"], one["agglomerate"] - 1, one["number"][:, 0], one["number"][:, 1], one["number"][:, 2:],
                  all_["step"], all_["number"][:, 0], all_["number"][:, 1])


def fast_stream(step: TimeStep, pushes: Pushes, plate_signals: Columns, columns_of: int) -> Columns:
    """All rows at the fast rate. A force is the mean over the row's interval; the plate's state is at its end.

    `plate_signals` has a row for each of the fast stream; the first `columns_of` stones have a column each. Raises
    RuntimeError if a signal holds a value that is no number.
    """
    n_rows = step.steps // step.fast_steps + 1
    total, mean = np.zeros(n_rows), np.zeros((n_rows, columns_of))
    total[pushes.all_step // step.fast_steps] = pushes.all_mean_N
    own = pushes.stone < columns_of
    mean[pushes.step[own] // step.fast_steps, pushes.stone[own]] = pushes.mean_N[own]
    table = {"t_s": np.arange(n_rows) * step.fast_steps * step.dt_s, **plate_signals, "force_N": total,
             **{force_column(k + 1): mean[:, k] for k in range(columns_of)}}
    if not all(np.isfinite(values).all() for values in table.values()):
        raise RuntimeError("a signal holds a value that is no number")
    return table


def samples_of(fast: Columns, every: int, anti_alias: bool) -> Columns:
    """Every so many rows of the fast stream, as they are or behind the filter of analysis.signals.resampling, which has
    linear phase and no delay. It stands here since scipy.signal takes as long to import as a short run."""
    if not anti_alias:
        return {name: values[::every] for name, values in fast.items()}
    ahead = np.arange(-10 * every, 10 * every + 1)
    taps = np.sinc(ahead / every) * np.kaiser(len(ahead), 5.0)
    taps /= taps.sum()

    def low(values: np.ndarray) -> np.ndarray:
        around = np.lib.stride_tricks.sliding_window_view(np.pad(values, 10 * every, mode="edge"), len(taps))
        return around[::every] @ taps
    return {name: values[::every] if name == "t_s" else low(values) for name, values in fast.items()}


def read_text_columns(file: Path, step: TimeStep, kinds: dict[str, type]) -> Columns:
    """Read a file of the engine with values between commas under a line of names, "step" and those of `kinds`, with
    the time t_s in place of the step; no rows where there is no file. Raises ValueError for another file."""
    kinds = {"step": int} | kinds
    head, *lines = file.read_text().splitlines() if file.exists() else [",".join(kinds)]
    if head.split(",") != list(kinds):
        raise ValueError(f"{file}: its first line is not {','.join(kinds)}")
    rows = [line.split(",") for line in lines]
    if any(len(row) != len(kinds) for row in rows):
        raise ValueError(f"{file}: cut off or damaged")
    columns: Columns = {name: np.array([kinds[name](row[k]) for row in rows], kinds[name])
                        for k, name in enumerate(kinds)}
    return {"t_s": columns.pop("step") * step.dt_s, **columns}


@dataclass(frozen=True)
class Results:
    """The tables of a run. `pushes` on the plate are those of the engine; `stone_mass_kg` (stones,);
    `energy` is that of dem.run.energy_balance.energy_ledger; `walls` that of `read_walls`; `deflected` that of
    plate_fem.impact.deflection_warnings."""

    events: Columns
    fast: Columns
    signals: Columns
    pushes: Pushes
    ledger: StoneLedger
    stone_mass_kg: np.ndarray
    energy: dict[str, Any]
    walls: Columns | None
    deflected: list[str]


def write_results(file: Callable[[str], Path], deck: Path, prepared: PreparedRun, plate: PlateOfRun) -> Results:
    """Write the tables and pictures of a run, from what the engine left in `deck`, to the path that `file` gives for
    each name. Raises Unstable if the energy does not close."""
    scene, step, assembly = prepared.scene, prepared.step, prepared.assembly
    pushes, events = read_forces(deck / "forces.bin"), read_text_columns(deck / "events.csv", step, EVENTS)
    fast = fast_stream(step, pushes, plate.signals(range(0, step.steps + 1, step.fast_steps)),
                       0 if assembly.is_stream else len(assembly.stones))
    signals = samples_of(fast, step.sample_steps // step.fast_steps, scene.time.anti_alias)
    walls, left = read_walls(scene, deck, step), read_text_columns(deck / "left.csv", step, LEFT)
    ledger = read_ledger(deck / "ledger.bin", len(assembly.stones))
    parts = stone_energies(ledger, scene.time.gravity_m_s2, assembly.mass_height_kg_m)
    tables = {"fast": fast, "signals": signals, "breakage": events,
              "contacts": read_contacts(deck / "contacts.bin", step.dt_s),
              "stones": stones_table(assembly, step, pushes, events, left, ledger),
              "energy": energy_table(parts, ledger, step.dt_s)}
    if walls is not None:
        tables["walls"] = walls
    if assembly.is_stream:
        tables["left"] = left
    motion = plate.recorded_motion()
    if motion is not None:
        motion.write(file(FILE))
    deflected = deflection_warnings(scene.plate, motion)
    for name, table in tables.items():
        write_parquet(table, file(f"{name}.parquet"))
    if scene.time.view_interval_s is not None:
        write_view(file, deck, prepared, events, plate.meshes)
    energy = energy_ledger(parts, plate.energy(), ledger.has_entered[-1] * assembly.kinetic_start_J)
    check_closure(energy)
    return Results(events, fast, signals, pushes, ledger, assembly.stone_mass_kg, energy, walls, deflected)


def summary_of(prepared: PreparedRun, plate: PlateOfRun, results: Results) -> dict[str, Any]:
    """The fields of common.run_summary.RunSummary that follow from a run and its results."""
    outcome = _outcome(prepared, plate, results)
    pushes, mass_kg = results.pushes, results.stone_mass_kg
    ends = pushes.step == prepared.step.steps
    end_N = np.bincount(pushes.stone[ends], pushes.mean_N[ends], len(mass_kg))
    peak_N = pushes.of_stones(len(mass_kg))
    late = warned(prepared.source, [*unfinished_warnings(prepared.scene, end_N, peak_N, mass_kg),
                                     *momentum_warnings(outcome.get("momentum_missing")), *results.deflected])
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
