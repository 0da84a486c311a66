"""Does a scene keep the tolerance it asks for? On scenes that had no part in finding the error laws.

One coal stone of 250 sub-spheres at 2.5 m/s on a plate of 0.4 x 0.3 x 0.015 m, and an unbonded sphere at 3 m/s, off
every axis; the reference has an eighth of the step, at most a quarter of the co-step, and modes to 25 kHz. Asked, expected
(run.json) and achieved error, the largest of those of work_precision, and processor time.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path

import numpy as np
import pandas as pd

from common.scene.file import scene_tables
from common.scene.scene import Scene, changed_scene
from dem.run.prepare import prepare
from dem.run.run import run_prepared
from lab.accuracy.laws import ERRORS
from lab.accuracy.work_precision import errors
from lab.constants import time_step_constants
from lab.cost import cpu_s
from lab.rock.stone import SCENES
from lab.study import Row

TOLERANCES = {"stone": (0.1, 0.04, 0.02, 0.012), "sphere": (0.1, 0.04, 0.012)}
STONES: dict[str, dict] = {"stone": {"stones.agglomerate.subspheres": 250, "stones.agglomerate.unbreakable": True, "stones.speed_m_s": 2.5},
                           "sphere": {"stones.agglomerate": None, "stones.speed_m_s": 3.0}}
REFERENCE_Hz = 25e3


def scene_of(stone: str, changes: dict) -> Scene:
    rods = [rod | {"place_m": list(np.sign(rod["place_m"]) * [0.16, 0.12])}
            for rod in scene_tables(SCENES / "single.toml")["plate"]["rods"]]
    return changed_scene(SCENES / "single.toml", {
        "time.duration_s": 1.8e-3, "time.view_interval_s": None, "stones.gangue_ratio": 0.0, "plate.thickness_m": 0.015,
        "plate.size_m": [0.4, 0.3], "plate.rods": rods,
        "stones.positions_m": [[-0.05, 0.06]], "plate.sensors": [{"name": "one", "place_m": [0.1, 0.08]}],
        "plate.max_frequency_Hz": None} | STONES[stone] | changes)


def run(scene: Scene, out: Path) -> tuple[pd.DataFrame, dict, float]:
    """(fast stream, run.json, processor time) of a scene."""
    model = prepare(scene, "tolerance", out / ".modes")
    summaries: list[dict] = []
    cost = cpu_s(lambda: summaries.append(run_prepared(model, out / "tolerance", overwrite=True)))
    return pd.read_parquet(out / "tolerance" / "fast.parquet"), summaries[0], cost


def achieved(stone: str, tolerances: tuple[float, ...], out: Path) -> list[dict]:
    """A row a tolerance."""
    runs = [run(scene_of(stone, {"tolerance": tolerance}), out) for tolerance in tolerances]
    finest = min(summary["dt_s"] for _, summary, _ in runs) / 8
    with time_step_constants({"CONTACT_STEPS": 1}):
        exact, _, _ = run(scene_of(stone, {"plate.max_frequency_Hz": REFERENCE_Hz, "time.time_step_s": finest,
                                           "time.co_step": 2}), out)
    rows = []
    for tolerance, (fast, summary, cost) in zip(tolerances, runs, strict=True):
        found = errors(fast, exact)
        rows.append({"stone": stone, "tolerance": tolerance, "expected": summary["expected_error"]["total"],
                     "achieved": max(found[name] for name in ERRORS), "dt_s": summary["dt_s"],
                     "co_step": summary["co_step"], "n_modes": summary["n_modes"], "cpu_s": cost})
    return rows


def tolerance(out: Path) -> Iterator[Row]:
    """Both stones, each with all its tolerances."""
    for stone, tolerances in TOLERANCES.items():
        found = cache(partial(achieved, stone, tolerances, out))
        for k, asked in enumerate(tolerances):
            yield Row({"stone": stone, "tolerance": asked}, lambda found=found, k=k: found()[k])  # type: ignore[misc]


def tolerance_holds(rows: pd.DataFrame) -> bool:
    return bool(np.all(rows["achieved"] <= rows["tolerance"]))
