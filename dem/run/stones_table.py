"""stones.parquet: a row a stone, what it was and what became of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from dem.deck.time_step import TimeStep
from dem.run.recorder import Pushes
from dem.stones.assembly import Assembly

LEFT_COLUMNS = ["step", "agglomerate", "subspheres", "mass_kg", "x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s",
                "kinetic_J", "elastic_J"]


def read_left(file: Path) -> pd.DataFrame:
    """The bodies that were taken out when they had left the plate for good, in order of time; none where the file is
    missing, since all stones were there from the start to the end."""
    types = {name: int if k < 3 else float for k, name in enumerate(LEFT_COLUMNS)}
    if not file.exists():
        return pd.DataFrame({name: pd.Series(dtype=kind) for name, kind in types.items()})
    return pd.read_csv(file, dtype=types)


def left_table(left: pd.DataFrame, step: TimeStep) -> pd.DataFrame:
    """What `read_left` gives, with the time t_s in place of the DEM step."""
    return pd.concat([(left["step"] * step.dt_s).rename("t_s"), left.drop(columns="step")], axis=1)


def stones_table(assembly: Assembly, step: TimeStep, pushes: Pushes, events: pd.DataFrame,
                 left: pd.DataFrame) -> pd.DataFrame:
    """A row a stone, in order, with what each is (dem.stones.stone.Stone), and:

    first_contact_s (to the end of a row of the fast stream), first_x_m, first_y_m, peak_force_N (mean over a co-step),
    impulse_Ns on the plate, broken_area_m2, left_mass_kg of its pieces that have left the plate for good, left_s when
    the last of them did, and where then, left_x_m, left_y_m. What did not happen is not a number.
    """
    n = len(assembly.stones)
    first = pd.DataFrame({"stone": pushes.stone, "row": np.arange(len(pushes.stone))}).groupby("stone")["row"].first()
    row, hit = first.to_numpy(), first.index.to_numpy()
    contact_s, place = np.full(n, np.nan), np.full((n, 2), np.nan)
    contact_s[hit], place[hit] = pushes.step[row] * step.dt_s, pushes.place_m[row]
    impulse = np.bincount(pushes.stone, pushes.mean_N, n) * step.fast_steps * step.dt_s
    area = events.groupby("agglomerate")["area_m2"].sum().reindex(range(1, n + 1), fill_value=0.0)
    return pd.DataFrame({
        "stone": np.arange(1, n + 1), **_given(assembly), "mass_kg": assembly.stone_mass_kg,
        "subspheres": assembly.sizes, "first_contact_s": contact_s, "first_x_m": place[:, 0], "first_y_m": place[:, 1],
        "peak_force_N": pushes.of_stones(n), "impulse_Ns": impulse, "broken_area_m2": area.to_numpy(),
        **_gone(left, assembly, step)})


def _given(assembly: Assembly) -> dict[str, list[object]]:
    stones = assembly.stones
    table: dict[str, list[object]] = {name: [getattr(stone, name) for stone in stones] for name in (
        "material", "shape", "radius_m", "arrival_s", "strength_factor")}
    table["seed"] = [str(stone.seed) for stone in stones]  # may be beyond what a column of whole numbers holds
    for name, axes, unit in (("place", "xy", "_m"), ("velocity", "xyz", "_m_s"), ("spin", "xyz", "_rad_s"),
                             ("attitude", "wxyz", "")):
        for k, axis in enumerate(axes):
            table[f"{name}_{axis}{unit}"] = [getattr(stone, name + unit)[k] for stone in stones]
    return table


def _gone(left: pd.DataFrame, assembly: Assembly, step: TimeStep) -> dict[str, np.ndarray]:
    """Of each stone: mass that has left, and of one of which nothing is left when and where its last piece was."""
    n = len(assembly.stones)
    stone = left["agglomerate"].to_numpy() - 1
    all_gone = np.bincount(stone, left["subspheres"], n) == assembly.sizes
    last = left.groupby("agglomerate").last().reindex(range(1, n + 1))
    at = {name: np.where(all_gone, last[name].to_numpy(dtype=float), np.nan) for name in ("step", "x_m", "y_m")}
    return {"left_mass_kg": np.bincount(stone, left["mass_kg"], n), "left_s": at["step"] * step.dt_s,
            "left_x_m": at["x_m"], "left_y_m": at["y_m"]}
