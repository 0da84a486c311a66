"""One bonded stone on a rigid plate, with any value of the scene changed: what the studies of bonds share."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

from common.scene import changed_scene
from common.scene_file import scene_tables
from dem.run.run import run_scene
from dem.stones.bonds import fragments

SCENES = Path(__file__).resolve().parent.parent / "scenes"
SEEDS = (20011, 20021, 20023, 20029, 20047)


def strike(material: str, changes: dict, duration_s: float = 2.4e-3) -> dict:
    """Run scenes/single.toml on a rigid plate with dotted keys changed (None: left out); returns run.json with
    `broken_area_m2` and `largest_fragment`, its share of the stone's mass."""
    scene = changed_scene(SCENES / "single.toml", {
        "plate": scene_tables(SCENES / "hertz_coal.toml")["plate"], "output": None, "time.duration_s": duration_s,
        "stones.gangue_ratio": float(material == "gangue")} | changes)
    directory = Path(tempfile.mkdtemp())
    try:
        summary = run_scene(scene, "single.toml", directory / "run")
        events = pd.read_parquet(directory / "run" / "breakage.parquet")
        summary["broken_area_m2"] = float(events["area_m2"].sum())
        summary["largest_fragment"] = largest_fragment(directory / "run" / "deck", events["bond"].to_numpy(dtype=int))
    finally:
        shutil.rmtree(directory)
    return summary


def largest_fragment(deck: Path, broken: np.ndarray) -> float:
    """Mass of the largest fragment over that of the stone in a deck; `broken` numbers bonds from 1."""
    first, second = np.loadtxt(deck / "bonds.txt", usecols=(0, 1), dtype=int).T - 1
    count = int(np.loadtxt(deck / "agglomerates.txt"))
    lines = (deck / "atoms.data").read_text().splitlines()
    volume = np.loadtxt(lines[lines.index("Atoms") + 2:])[:, 2] ** 3
    intact = np.ones(len(first), dtype=bool)
    intact[broken - 1] = False
    return float(np.bincount(fragments(count, first, second, intact), volume).max() / volume.sum())
