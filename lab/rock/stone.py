"""One bonded stone on a rigid plate, with any value of the scene changed: what the studies of bonds share."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

from common.scene.file import scene_tables
from common.scene.scene import changed_scene
from dem.run.run import run_scene
from dem.stones.bonds import fragments

SCENES = Path(__file__).resolve().parents[2] / "scenes"
SEEDS = (20011, 20021, 20023, 20029, 20047)
RIGID = scene_tables(SCENES / "hertz_coal.toml")["plate"]
PAIRS = ("coal_plate", "gangue_plate", "coal_coal", "coal_gangue", "gangue_gangue")


def strike(material: str, changes: dict, duration_s: float = 2.4e-3) -> dict:
    """Run scenes/single.toml on a rigid plate with dotted keys changed (None: left out); returns run.json with
    `broken_area_m2`, the broken `stone` and its `largest_fragment`, a share of its mass."""
    scene = changed_scene(SCENES / "single.toml", {
        "plate": RIGID, "time.view_interval_s": None, "time.duration_s": duration_s,
        "stones.gangue_ratio": float(material == "gangue")} | changes)
    directory = Path(tempfile.mkdtemp())
    try:
        summary = run_scene(scene, "single.toml", directory / "run")
        events = pd.read_parquet(directory / "run" / "breakage.parquet")
        summary["broken_area_m2"] = float(events["area_m2"].sum())
        stone = Stone(directory / "run" / "deck", events["bond"].to_numpy(dtype=int))
        summary["largest_fragment"] = float(stone.fragments()[0])
        summary["stone"] = stone
    finally:
        shutil.rmtree(directory)
    return summary


class Stone:
    """A deck's stone before the impact, and which of its bonds were broken (numbers from 1)."""

    def __init__(self, deck: Path, broken: np.ndarray):
        self.first, self.second = np.loadtxt(deck / "bonds.txt", usecols=(0, 1), dtype=int).T - 1
        lines = (deck / "atoms.data").read_text().splitlines()
        columns = np.loadtxt(lines[lines.index("Atoms") + 2:])
        self.volume = columns[:, 2] ** 3
        self.broken = np.zeros(len(self.first), dtype=bool)
        self.broken[broken - 1] = True

    def fragments(self) -> np.ndarray:
        """Mass over that of the stone, in falling order."""
        fragment = fragments(len(self.volume), self.first, self.second, ~self.broken)
        return np.sort(np.bincount(fragment, self.volume) / self.volume.sum())[::-1]
