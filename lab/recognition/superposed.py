"""A data set of any size without the engine: the runs of a plan, of forces that single stones had in the engine.

Each stone of a run has the history of a stone of its material whose size and speed are near its own
(lab/known_truth/stone_histories.py), drawn by the seed of its packing and scaled by Hertz to its radius, density,
modulus, restitution and speed. The forces are superposed on the modes of the plate. Strengths change nothing, stones
do not meet, and none comes back."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np
import pandas as pd

from common.channels import force_column, rod_column, sensor_column
from common.scene.scene import PLATE
from dem.batch.dataset import DatasetRun, plan_dataset
from dem.stones.arrangement import stones_of
from dem.stones.stone import Stone
from lab.known_truth.stone_histories import SETS, histories
from lab.study import Row
from recognition.plate.plate_model import PlateModel, modal_steps
from recognition.stone_forces.forces import History

STEP_s, SAMPLE, FORCES_s = 5e-6, 30, 0.014  # SAMPLE: steps of a row of signals.parquet
NEAR = 12  # histories among which one is drawn
OF_THE_ROCK = tuple(name for name in SETS if name != "other_rock")


@cache
def known(gangue: bool, sets: tuple[str, ...]) -> list[History]:
    return [one for name in sets for one in histories(name) if one.gangue == gangue]


def near(gangue: bool, radius_m: float, speed_m_s: float, seed: int, sets: tuple[str, ...]) -> History:
    """A stone of the engine whose size and speed are near."""
    every = known(gangue, sets)
    far = [np.log(one.radius_m / radius_m) ** 2 + np.log(one.speed_m_s / speed_m_s) ** 2 for one in every]
    return every[int(np.random.default_rng([seed, gangue]).choice(np.argsort(far)[:NEAR]))]


def force_of(stone: Stone, steps: int, sets: tuple[str, ...] = OF_THE_ROCK) -> np.ndarray:
    """(steps,) in N, by a history of one of the sets. Hertz: duration ~ R (rho/E*)^(2/5) v^(-1/5), impulse ~ rho R^3 v (1 + e)."""
    substance, gangue = stone.substance, stone.substance.kind == "gangue"
    one = near(gangue, stone.radius_m, stone.speed_m_s, stone.seed, sets)
    material, plate = substance.table, substance.plate

    def modulus(youngs_modulus_Pa: float) -> float:
        return 1 / ((1 - material.poisson_ratio**2) / youngs_modulus_Pa + (1 - plate.poisson_ratio**2) / plate.youngs_modulus_Pa)

    size, speed = stone.radius_m / one.radius_m, stone.speed_m_s / one.speed_m_s
    density = stone.density_kg_m3 / one.density_kg_m3
    stiff = modulus(substance.material.youngs_modulus_Pa) / modulus(material.youngs_modulus_Pa)
    rebound = (1 + substance.plate_contact.restitution) / (1 + substance.contacts[PLATE].restitution)
    longer, more = size * (density / stiff) ** 0.4 * speed**-0.2, density * size**3 * speed * rebound
    total = np.concatenate([[0.0], np.cumsum(one.force_N) * one.step_s])  # impulse up to the end of each step
    ends_s = np.arange(steps + 1) * STEP_s - stone.arrival_s
    return more * np.diff(np.interp(ends_s / longer, np.arange(total.size) * one.step_s, total)) / STEP_s


@dataclass(frozen=True)
class Plate:
    """A plate of a scene, and the share of each mode in the motion of its centre of mass."""

    model: PlateModel
    centre: np.ndarray


@cache
def plate_of(table: str) -> Plate:
    from common.scene.plate import FlexiblePlate

    plate = FlexiblePlate.model_validate_json(table)
    assert plate.max_frequency_Hz is not None
    model = PlateModel.from_scene(plate, plate.max_frequency_Hz)
    weights = [np.gradient(lines) * np.where((lines == lines[0]) | (lines == lines[-1]), 0.5, 1.0)
               for lines in (model.lines_x_m, model.lines_y_m)]
    mean = np.einsum("i,j,ijm->m", *weights, model.grid_shape) / (weights[0].sum() * weights[1].sum())
    return Plate(model, mean)


def signals_of(plate: Plate, force_N: np.ndarray, place_m: np.ndarray) -> dict[str, np.ndarray]:
    """What signals.parquet has of a run."""
    model = plate.model
    modal = -model.shape(*place_m.T).T @ force_N
    amplitude, rate, acceleration = (one[:, ::SAMPLE] for one in modal_steps(model, modal, 1 / STEP_s))
    kinetic = 0.5 * np.sum(rate**2, axis=0)
    internal = 0.5 * np.sum((2 * np.pi * model.frequency_Hz[:, None] * amplitude) ** 2, axis=0)
    columns = {"t_s": np.arange(kinetic.size) * SAMPLE * STEP_s, "u_m": plate.centre @ amplitude,
               "v_m_s": plate.centre @ rate, "a_m_s2": plate.centre @ acceleration, "kinetic_J": kinetic,
               "internal_J": internal, "total_J": kinetic + internal, "force_N": force_N.sum(axis=0)[::SAMPLE]}
    columns |= dict(zip(map(sensor_column, model.sensor_names), model.sensor_shape @ acceleration, strict=True))
    return columns | {rod_column(k): row for k, row in enumerate(model.rod_force_N_m @ amplitude, 1)}


def write(planned: DatasetRun, directory: Path) -> dict[str, object]:
    """A run directory; one that is there is kept."""
    scene = planned.scene
    if not (directory / "run.json").is_file():
        directory.mkdir(parents=True, exist_ok=True)
        stones = stones_of(scene, planned.source)
        steps = round(scene.time.duration_s / STEP_s) + SAMPLE
        force = np.stack([force_of(stone, steps) for stone in stones])
        place = np.array([stone.place_m for stone in stones])
        pd.DataFrame(signals_of(plate_of(scene.plate.model_dump_json()), force, place)).to_parquet(directory / "signals.parquet")
        kept = round(FORCES_s / STEP_s)
        table = {"t_s": np.arange(kept + 1) * STEP_s}
        table |= {force_column(k): np.concatenate([[0.0], row[:kept]]) for k, row in enumerate(force, 1)}
        pd.DataFrame(table).to_parquet(directory / "fast.parquet")
        velocity = np.array([stone.velocity_m_s for stone in stones])
        pd.DataFrame({
            "stone": np.arange(1, len(stones) + 1), "kind": [stone.substance.kind for stone in stones],
            "radius_m": [stone.radius_m for stone in stones], "mass_kg": [stone.mass_kg for stone in stones], "arrival_s": [stone.arrival_s for stone in stones],
            "impulse_N_s": force.sum(axis=1) * STEP_s, "peak_force_N": force.max(axis=1),
            **{f"{name}_{axis}_m{unit}": values[:, k] for name, values, unit in (
                ("place", place, ""), ("first", place, ""), ("velocity", velocity, "_s"))
               for k, axis in enumerate("xyz"[:values.shape[1]])}}).to_parquet(directory / "stones.parquet")
        (directory / "run.json").write_text(json.dumps({
            "status": "finished", "scene": scene.model_dump(mode="json"), "gangue_ratio": scene.stones.gangue_ratio,
            "materials": [stone.material for stone in stones], "impulse_N_s": float(force.sum() * STEP_s)}))
    return {"directory": str(directory)}


def superposed(out: Path, plan: str = "scenes/dataset.toml", runs: int = 44, families: tuple[str, ...] = ()) -> Iterator[Row]:
    """A run a row, in out/FAMILY/GROUP/ratio_*."""
    for planned in plan_dataset(Path(plan), runs):
        if not families or planned.directory.parts[0] in families:
            yield Row({"run": str(planned.directory)}, partial(write, planned, out / planned.directory))
