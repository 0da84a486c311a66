"""Error against run time: each numerical setting by itself, against a far finer value of it.

Four stones that do not break, 200 sub-spheres each, fall on a plate of 0.3 x 0.3 x 0.02 m on four rods; 3 ms, which is
the impact and many periods of the plate. Without breakage nothing is chaotic, and the error of a setting has an order.
What is chaotic, the broken area of one stone, is an ensemble of five packings with its spread.

Beside the table it writes error_laws.toml (what `tolerance` in a scene goes by, committed as
common/scene/error_laws.toml) and work_precision.png. Processor time is the least of the repeats after a warm-up, of
engine, plate and output; with settings of the plate the modes are counted too.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import dem.deck.time_step
from common.scene.file import scene_tables
from common.scene.plate import FlexiblePlate
from common.scene.scene import Scene, changed_scene
from common.tables import InputError
from dem.deck.time_step import bond_time_s, stone_contact_time_s
from dem.run.prepare import prepare
from dem.run.run import RunError, run_prepared
from dem.stones.arrangement import stones_of
from dem.stones.assembly import assemble
from lab.accuracy.laws import worst_error, write_laws
from lab.accuracy.picture import draw
from lab.constants import time_step_constants
from lab.cost import cpu_s
from lab.rock.stone import SCENES, SEEDS, strike
from lab.study import Row
from plate_fem.elements.mesh import default_mesh_size
from recognition.estimation.errors import RecognitionError
from recognition.methods import METHODS

PAPER = SCENES / "paper.toml"
SAMPLE_s = 1.5e-4
COUNT = 4
TEST_RATIO = 0.5
METHOD = "energy_fusion_modified"
# Relative: of the largest value, and of the L2 norm over the run. An accelerometer also hears the highest modes, the
# centre of mass does not; it is listed beside them.
SIGNALS = {"force": "force_N", "energy": "total_J", "acceleration": "a_m_s2", "sensor": "acc_one_m_s2"}


@dataclass
class Setting:
    """One value of a numerical setting: the scene's keys that make it, and constants of dem.deck.time_step that stand
    in the way."""

    value: float
    changes: dict = field(default_factory=dict)
    constants: dict = field(default_factory=dict)


@dataclass
class NumericalSetting:
    """`reference` is far finer than every one of `settings`; `default` is the value that the scenes have or get by
    themselves, None where none has such a plate."""

    name: str
    unit: str
    default: float | None
    settings: list[Setting]
    reference: Setting
    of_the_plate: bool = False
    recognised: bool = True  # by the model of the bonded stones


def _rods(x_m: float, y_m: float) -> list[dict]:
    """The paper's, elsewhere."""
    return [rod | {"place_m": list(np.sign(rod["place_m"]) * [x_m, y_m])}
            for rod in scene_tables(PAPER)["plate"]["rods"]]


def scene_of(changes: dict) -> Scene:
    """The reduced scene."""
    places = [(0.06, 0.0), (0.0, 0.05), (-0.07, -0.01), (0.01, -0.08)]
    sensors = [{"name": "one", "place_m": [0.03, 0.1]}]
    return changed_scene(PAPER, {
        "time.duration_s": 3e-3, "time.sample_interval_s": SAMPLE_s, "time.view_interval_s": None,
        "stones.count": COUNT, "stones.gangue_order": list(range(1, COUNT + 1)),
        "stones.positions_m": [[x, y] for x, y in places], "stones.gangue_ratio": TEST_RATIO,
        "stones.agglomerate.subspheres": 200, "stones.agglomerate.unbreakable": True,
        "plate.size_m": [0.3, 0.3], "plate.rods": _rods(0.12, 0.12), "plate.sensors": sensors,
        "plate.max_frequency_Hz": 20e3} | changes)


# Settings coarser than a scene may ask for.
FREE = {"CONTACT_STEPS": 1, "BOND_FRACTION": 9.0, "DAMPED_SHARE": 9.0, "RAYLEIGH_FRACTION": 9.0, "STIFFNESS_SHARE": 9.0,
        "DASHPOT_SHARE": 9.0}
SPHERES: dict = {"stones.agglomerate": None}


def numerical_settings() -> list[NumericalSetting]:
    scene = scene_of({})
    assembly = assemble(scene, stones_of(scene, "scene"))
    t0, stone_contact_s = bond_time_s(assembly), stone_contact_time_s(assembly)
    assert t0 is not None and isinstance(scene.plate, FlexiblePlate)
    return [*step_settings(t0, stone_contact_s), *plate_settings(stone_contact_s, default_mesh_size(scene.plate)),
            *other_settings()]


def step_settings(t0: float, stone_contact_s: float) -> list[NumericalSetting]:
    """Time step and co-step, of bonded stones and of unbonded spheres."""
    # A sample holds 30 rows of the fast stream, a row whole co-steps: lengths that divide it are met exactly.
    row = SAMPLE_s / dem.deck.time_step.FAST_PER_SAMPLE
    longest = row / np.ceil(row / (0.45 * t0))
    fine = longest / 4

    def step(k: int) -> Setting:
        return Setting(longest / k / t0, {"time.time_step_s": longest / k, "time.co_step": k}, FREE)

    def sphere(k: int) -> Setting:
        dt = row / 2 / k
        return Setting(dt / stone_contact_s, SPHERES | {"time.time_step_s": dt, "time.co_step": k}, FREE)

    def co_step(n: int, dt: float, changes: dict) -> Setting:
        return Setting(n * dt / stone_contact_s, changes | {"time.time_step_s": dt, "time.co_step": n}, FREE)

    unit, default = "of the contact time", 1 / dem.deck.time_step.CO_STEPS_IN_CONTACT
    return [
        NumericalSetting("time step", "dt/t0", dem.deck.time_step.BOND_FRACTION, [step(k) for k in (1, 2, 3, 4, 6, 8)],
                         step(32)),
        NumericalSetting("time step, spheres", unit, 1 / dem.deck.time_step.CONTACT_STEPS,
                         [sphere(k) for k in (1, 2, 4, 8)], sphere(32),
             recognised=False),
        NumericalSetting("co-step", unit, default, [co_step(n, fine, {}) for n in (1, 2, 3, 4, 6, 12, 24)],
             Setting(0.0, {"time.time_step_s": fine / 6, "time.co_step": 1}, FREE)),
        NumericalSetting("co-step, spheres", unit, default, [co_step(n, row / 36, SPHERES) for n in (2, 4, 9, 18, 36)],
             co_step(1, row / 36, SPHERES), recognised=False)]


def plate_settings(stone_contact_s: float, cell_m: float) -> list[NumericalSetting]:
    """Modes and mesh; modes also on a thinner plate, which needs more of them."""
    thin = {"plate.size_m": [0.32, 0.24], "plate.thickness_m": 0.012, "time.duration_s": 1.8e-3,
            "plate.rods": _rods(0.12, 0.09), "stones.count": 1, "stones.gangue_order": [1],
            "stones.positions_m": [[0.07, 0.03]], "stones.gangue_ratio": 1.0}
    stone = {"stones.speed_m_s": 2.0, "stones.agglomerate.subspheres": 300}
    one_sphere = {"stones.speed_m_s": 4.0} | SPHERES

    def modes(frequency_Hz: float, changes: dict) -> Setting:
        return Setting(frequency_Hz * stone_contact_s, {"plate.max_frequency_Hz": frequency_Hz} | changes)

    def thin_modes(number: float, changes: dict) -> Setting:
        alone = scene_of(thin | changes)
        contact_s = stone_contact_time_s(assemble(alone, stones_of(alone, "scene")))
        return Setting(number, {"plate.max_frequency_Hz": number / contact_s} | thin | changes)

    def mesh(factor: float) -> Setting:
        return Setting(factor, {"plate.mesh_size_m": factor * cell_m})

    unit = "cut-off x contact time"
    return [
        *(NumericalSetting(f"modes{name}", unit, 20e3 * stone_contact_s,
               [modes(f, changes) for f in (2.5e3, 3.5e3, 5e3, 10e3, 20e3, 28e3)], modes(56e3, changes), of_the_plate=True,
               recognised=not changes) for name, changes in (("", {}), (", spheres", SPHERES))),
        *(NumericalSetting(f"modes, thin plate{name}", unit, None, [thin_modes(n, changes) for n in (1.13, 2.3, 4.5)],
               thin_modes(6.4, changes), of_the_plate=True, recognised=False)
          for name, changes in (("", stone), (", spheres", one_sphere))),
        NumericalSetting("mesh", "of the default cell", 1.0, [mesh(f) for f in (2.0, 1.5, 1.0, 0.7)], mesh(0.35),
                         of_the_plate=True)]


def other_settings() -> list[NumericalSetting]:
    """Output rate and tolerance of free flight."""
    def rows(n: int) -> Setting:
        return Setting(n / SAMPLE_s, {}, {"FAST_PER_SAMPLE": n, "FAST_Hz": n / SAMPLE_s})

    # Seen only where a stone comes down again: one, slow enough to do so within 0.15 s.
    bounce = {"time.duration_s": 0.15, "stones.speed_m_s": 0.5, "stones.count": 1, "stones.gangue_order": [1],
              "stones.positions_m": [[0.05, 0.03]], "stones.gangue_ratio": 0.0}

    def free_flight(tolerance: float) -> Setting:
        return Setting(tolerance, {"time.free_flight_tolerance": tolerance} | bounce)

    return [
        NumericalSetting("output rate", "Hz", dem.deck.time_step.FAST_PER_SAMPLE / SAMPLE_s,
                         [rows(n) for n in (1, 2, 5, 10, 15, 30)],
             rows(60)),
        NumericalSetting("free-flight tolerance", "of the energy of the impact", 3e-4,
                         [free_flight(t) for t in (1e-2, 1e-3, 3e-4, 1e-4, 1e-5, 1e-6)],
                         free_flight(0.0), recognised=False)]


def run(setting: Setting, out: Path, repeats: int, of_the_plate: bool, ratio: float = TEST_RATIO) -> dict:
    """{"fast", "signals": streams, "cpu_s"} of one setting; InputError or RunError if there is none."""
    with time_step_constants(setting.constants):
        scene = scene_of({"stones.gangue_ratio": ratio} | setting.changes)
        directory, times, models = out / "run", [], []
        cache = None if of_the_plate else out / ".modes"
        preparation = cpu_s(lambda: models.append(prepare(scene, "accuracy", cache)))
        model = models[0]
        for _ in range(repeats):
            times.append(cpu_s(lambda: run_prepared(model, directory, overwrite=True)))
    fast, signals = (pd.read_parquet(directory / f"{name}.parquet") for name in ("fast", "signals"))
    summary = json.loads((directory / "run.json").read_text())
    shutil.rmtree(directory)
    return {"fast": fast, "signals": signals, "cpu_s": min(times) + (preparation if of_the_plate else 0.0), "summary": summary}


def errors(fast: pd.DataFrame, reference: pd.DataFrame) -> dict[str, float]:
    """Relative errors by name. A stream with fewer rows is compared as a user would see it: its peaks with
    those of the finer one, and drawn linearly between its rows: states at their instant, forces, which are means over
    the row that ends there, at its middle."""
    t = reference["t_s"].to_numpy()
    found = {}
    for name, column in SIGNALS.items():
        exact, x = reference[column].to_numpy(), fast[column].to_numpy()
        found[f"{name}_peak"] = abs(abs(x).max() / abs(exact).max() - 1)
        if len(x) != len(t):
            at = fast["t_s"].to_numpy()
            early = 0.5 if name == "force" else 0.0
            x = np.interp(t - early * (t[1] - t[0]), at - early * (at[1] - at[0]), x)
        found[f"{name}_l2"] = float(np.linalg.norm(x - exact) / np.linalg.norm(exact))
    return found


class Recognition:
    """A model fitted on reference runs of every ratio, to see what a numerical setting does to a recognised ratio."""

    def __init__(self, out: Path):
        ratios = [k / COUNT for k in range(COUNT + 1)]
        self._method = METHODS[METHOD].make()
        signals = [run(Setting(0.0), out, 1, False, ratio)["signals"] for ratio in ratios]
        self._method.fit([self._method.prepare(s) for s in signals], np.array(ratios))

    def points(self, signals: pd.DataFrame) -> float:
        """Recognised ratio, points of mixing ratio. Raises RecognitionError where there is none."""
        (answer,) = self._method.answer([self._method.prepare(signals)])
        if answer.reason:
            raise RecognitionError(answer.reason)
        return 100 * answer.ratio


def work_precision(out: Path, repeats: int = 2) -> Iterator[Row]:
    """Each value of each numerical setting, and the ensembles of what breaks."""
    once = cache(lambda: run(Setting(0.0), out, 1, False))  # the warm-up
    recognition = cache(lambda: Recognition(out))
    for varied in numerical_settings():
        exact = cache(partial(run, varied.reference, out, 1, varied.of_the_plate))

        def measured(varied: NumericalSetting, setting: Setting, exact: Callable[[], dict]) -> dict[str, Any]:
            once()
            row: dict[str, Any] = {"unit": varied.unit, "default": varied.default}
            try:
                found = run(setting, out, repeats, varied.of_the_plate)
            except (InputError, RunError) as error:
                return row | {"outcome": str(error)}
            if varied.recognised:
                row["ratio_points"] = abs(recognition().points(found["signals"])
                                          - recognition().points(exact()["signals"]))
            summary = found["summary"]
            return row | errors(found["fast"], exact()["fast"]) | {
                "cpu_s": found["cpu_s"], "dt_s": summary["dt_s"], "co_step": summary["co_step"],
                "n_modes": summary["n_modes"], "outcome": "finished"}

        for setting in varied.settings:
            yield Row({"numerical_setting": varied.name, "setting": setting.value},
                      partial(measured, varied, setting, exact))
    for name, unit, default, settings in ENSEMBLES:
        for value, changes, values in settings:
            yield Row({"numerical_setting": name, "setting": value}, partial(ensemble, unit, default, changes, values))


def work_precision_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """With the worst of the deterministic errors, and the differences of an ensemble's means from those of its finest
    setting, the first."""
    for name, *_ in ENSEMBLES:
        own = rows[rows["numerical_setting"] == name]
        finest = own.iloc[0]
        rows.loc[own.index, "broken_area"] = (own["broken_area_cm2"] / finest["broken_area_cm2"] - 1).abs()
        rows.loc[own.index, "force_peak"] = (own["peak_force_N"] / finest["peak_force_N"] - 1).abs()
    draw(rows, out / "work_precision.png")
    write_laws(rows, out / "error_laws.toml")
    rows.insert(2, "worst", worst_error(rows))
    return rows


# Numerical setting, unit, default, and (value, keys of the scene, constants), the finest first.
ENSEMBLES: list[tuple[str, str, float, list[tuple[float, dict, dict]]]] = [
    ("sub-spheres", "a stone", 500.0, [(n, {"stones.agglomerate.subspheres": n}, {}) for n in (1000, 500, 200, 100)]),
    ("time step, breaking", "dt/t0", dem.deck.time_step.BOND_FRACTION,
     [(f, {"stones.agglomerate.subspheres": 200}, {"BOND_FRACTION": f}) for f in (0.06, 0.15, 0.37)])]


def ensemble(unit: str, default: float, changes: dict, values: dict) -> dict[str, Any]:
    """One coal stone on a rigid plate, five packings: broken area and peak force, mean and standard error of the mean."""
    runs: list[dict] = []
    with time_step_constants(values):
        cost = cpu_s(lambda: runs.extend(strike("coal", changes | {"stones.seed": seed}, 9e-4) for seed in SEEDS))
    area, peak = (np.array([r[key] for r in runs]) for key in ("broken_area_m2", "peak_force_N"))
    return {"unit": unit, "default": default, "cpu_s": cost / len(SEEDS), "broken_area_cm2": 1e4 * area.mean(),
            "broken_area_sem_cm2": 1e4 * area.std(ddof=1) / len(SEEDS)**0.5, "peak_force_N": peak.mean(),
            "peak_force_sem_N": peak.std(ddof=1) / len(SEEDS)**0.5, "outcome": "finished"}
