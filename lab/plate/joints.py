"""The paper's eleven ratios with the joints of rods, and with rods that are rigidly tied to their disc: what moves.

Differences over the first 40 ms, with the joints less without them: of peaks, and of signals as the norm of the
difference over the norm without joints. Accelerometers and rods are the worst of four.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pandas as pd

from common.scene.plate import FlexiblePlate, Rod
from common.scene.scene import changed_scene
from dem.run.prepare import PreparedRun, prepare
from dem.run.run import run_prepared
from dem.stones.arrangement import stones_of
from dem.stones.stone import places_m
from lab.rock.stone import SCENES
from lab.study import Row
from plate_fem.elements.rods import LEAST_COMPLIANCE, Joint
from plate_fem.modes import PlateModes, modes_for_loads

GROUPS = {"accelerometer": "acc_", "rod": "rod_"}


def rigid(plate: FlexiblePlate, rod: Rod, theory: str) -> Joint:
    """As a joint that is as good as rigid."""
    a = rod.diameter_m / 2
    least = LEAST_COMPLIANCE / (plate.youngs_modulus_Pa * a)
    return Joint(0.0, 0.0, 0.0, (0.0, 0.0), least, np.diag([least, least / a**2]))


def joints(out: Path, duration_s: float = 0.04) -> Iterator[Row]:
    """A row a ratio."""
    for ratio in np.arange(11) / 10:
        yield Row({"gangue_ratio": float(ratio)}, partial(_moved, out, float(ratio), duration_s))


def _moved(out: Path, ratio: float, duration_s: float) -> dict[str, float]:
    scene = changed_scene(SCENES / "paper.toml", {"stones.gangue_ratio": ratio, "time.duration_s": duration_s,
                                                  "time.view_interval_s": None})
    model = prepare(scene, "paper.toml", out / ".modes")
    assert isinstance(scene.plate, FlexiblePlate) and model.modes is not None
    with patch("plate_fem.elements.rods.joint_of", rigid):
        tied = modes_for_loads(scene.plate, out / ".tied", places_m(stones_of(scene, "paper.toml")))
    after, before = (_signals(model, modes) for modes in (model.modes, tied))
    found: dict[str, float] = {}
    for name, start in {"force": "force_N", "plate_velocity": "v_m_s", **GROUPS}.items():
        columns = [column for column in before if str(column).startswith(start)]
        a, b = (table[columns].to_numpy() for table in (before, after))
        found[f"{name}_peak_percent"] = 100 * max(abs(b).max(axis=0) / abs(a).max(axis=0) - 1, key=abs)
        found[f"{name}_percent"] = 100 * max(np.linalg.norm(b - a, axis=0) / np.linalg.norm(a, axis=0))
    found["energy_percent"] = 100 * (after["total_J"].max() / before["total_J"].max() - 1)
    return found


def _signals(model: PreparedRun, modes: PlateModes) -> pd.DataFrame:
    with tempfile.TemporaryDirectory() as directory:
        run_prepared(replace(model, modes=modes), Path(directory) / "run")
        return pd.read_parquet(Path(directory) / "run" / "fast.parquet")
