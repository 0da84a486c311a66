"""Writes impacts.parquet, the data set that the tests use, from a data set: python tests/recognition/data/make.py DIR.

DIR is what `make dataset` writes, or so much of it that it holds GROUPS and thin_plate. The file names the rock of its
scene, and tests compare that with today's; it must be made anew when rock, contact or engine change.
"""

import sys
from pathlib import Path

import pandas as pd

from common.scene.scene import read_scene
from lab.known_truth.stone_histories import rock_of
from recognition.evaluation import read_dataset

SCENE = Path(__file__).resolve().parents[3] / "scenes" / "paper.toml"
GROUPS = ("paper/000", "ring/000", "ring/001", "ring/002", "ring/003", "packing/001")

data = read_dataset(sys.argv[1])
today = read_scene(SCENE).model_dump(mode="json")
parts = []
for run, signals, row in zip(data.runs, data.signals, data.table.to_dict("records"), strict=True):
    if row["group"] in GROUPS or row["family"] == "thin_plate":
        scene = run.scene.as_json()
        assert scene["materials"] == today["materials"] and scene["contacts"] == today["contacts"], run.path
        sensors = signals[["t_s", "v_m_s", "a_m_s2", *(c for c in signals if c.startswith(("acc_", "rod_")))]].astype("float32")
        parts.append(sensors.assign(group=row["group"], gangue_ratio=row["gangue_ratio"], impulse_N_s=run.summary.impulse_N_s))
table = pd.concat(parts, ignore_index=True)
table.attrs["rock"] = rock_of(SCENE)
table.to_parquet(Path(__file__).with_name("impacts.parquet"), index=False, compression="zstd")
