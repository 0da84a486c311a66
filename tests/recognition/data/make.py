"""Writes impacts.parquet, the data set that the tests use, from runs/dataset: python tests/recognition/data/make.py DIR."""

import sys
from pathlib import Path

import pandas as pd

from recognition.evaluation.dataset import read_dataset

GROUPS = ("paper/000", "ring/000", "ring/001", "ring/002", "ring/003", "packing/001")

data = read_dataset(sys.argv[1])
parts = []
for run, signals, row in zip(data.runs, data.signals, data.table.to_dict("records"), strict=True):
    if row["group"] in GROUPS or row["family"] == "thin_plate":
        sensors = signals[["t_s", "v_m_s", "a_m_s2", *(c for c in signals if c.startswith(("acc_", "rod_")))]].astype("float32")
        parts.append(sensors.assign(group=row["group"], gangue_ratio=row["gangue_ratio"], impulse_N_s=run.info["impulse_N_s"]))
pd.concat(parts).to_parquet(Path(__file__).with_name("impacts.parquet"), index=False, compression="zstd")
