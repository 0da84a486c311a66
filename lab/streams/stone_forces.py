"""Forces of single stones on the plate, and the law of them by which `listen` tells coal from gangue: `make forces`.

Runs scenes/single.toml for each stone of the sets, then writes lab/known_truth/data/stone_histories.npz (all histories;
those of sets that are not named stay as they are) and recognition/stone_forces/stone_forces.json (the law, from those of the set
"learnt"): 364 runs of three to five seconds of processor time each. Runs of the same engine and scene that are there are
kept.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import qmc

from common.scene.scene import read_scene
from dem.__main__ import main as dem
from dem.coupling.launch import ENGINE
from gangue.learn_forces import alone, history_of
from lab.known_truth.stone_histories import SETS, histories, rock_of, stored_rock, write_histories
from lab.rock.stone import SCENES
from lab.study import Row
from recognition.stone_forces.forces import SHIPPED, History, StoneForces, save_forces

SCENE = SCENES / "single.toml"
#: Of each set: seed of its random numbers, and how many stones of the paper's size and of any. Seed 2 was that of a
#: held-out set that was looked at five times.
PLAN = {"learnt": (0, 28, 20), "tried": (1, 20, 12), "other_rock": (3, 12, 0), "held_out": (4, 24, 44),
        "one_fall": (5, 0, 44)}
STRATIFIED = {"any_fall": (6, 160)}  # seed, and how many stones of any size and speed
DRAWN = 88  # of each set, half of them of the paper's size
FALL_m_s = 3.0  # of all stones of the set "one_fall"
PAPER_m, RADII_m, SPEEDS_m_s, REACH_m = 0.025, (0.015, 0.035), (2.0, 4.0), 0.18
OTHER_STRENGTH = (0.75, 1.25)  # of the bonds of the set "other_rock", relative


def cases(name: str) -> pd.DataFrame:
    """What is run of one of SETS: set, gangue, speed_m_s, radius_m, x_m, y_m, seed, strength (relative)."""
    digits = {"speed_m_s": 4, "radius_m": 5, "x_m": 4, "y_m": 4}
    table = _stratified(name) if name in STRATIFIED else _drawn(name)
    return table.round(digits).reset_index(drop=True)


def _stratified(name: str) -> pd.DataFrame:
    """Stones of any size and speed. Those of each material are a Latin hypercube, so that few have the distribution of
    many: what is drawn by chance leaves 80 stones with a tenth too few fast ones now and then."""
    seed, count = STRATIFIED[name]
    limits = [SPEEDS_m_s, RADII_m, (-REACH_m, REACH_m), (-REACH_m, REACH_m)]
    low, high = np.transpose(limits)
    parts = []
    for gangue in (False, True):
        points = qmc.LatinHypercube(len(limits), optimization="random-cd", seed=100 * seed + gangue).random(count // 2)
        part = pd.DataFrame(qmc.scale(points, low, high), columns=["speed_m_s", "radius_m", "x_m", "y_m"])
        parts.append(part.assign(set=name, gangue=gangue))
    return pd.concat(parts, ignore_index=True).assign(seed=30011 + 1000 * seed + np.arange(count), strength=1.0)


def _drawn(name: str) -> pd.DataFrame:
    seed, paper, any_size = PLAN[name]
    rng, n = np.random.default_rng([18, seed]), DRAWN
    radius = np.where(np.arange(n) < n // 2, PAPER_m, rng.uniform(*RADII_m, n))
    table = pd.DataFrame({"set": name, "gangue": np.arange(n) % 2 == 1, "speed_m_s": rng.uniform(*SPEEDS_m_s, n),
                          "radius_m": radius, "x_m": rng.uniform(-REACH_m, REACH_m, n),
                          "y_m": rng.uniform(-REACH_m, REACH_m, n), "seed": 30011 + 1000 * seed + np.arange(n),
                          "strength": 1.0})
    if name == "other_rock":
        table["strength"] = np.array(OTHER_STRENGTH)[np.arange(n) // 2 % 2]
    if name == "one_fall":
        table["speed_m_s"] = FALL_m_s
    chosen = np.r_[:paper, n // 2:n // 2 + any_size]
    return table.take(chosen)


def simulate(case: pd.Series, out: Path) -> None:
    keys = alone(bool(case.gangue), int(case.seed), case.radius_m, case.speed_m_s, case.x_m, case.y_m)
    rock = "gangue" if case.gangue else "coal"
    if case.strength != 1:
        for key, value in bond_strengths(rock).items():
            keys[f"materials.{rock}.bond.{key}"] = case.strength * value
    settings = [word for key, value in keys.items() for word in ("--set", key + "=" + json.dumps(value).replace(": ", "= "))]
    dem(["run", str(SCENE), "--out", str(out), *settings])


def bond_strengths(rock: str) -> dict[str, float]:
    bond = read_scene(SCENE).materials[rock].bond
    return {key: getattr(bond, key) for key in ("tensile_strength_Pa", "shear_strength_Pa")}


def _key(table: pd.DataFrame) -> str:
    """Of the runs of some cases by one engine and one scene."""
    made_by = [ENGINE.read_bytes(), read_scene(SCENE).model_dump_json().encode(), table.to_csv().encode()]
    return hashlib.sha256(b"".join(made_by)).hexdigest()[:12]


def stone_forces(out: Path, sets: tuple[str, ...] = SETS) -> Iterator[Row]:
    """A stone a row."""
    for name in sets:
        for k, (_, case) in enumerate(cases(name).iterrows()):
            yield Row({"set": name, "stone": k}, partial(simulated, case, directory_of(name, k, out)))


def directory_of(name: str, stone: int, out: Path) -> Path:
    return out / _key(cases(name)) / f"s{stone:03d}"


def simulated(case: pd.Series, directory: Path) -> dict[str, object]:
    """What is missing in a directory is run; a run that failed is told, and passed over."""
    if not (directory / "fast.parquet").is_file():
        simulate(case, directory)
    return {"gangue": bool(case.gangue), "failed": not (directory / "fast.parquet").is_file(), "directory": str(directory)}


def stone_forces_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """Writes histories and law. ValueError where stored stones of a set that was not run are of another rock."""
    found = {name: [history_of(Path(row["directory"])) for _, row in rows[(rows["set"] == name) & ~rows["failed"]].iterrows()]
             if name in set(rows["set"]) else kept(name) for name in SETS}
    write_histories([h for stones in found.values() for h in stones],
                    [name for name, stones in found.items() for _ in stones], rock_of(SCENE))
    save_forces(StoneForces.fit(histories("learnt")), SHIPPED)
    return pd.DataFrame([{"set": name, "stones": len(stones), "gangue": sum(h.gangue for h in stones)}
                         for name, stones in found.items()])


def kept(name: str) -> list[History]:
    """The stored stones of a set that is not run. ValueError where they are of another rock than the scene's."""
    if stored_rock() != rock_of(SCENE):
        raise ValueError(f"the stored stones of {name!r} are of another rock than {SCENE}: all sets must be run")
    return histories(name)
