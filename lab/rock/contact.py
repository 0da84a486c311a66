"""Unbreakable stones with the smooth contact beside the elastic sphere that they stand for (docs/contact.md).

A case is a number of sub-spheres, a material, a speed in m/s and a plate, as 500_coal_3_rigid or 200_gangue_0.3_paper.
Peak force, contact time and impulse over those of the sphere, on the plate of the paper also the energy that the plate
got. The stone's packing is turned before it falls; the reference is the same scene with one unbonded sphere.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import product, starmap
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from common.scene.scene import changed_scene
from dem.run.run import run_scene
from dem.stones import assembly
from dem.stones.packing import Packing, packed
from lab.rock.stone import PAIRS, RIGID, SCENES
from lab.study import Row

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
        "time.gravity_m_s2": 0.0, "time.duration_s": 4.5e-4 * (3.0 / case.speed_m_s) ** 0.2, "time.view_interval_s": None,
        "stones.seed": seed, "stones.speed_m_s": case.speed_m_s, "stones.gangue_ratio": float(case.material == "gangue"),
        "stones.agglomerate": agglomerate, **{f"contacts.{pair}": {"restitution": 1.0, "friction": 0.0} for pair in PAIRS}}
    if not case.on_paper_plate:
        changes["plate"] = RIGID
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
        packing = packed(*given)
        return replace(packing, center_m=turned.apply(packing.center_m))

    assembly._packed.cache_clear()  # it knows packings by their seed, and not how they are turned
    with patch.object(assembly, "packed", pack):
        return strike(case, seed, {"subspheres": case.subspheres, "unbreakable": True, "contact": "smooth"})


@cache
def sphere(case: Case) -> dict[str, float]:
    """The reference."""
    return strike(case, 1, None)


def contact(out: Path, packings: int = 3, turns: int = 2, cases: tuple[str, ...] = tuple(CASES)) -> Iterator[Row]:
    """Stones of several packings, each in several orientations, in shares of the sphere's."""
    for name in cases:
        for seed, turn in product(range(1, packings + 1), range(turns)):
            def shares(case: Case = CASES[name], seed: int = seed, turn: int = turn) -> dict[str, float]:
                found, whole = strike_turned(case, seed, turn), sphere(case)
                return {key: found[key] / whole[key] if whole[key] else np.nan for key in COLUMNS}
            yield Row({"case": name, "seed": seed, "turn": turn}, shares)


def contact_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """Mean and standard deviation over the stones."""
    groups = rows.groupby("case", sort=False)
    table = groups.size().rename("stones").to_frame()
    for key in COLUMNS:
        table[key], table[f"{key}_sd"] = groups[key].mean(), groups[key].std()
    cases = [CASES[name] for name in table.index]
    told = {"plate": ["paper" if case.on_paper_plate else "rigid" for case in cases],
            **{key: [getattr(case, key) for case in cases] for key in ("material", "speed_m_s", "subspheres")}}
    return pd.concat([pd.DataFrame(told), table.reset_index(drop=True)], axis=1)
