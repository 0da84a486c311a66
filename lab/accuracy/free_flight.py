"""What bodies in free flight save, and what they change: the default scene beside brute force.

Of each window and seed: processor time of engine, plate and output over that of brute force (packing and modes are in
neither), errors of the largest total force and of the largest energy of the plate over the window that brute force ran and
over its second half, broken bonds of both in that window. Brute force of 0.6 s takes about ten minutes a seed, so
`brute_window` lets it run a shorter time, from which its cost over the whole window follows; with `brute_seeds` it runs
for the first seeds only, and the mean of their costs stands for the others.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pandas as pd

from common.scene.scene import changed_scene, read_scene
from dem.run.prepare import prepare
from dem.run.run import run_prepared
from lab.cost import cpu_s
from lab.rock.stone import SCENES
from lab.study import Row

PAPER = SCENES / "paper.toml"
STEP = 100  # from one seed to the next


def run(window_s: float, seed: int, tolerance: float, cache: Path) -> tuple[float, pd.DataFrame, pd.DataFrame]:
    """Processor time in s, fast stream, broken bonds."""
    changes = {"time.duration_s": window_s, "time.free_flight_tolerance": tolerance, "stones.seed": seed}
    model = prepare(changed_scene(PAPER, changes), str(PAPER), cache)
    with tempfile.TemporaryDirectory() as directory:
        out = Path(directory) / "run"
        cost = cpu_s(lambda: run_prepared(model, out))
        fast = pd.read_parquet(out / "fast.parquet", columns=["t_s", "force_N", "total_J"])
        return cost, fast, pd.read_parquet(out / "breakage.parquet", columns=["t_s"])


def compare(window_s: float, seed: int, tolerance: float, cache: Path, brute_s: float) -> dict[str, float]:
    """A row of the table; brute_s: what brute force runs of the window, 0 for nothing."""
    cost, fast, broken = run(window_s, seed, tolerance, cache)
    row = {"tolerance": tolerance, "cost_s": cost, "broken_bonds": len(broken)}
    if not brute_s:
        return row | {"cost_brute_s": float("nan")}
    brute_cost, brute, brute_broken = run(brute_s, seed, 0.0, cache)

    def error(name: str, start_s: float) -> float:
        expected, found = (table[name][(table["t_s"] >= start_s) & (table["t_s"] <= brute_s)].max()
                           for table in (brute, fast))
        return float(abs(found - expected) / expected) if expected else 0.0

    return row | {"brute_window_s": brute_s, "cost_brute_s": brute_cost * window_s / brute_s,
                  "peak_force_error": error("force_N", 0), "plate_energy_error": error("total_J", 0),
                  "late_peak_force_error": error("force_N", brute_s / 2),
                  "late_plate_energy_error": error("total_J", brute_s / 2),
                  "broken_in_brute_window": int((broken["t_s"] <= brute_s).sum()),
                  "broken_bonds_brute": len(brute_broken)}


def free_flight(out: Path, windows: tuple[float, ...] = (0.6,), seeds: int = 10, first_seed: int = 20811,
                brute_window: float = 0.1, brute_seeds: int = 1) -> Iterator[Row]:
    """brute_window: 0 for the whole window."""
    scene = read_scene(PAPER)
    for window_s in windows:
        for k in range(seeds):
            seed, brute_s = first_seed + STEP * k, brute_window or window_s
            yield Row({"window_s": window_s, "seed": seed},
                      partial(compare, window_s, seed, scene.time.free_flight_tolerance, out / ".modes",
                              brute_s if k < brute_seeds else 0.0))


def free_flight_table(table: pd.DataFrame, out: Path) -> pd.DataFrame:
    """With the cost over that of brute force, where that was not run over the mean of the seeds for which it was."""
    mean = table.groupby("window_s")["cost_brute_s"].transform("mean")
    return table.assign(cost_ratio=table["cost_s"] / table["cost_brute_s"].fillna(mean))
