"""One bonded stone on a rigid plate, with any value of the scene changed: what the studies of bonds share."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import pandas as pd

from common.scene import changed_scene
from common.tables import read_toml
from dem.run.run import run_scene

SCENES = Path(__file__).resolve().parent.parent / "scenes"
SEEDS = (20011, 20021, 20023, 20029, 20047)


def strike(material: str, changes: dict, duration_s: float = 2.4e-3) -> dict:
    """Run scenes/single.toml on a rigid plate with dotted keys changed (None: left out); returns run.json with
    `broken_area_m2`."""
    scene = changed_scene(SCENES / "single.toml", {
        "plate": read_toml(SCENES / "hertz_coal.toml")["plate"], "output": None, "time.duration_s": duration_s,
        "stones.gangue_ratio": float(material == "gangue")} | changes)
    directory = Path(tempfile.mkdtemp())
    try:
        summary = run_scene(scene, "single.toml", directory / "run")
        summary["broken_area_m2"] = float(pd.read_parquet(directory / "run" / "breakage.parquet")["area_m2"].sum())
    finally:
        shutil.rmtree(directory)
    return summary
