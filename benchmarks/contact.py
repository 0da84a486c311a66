"""Unbreakable stones with the smooth contact beside the elastic sphere that they stand for (docs/contact.md).

    python -m benchmarks.contact [--packings 6] [--turns 6] [--cases NAME ...] [--out runs/contact]

Writes contact.csv, a row a stone, and prints mean and scatter of each case: peak force, contact time and impulse over
those of the sphere, on the plate of the paper also the energy that the plate got. The stone's packing is turned before
it falls; the reference is the same scene with one unbonded sphere.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from dataclasses import dataclass, replace
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
from dem.stones.packing import Packing, pack_sphere

PAIRS = ("coal_plate", "gangue_plate", "coal_coal", "coal_gangue", "gangue_gangue")
COLUMNS = ["force", "time", "impulse", "plate_energy"]


@dataclass(frozen=True)
class Case:
    """`fewer`: a divisor of packings and turns where a stone is dear."""

    subspheres: int
    material: str = "coal"
    speed_m_s: float = 3.0
    on_paper_plate: bool = False
    fewer: int = 1


CASES = {
    "200": Case(200), "500": Case(500), "1000": Case(1000), "2000": Case(2000, fewer=2), "4000": Case(4000, fewer=6),
    "gangue": Case(500, "gangue", fewer=2), "0.3": Case(500, speed_m_s=0.3, fewer=2),
    "1": Case(500, speed_m_s=1.0, fewer=2), "10": Case(500, speed_m_s=10.0, fewer=2),
    "plate": Case(500, on_paper_plate=True, fewer=2), "plate_gangue": Case(500, "gangue", 3.0, True, fewer=3),
}


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
    pressing = fast["t_s"][fast["force_N"] > 1e-3 * fast["force_N"].max()]
    return {"force": summary["peak_force_N"], "time": float(pressing.max() - pressing.min()),
            "impulse": summary["impulse_N_s"], "plate_energy": summary["energy"]["plate_work_J"]}


def measure(case: Case, packings: int, turns: int) -> pd.DataFrame:
    """A row a stone, in shares of the sphere's."""
    sphere = pd.Series(strike(case, 1, None))
    rows = []
    for seed in range(1, max(1, packings // case.fewer) + 1):
        for turn in range(max(1, turns // case.fewer)):
            turned = Rotation.random(random_state=100 * seed + turn) if turn else Rotation.identity()

            def pack(*given: Any, turned: Rotation = turned, **more: Any) -> Packing:
                packing = pack_sphere(*given, **more)
                return replace(packing, center_m=turned.apply(packing.center_m))

            with patch.object(assembly, "pack_sphere", pack):
                stone = strike(case, seed, {"subspheres": case.subspheres, "unbreakable": True, "contact": "smooth"})
            rows.append({"seed": seed, "turn": turn} | (pd.Series(stone) / sphere.replace(0, np.nan)).to_dict())
    return pd.DataFrame(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--packings", type=int, default=6)
    parser.add_argument("--turns", type=int, default=6)
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--out", type=Path, default=Path("runs/contact"))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    found = []
    for name in args.cases:
        rows = measure(CASES[name], args.packings, args.turns)
        found.append(rows.assign(case=name))
        print(name, len(rows), *(f"{c} {rows[c].mean():.4f} +- {rows[c].std():.4f}" for c in COLUMNS), flush=True)
        pd.concat(found).to_csv(args.out / "contact.csv", index=False)


if __name__ == "__main__":
    main()
