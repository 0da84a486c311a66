"""Extreme scenes, alone and combined: each must finish with a closed ledger or be refused by the name of a limit.

Two bonded stones fall on the plate of scenes/paper.toml with fewer sub-spheres and modes, for 1.6 contact times of a
whole stone; every case changes one value to an extreme, or all of them at random (without what is always refused).
The cases of stability_scenes.py are scenes as users have them. The table counts outcomes; map.png shows them.
What ends in any other way fails: a hang, a ledger that does not close, a refusal that names no limit, a Python error.
"""

from __future__ import annotations

import json
import re
import signal
import tempfile
import time
import traceback
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from common.scene.file import scene_tables
from common.scene.scene import Scene, changed_scene
from common.tables import InputError
from dem.deck.time_step import step_limits, stone_contact_time_s, time_step
from dem.run.energy_balance import ENERGY_SHARE
from dem.run.run import RunError, run_scene
from dem.stones.arrangement import stones_of
from dem.stones.assembly import Assembly, assemble
from lab.accuracy.stability_map import draw
from lab.accuracy.stability_scenes import scene_cases
from lab.cost import used_s
from lab.rock.stone import SCENES
from lab.study import Row

PAPER = SCENES / "paper.toml"
HANG_s = 300        # of wall time; the longest case takes a twentieth of it on an idle machine
CONTACT_TIMES = 1.6  # of a whole stone, from the first touch
N_COMBINED = 95
SEED = 20011
GOOD = ("finished", "refused")
PAIRS = ("coal_plate", "gangue_plate", "coal_coal", "coal_gangue", "gangue_gangue")

LEVELS: dict[str, list] = {
    "stiffness": [0.01, 0.1, 1.0, 10.0, 100.0, 1000.0],   # of stones and bonds, times the paper's
    "speed_m_s": [0.01, 0.1, 1.0, 3.0, 10.0, 30.0, 100.0],
    "thickness_m": [0.001, 0.002, 0.005, 0.02, 0.05, 0.1],
    "rod_stiffness": [1e-6, 1e-3, 0.01, 0.1, 1.0, 100.0, 1e6],   # modulus, times steel's
    "density_kg_m3": [100.0, 300.0, 1000.0, 5000.0, 20000.0],
    "plate_density_kg_m3": [100.0, 1000.0, 7830.0, 20000.0],
    "restitution": [0.05, 0.051, 0.2, 0.5, 0.8, 1.0],
    "friction": [0.0, 0.1, 0.5, 1.0, 2.0],
    "strength": [0.0, 0.001, 0.1, 1.0, 100.0, "unbreakable"],  # times the paper's
    "bond_damping": [0.0, 0.05, 0.2, 0.5, 1.0],            # of the critical one
    "plate_damping": [0.0, 0.01, 0.2, 0.9, 0.999],
    "step_share": [0.1, 0.3, 0.6, 1.0, 1.1, 1.5],          # of the largest time step that the limits allow
    "co_step": [1, 2, 5, 10, 30, 100],
    "stones": [2, 3, 10, 30, 60],
    "subspheres": [1, 2, 3, 10, 60, 300, 1000],
    "place": ["ring", "edge", "corner", "rod", "near"],
    "start": ["falling", "resting"],
    "gangue_ratio": [0.0, 0.5, 1.0],
}
ALONE_ONLY = {"subspheres": [5000]}
# A scene refused for one value tells nothing about the others: what is always refused is left to the cases alone.
REFUSED_ALONE: dict[str, list] = {"strength": [0.0], "restitution": [0.05], "step_share": [1.1, 1.5], "co_step": [30, 100],
                 "rod_stiffness": [1e-6]}
# In combined cases a stone has few sub-spheres where there are many stones, so that a case takes a second or two.
PARTICLES_AT_MOST = 700


@dataclass
class Case:
    name: str
    settings: dict = field(default_factory=dict)
    file: str | None = None  # of a shipped scene, in which the settings are keys that are changed

    @property
    def kind(self) -> str:
        """`alone`, `rigid plate`, `combined`, or that of a shipped scene."""
        if self.file or self.name.startswith("combined"):
            return self.name.rsplit(" ", 1)[0]
        return "rigid plate" if "rigid" in self.settings else "alone"


def cases() -> list[Case]:
    alone = [Case(f"{key} {value}", {key: value}) for key, values in LEVELS.items()
             for value in [*values, *ALONE_ONLY.get(key, [])]]
    random = np.random.default_rng(SEED)
    levels = {key: [v for v in values if v not in REFUSED_ALONE.get(key, [])] for key, values in LEVELS.items()}
    combined = []
    for k in range(N_COMBINED):
        settings = {key: values[random.integers(len(values))] for key, values in levels.items()}
        while settings["stones"] * settings["subspheres"] > PARTICLES_AT_MOST:
            settings["subspheres"] = levels["subspheres"][random.integers(len(levels["subspheres"]))]
        combined.append(Case(f"combined {k + 1}", settings))
    rigid = [Case(f"rigid plate, {key} {value}", {"rigid": True, key: value})
             for key in ("speed_m_s", "stiffness", "bond_damping") for value in LEVELS[key]]
    return alone + rigid + combined + [Case(name, changes, file) for name, file, changes in scene_cases()]


def build(settings: dict) -> Scene:
    """The scene of a case. Raises InputError where the scene, or its time step or co-step, is refused."""
    s = {"stiffness": 1.0, "speed_m_s": 3.0, "stones": 2, "subspheres": 60, "gangue_ratio": 0.5, "place": "ring",
         "start": "falling"} | settings
    changes = _stones(s) | _materials(s) | _plate(s)
    changes |= {"time.view_interval_s": None, "time.duration_s": 1.0, "time.sample_interval_s": 1.0}
    contact = stone_contact_time_s(_assembled(changed_scene(PAPER, changes))[1])
    duration = CONTACT_TIMES * contact + changes["stones.gap_m"] / max(changes["stones.speed_m_s"], 1e-3)
    if s["start"] == "resting":
        duration = CONTACT_TIMES * contact
    changes |= {"time.duration_s": duration, "time.sample_interval_s": duration / 10}
    if "step_share" in s:
        scene, assembly = _assembled(changed_scene(PAPER, changes))
        step = time_step(scene, step_limits(scene, assembly, "scene"), "scene", 1.0)
        changes["time.time_step_s"] = s["step_share"] * min(step.limits_s.values())
    if "co_step" in s:
        changes["time.co_step"] = s["co_step"]
    return changed_scene(PAPER, changes)


def _assembled(scene: Scene) -> tuple[Scene, Assembly]:
    return scene, assemble(scene, stones_of(scene, "scene"))


def _stones(s: dict) -> dict:
    count = s["stones"]
    resting = s["start"] == "resting"
    speed = 0.0 if resting else s["speed_m_s"]
    # Whole stones, so that the ratio is one that they can give.
    n_gangue = round(s["gangue_ratio"] * count)
    changes = {
        "stones.count": count, "stones.positions_m": _places(s["place"], count),
        "stones.gangue_order": list(range(1, count + 1)), "stones.gangue_ratio": n_gangue / count,
        "stones.speed_m_s": speed, "stones.gap_m": 1e-7 if resting else 1e-6 * min(1.0, speed),
        "stones.agglomerate.subspheres": s["subspheres"],
        "stones.agglomerate.contact": "smooth" if s["subspheres"] >= 200 else "sub_spheres"}
    if s["subspheres"] == 1:
        return {key: v for key, v in changes.items() if "agglomerate" not in key} | {"stones.agglomerate": None}
    if s.get("strength") == "unbreakable":
        changes["stones.agglomerate.unbreakable"] = True
    if "bond_damping" in s:
        changes["stones.agglomerate.damping_ratio"] = s["bond_damping"]
    return changes


def _places(place: str, count: int) -> list[list[float]]:
    """The first stone where `place` says, the others on a square grid around the centre."""
    first = {"ring": (0.1, 0.0), "edge": (0.25, 0.0), "corner": (0.25, 0.25), "rod": (0.2, 0.2), "near": (0.0275, 0.0275)}
    axis = 0.055 * (np.arange(8) - 3.5)
    grid = sorted(((x, y) for x in axis for y in axis), key=lambda p: (round(np.hypot(*p), 9), p))
    chosen = [first[place]]
    for point in grid:
        if len(chosen) < count and all(np.hypot(point[0] - x, point[1] - y) >= 0.0501 for x, y in chosen):
            chosen.append(point)
    return [[float(x), float(y)] for x, y in chosen]


def _materials(s: dict) -> dict:
    materials = scene_tables(PAPER)["materials"]
    changes = {}
    for name, table in materials.items():
        bond = table["bond"]
        changes[f"materials.{name}.youngs_modulus_Pa"] = s["stiffness"] * table["youngs_modulus_Pa"]
        changes[f"materials.{name}.bond.youngs_modulus_Pa"] = s["stiffness"] * bond["youngs_modulus_Pa"]
        if "density_kg_m3" in s:
            changes[f"materials.{name}.density_kg_m3"] = s["density_kg_m3"]
        if isinstance(s.get("strength"), float):
            for key in ("tensile_strength_Pa", "shear_strength_Pa"):
                changes[f"materials.{name}.bond.{key}"] = s["strength"] * bond[key]
    for pair in PAIRS:
        for key in ("restitution", "friction"):
            if key in s:
                changes[f"contacts.{pair}.{key}"] = s[key]
    return changes


def _plate(s: dict) -> dict:
    if s.get("rigid"):
        return {"plate": scene_tables(SCENES / "hertz_coal.toml")["plate"]}
    changes: dict = {"plate.max_frequency_Hz": 2000.0, "plate.mesh_size_m": 0.12}
    for key, name in (("thickness_m", "thickness_m"), ("plate_density_kg_m3", "density_kg_m3"),
                      ("plate_damping", "damping_ratio")):
        if key in s:
            changes[f"plate.{name}"] = s[key]
    if s.get("thickness_m", 1.0) < 0.005:  # as many modes as in a thick one, or nearly
        changes["plate.max_frequency_Hz"] = 1000.0
    if "rod_stiffness" in s:
        rods = scene_tables(PAPER)["plate"]["rods"]
        changes["plate.rods"] = [rod | {"youngs_modulus_Pa": s["rod_stiffness"] * rod["youngs_modulus_Pa"]} for rod in rods]
    return changes


class Hang(Exception):
    pass


def _on_alarm(*_):
    raise Hang("still running after the time of a hang")


def run_case(case: Case, runs: Path, hang_s: int = HANG_s) -> dict:
    """One row of the table."""
    signal.signal(signal.SIGALRM, _on_alarm)
    signal.alarm(hang_s)
    start, used, closure, message = time.monotonic(), used_s(), float("nan"), ""
    try:
        scene = changed_scene(SCENES / case.file, case.settings) if case.file else build(case.settings)
        with tempfile.TemporaryDirectory(dir=runs) as directory:
            closure = run_scene(scene, case.name, Path(directory) / "run")["energy"]["closure"]
        outcome = "finished" if abs(closure) <= ENERGY_SHARE else "ledger open"
    except (InputError, RunError) as error:
        message = re.sub(r" \(what there is of the run is in .*\)$", "", str(error))
        outcome = "refused" if re.search(r"limit|must", message) else "refused without a limit"
    except Hang as error:
        outcome, message = "hang", str(error)
    except Exception:  # noqa: BLE001 - a case that ends in a Python error is a finding, and the others go on
        outcome, message = "error", traceback.format_exc().strip().replace("\n", " | ")[-400:]
    finally:
        signal.alarm(0)
    return {"kind": case.kind, "settings": json.dumps(case.settings), "outcome": outcome, "ledger_error": closure,
            "message": message, "wall_s": time.monotonic() - start, "processor_s": used_s() - used}


def stability(out: Path, only: str = "", share: float = 1.0, hang_s: int = HANG_s) -> Iterator[Row]:
    """only: cases whose name holds this text; share: of the cases of every kind, from the first."""
    runs = (out / ".runs").resolve()
    runs.mkdir(parents=True, exist_ok=True)
    for at, case in evenly(cases()):
        if only in case.name and at <= share:
            yield Row({"case": case.name}, partial(run_case, case, runs, hang_s))


def evenly(chosen: list[Case]) -> list[tuple[float, Case]]:
    """(share, case) in an order of which any beginning has the same share of every kind of case."""
    kinds: dict[str, list[Case]] = {}
    for case in chosen:
        kinds.setdefault(case.kind, []).append(case)
    shares = [((k + 1) / len(kind), case) for kind in kinds.values() for k, case in enumerate(kind)]
    return sorted(shares, key=lambda pair: pair[0])


def stability_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """Of each kind how many finished, were refused or failed, and the largest ledger error of those that finished."""
    draw(rows, LEVELS, out / "map.png")
    kinds = rows.assign(failed=~rows["outcome"].isin(GOOD), error=rows["ledger_error"].abs()).groupby("kind", sort=False)
    return kinds.agg(cases=("outcome", "size"), finished=("outcome", lambda one: int((one == GOOD[0]).sum())),
                     refused=("outcome", lambda one: int((one == GOOD[1]).sum())), failed=("failed", "sum"),
                     ledger_error=("error", "max"), wall_s=("wall_s", "max")).reset_index()


def stability_holds(rows: pd.DataFrame) -> bool:
    return bool(rows["outcome"].isin(GOOD).all())
