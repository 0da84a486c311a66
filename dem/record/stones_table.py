"""stones.parquet: a row a stone, what it was and what became of it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from common.files.parquet import Columns
from common.scene.scene import Scene
from dem.deck.time_step import TimeStep
from dem.record.energy_balance import StoneLedger
from dem.record.recorder import Pushes, read_text_columns
from dem.stones.assembly import Assembly, density_kg_m3
from dem.stones.substance import material_of, plate_contact

LEFT_COLUMNS = ["step", "agglomerate", "subspheres", "mass_kg", "x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s",
                "kinetic_J", "elastic_J"]


def read_left(file: Path) -> Columns:
    """The bodies that were taken out when they had left the plate for good, in order of time; none where the file is
    missing, since all stones were there from the start to the end."""
    return read_text_columns(file, {name: int if k < 3 else float for k, name in enumerate(LEFT_COLUMNS)})


def left_table(left: Columns, step: TimeStep) -> Columns:
    """What `read_left` gives, with the time t_s in place of the DEM step."""
    return {"t_s": left["step"] * step.dt_s, **{name: left[name] for name in LEFT_COLUMNS[1:]}}


def stones_table(scene: Scene, assembly: Assembly, step: TimeStep, pushes: Pushes, events: Columns,
                 left: Columns, ledger: StoneLedger) -> Columns:
    """A row a stone, in order, with what each is (dem.stones.stone.Stone), and:

    waited_s until nothing was in its way, first_contact_s (to the end of a row of the fast stream), first_x_m,
    first_y_m, peak_force_N (mean over a co-step),
    impulse_Ns on the plate, broken_area_m2, left_mass_kg of its pieces that have left the plate for good, left_s when
    the last of them did, and where then, left_x_m, left_y_m. What did not happen is not a number.
    """
    n = len(assembly.stones)
    hit, row = np.unique(pushes.stone, return_index=True)  # the first of each
    contact_s, place = np.full(n, np.nan), np.full((n, 2), np.nan)
    contact_s[hit], place[hit] = pushes.step[row] * step.dt_s, pushes.place_m[row]
    impulse = np.bincount(pushes.stone, pushes.mean_N, n) * step.fast_steps * step.dt_s
    area = [math.fsum(events["area_m2"][events["agglomerate"] == k]) for k in range(1, n + 1)]
    return {
        "stone": np.arange(1, n + 1), **stones_given(scene, assembly), "mass_kg": assembly.stone_mass_kg,
        "subspheres": assembly.sizes,
        "waited_s": np.where(ledger.has_entered[-1], ledger.column["waited_steps"][-1] * step.dt_s, np.nan),
        "first_contact_s": contact_s, "first_x_m": place[:, 0], "first_y_m": place[:, 1],
        "peak_force_N": pushes.of_stones(n), "impulse_Ns": impulse, "broken_area_m2": np.array(area),
        **_gone(left, assembly, step)}


def stones_given(scene: Scene, assembly: Assembly) -> Columns:
    """What each stone is, as the scene gave it or as it was drawn."""
    stones = assembly.stones
    table = {name: np.array([getattr(stone, name) for stone in stones]) for name in (
        "material", "shape", "radius_m", "arrival_s", "strength_factor")}
    table["kind"] = np.array([scene.kind_of(stone.material) for stone in stones])
    table["density_kg_m3"] = np.array([density_kg_m3(scene, stone) for stone in stones])
    table["youngs_modulus_Pa"] = np.array([material_of(scene, stone.substance).youngs_modulus_Pa for stone in stones])
    table["restitution"] = np.array([plate_contact(scene, stone.substance).restitution for stone in stones])
    table["seed"] = np.array([str(stone.seed) for stone in stones])  # may be beyond a column of whole numbers
    for name, axes, unit in (("place", "xy", "_m"), ("velocity", "xyz", "_m_s"), ("spin", "xyz", "_rad_s"),
                             ("attitude", "wxyz", "")):
        for k, axis in enumerate(axes):
            table[f"{name}_{axis}{unit}"] = np.array([getattr(stone, name + unit)[k] for stone in stones], dtype=float)
    return table


def _gone(left: Columns, assembly: Assembly, step: TimeStep) -> Columns:
    """Of each stone: mass that has left, and of one of which nothing is left when and where its last piece was."""
    n = len(assembly.stones)
    stone = left["agglomerate"] - 1
    all_gone = np.bincount(stone, left["subspheres"], n) == assembly.sizes
    last = np.full(n, -1)
    np.maximum.at(last, stone, np.arange(len(stone)))
    at = {name: np.where(all_gone, np.append(left[name].astype(float), np.nan)[last], np.nan)
          for name in ("step", "x_m", "y_m")}
    return {"left_mass_kg": np.bincount(stone, left["mass_kg"], n), "left_s": at["step"] * step.dt_s,
            "left_x_m": at["x_m"], "left_y_m": at["y_m"]}
