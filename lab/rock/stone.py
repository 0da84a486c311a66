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
    `broken_area_m2`, the broken `stone`, `fragments`, their shares of its mass in falling order, `largest_fragment`, and
    `hoop`, as in `hoop_share`."""
    scene = changed_scene(SCENES / "single.toml", {
        "plate": RIGID, "output": None, "time.duration_s": duration_s,
        "stones.gangue_ratio": float(material == "gangue")} | changes)
    directory = Path(tempfile.mkdtemp())
    try:
        summary = run_scene(scene, "single.toml", directory / "run")
        events = pd.read_parquet(directory / "run" / "breakage.parquet")
        summary["broken_area_m2"] = float(events["area_m2"].sum())
        stone = Stone(directory / "run" / "deck", events["bond"].to_numpy(dtype=int))
        summary["fragments"] = stone.fragments()
        summary["largest_fragment"] = float(summary["fragments"][0])
        summary["hoop"] = stone.hoop_share()
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
        self.volume, center = columns[:, 2] ** 3, columns[:, 4:7]
        self.center_m = center - np.average(center, axis=0, weights=self.volume)
        self.broken = np.zeros(len(self.first), dtype=bool)
        self.broken[broken - 1] = True

    def fragments(self) -> np.ndarray:
        """Mass over that of the stone, in falling order."""
        return np.sort(np.bincount(self.fragment_of_sphere(), self.volume) / self.volume.sum())[::-1]

    def fragment_of_sphere(self) -> np.ndarray:
        return fragments(len(self.volume), self.first, self.second, ~self.broken)

    def hoop_share(self) -> float:
        """Mean over the broken bonds, less than that over all, of the square of their direction along the circles about
        the impact axis: 0 for cracks of any direction, 2/3 where all are meridional planes."""
        ends = self.center_m[self.first], self.center_m[self.second]
        middle, along = 0.5 * (ends[0] + ends[1]), ends[1] - ends[0]
        cross = middle[:, 0] * along[:, 1] - middle[:, 1] * along[:, 0]
        squared = cross**2 / ((middle[:, :2] ** 2).sum(axis=1) * (along**2).sum(axis=1))
        return float(squared[self.broken].mean() - squared.mean()) if self.broken.any() else np.nan
