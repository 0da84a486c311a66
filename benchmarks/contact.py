"""Unbreakable stones with the smooth contact beside the elastic sphere that they stand for (docs/contact.md).

    python -m benchmarks.contact [--packings 3] [--turns 2] [--cases NAME ...] [--jobs 1] [--out runs/contact]

A case is a number of sub-spheres, a material, a speed in m/s and a plate, as 500_coal_3_rigid or 200_gangue_0.3_paper.
Writes contact.csv, a row a stone, and prints a table with mean and scatter of each case: peak force, contact time and
impulse over those of the sphere, on the plate of the paper also the energy that the plate got. The stone's packing is
turned before it falls; the reference is the same scene with one unbonded sphere.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import product, starmap
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from benchmarks.stone import SCENES
from common.scene import changed_scene
from common.scene_file import scene_tables
from dem.run.run import run_scene
from dem.stones import assembly
from dem.stones.library import packed_sphere
from dem.stones.packing import Packing

PAIRS = ("coal_plate", "gangue_plate", "coal_coal", "coal_gangue", "gangue_gangue")
COLUMNS = ["force", "time", "impulse", "plate_energy"]


LEAST_FORCE = 0.01  # of the peak: a contact lasts from where the force first passes it to where it last does


@dataclass(frozen=True)
class Case:
    """One row of the table."""

    subspheres: int
    material: str
    speed_m_s: float
    on_paper_plate: bool

    @property
    def name(self) -> str:
        """As on the command line."""
        return f"{self.subspheres}_{self.material}_{self.speed_m_s:g}_{'paper' if self.on_paper_plate else 'rigid'}"


CASES = {case.name: case for case in starmap(Case, product(
    (200, 500, 1000, 2000, 4000), ("coal", "gangue"), (0.3, 3.0, 10.0), (False, True)))}


def strike(case: Case, seed: int, agglomerate: dict[str, Any] | None) -> dict[str, float]:
    """Peak force, contact time, impulse and the plate's energy of one impact without friction, restitution 1."""
    changes: dict[str, Any] = {
        "time.gravity_m_s2": 0.0, "time.duration_s": 4.5e-4 * (3.0 / case.speed_m_s) ** 0.2, "output": None,
        "stones.seed": seed, "stones.speed_m_s": case.speed_m_s, "stones.gangue_ratio": float(case.material == "gangue"),
        "stones.agglomerate": agglomerate, **{f"contacts.{pair}": {"restitution": 1.0, "friction": 0.0} for pair in PAIRS}}
    if not case.on_paper_plate:
        changes["plate"] = scene_tables(SCENES / "hertz_coal.toml")["plate"]
    directory = Path(tempfile.mkdtemp())
    try:
        summary = run_scene(changed_scene(SCENES / "single.toml", changes), "single.toml", directory / "run")
        fast = pd.read_parquet(directory / "run" / "fast.parquet", columns=["t_s", "force_N"])
    finally:
        shutil.rmtree(directory)
    return {"force": summary["peak_force_N"], "time": contact_time_s(*fast[["t_s", "force_N"]].to_numpy().T),
            "impulse": summary["impulse_N_s"], "plate_energy": summary["energy"]["plate_work_J"]}


def contact_time_s(t_s: np.ndarray, force_N: np.ndarray) -> float:
    """How long a force is above LEAST_FORCE of its peak, with straight lines between its samples."""
    over = force_N - LEAST_FORCE * force_N.max()
    first, last = np.flatnonzero(over > 0)[[0, -1]]
    step = t_s[1] - t_s[0]
    began = t_s[first] - step * over[first] / (over[first] - over[first - 1]) if first else t_s[0]
    return t_s[last] + step * over[last] / (over[last] - over[last + 1]) - began


def strike_turned(case: Case, seed: int, turn: int) -> dict[str, float]:
    """Of packing `seed`, turned at random, but as it was packed at turn 0."""
    turned = Rotation.random(random_state=100 * seed + turn) if turn else Rotation.identity()

    def pack(*given: Any) -> Packing:
        packing = packed_sphere(*given)
        return replace(packing, center_m=turned.apply(packing.center_m))

    assembly._packed.cache_clear()  # it knows packings by their seed, and not how they are turned
    with patch.object(assembly, "packed_sphere", pack):
        return strike(case, seed, {"subspheres": case.subspheres, "unbreakable": True, "contact": "smooth"})


def measure(case: Case, packings: int, turns: int, jobs: int) -> pd.DataFrame:
    """A row a stone, in shares of the sphere's."""
    sphere = pd.Series(strike(case, 1, None)).replace(0, np.nan)
    stones = list(product(range(1, packings + 1), range(turns)))
    with ProcessPoolExecutor(jobs) as pool:
        found = pool.map(strike_turned, *zip(*((case, *stone) for stone in stones), strict=True))
        return pd.DataFrame([{"seed": seed, "turn": turn} | (pd.Series(one) / sphere).to_dict()
                             for (seed, turn), one in zip(stones, found, strict=True)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--packings", type=int, default=3)
    parser.add_argument("--turns", type=int, default=2)
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("runs/contact"))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    found = []
    print("| case | stones |", " | ".join(COLUMNS), "|")
    for name in args.cases:
        rows = measure(CASES[name], args.packings, args.turns, args.jobs)
        found.append(rows.assign(case=name))
        print("|", name, "|", len(rows), "|", *(f"{rows[c].mean():.4f} ± {rows[c].std():.4f} |" for c in COLUMNS),
              flush=True)
        pd.concat(found).to_csv(args.out / "contact.csv", index=False)


if __name__ == "__main__":
    main()
