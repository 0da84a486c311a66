"""What a data logger would have of a simulated stream: its accelerometers with noise, and taps on its plate.

    python -m benchmarks.measured RUN SCENE OUT

Writes OUT/record.parquet (RUN's fast stream at 40 kHz, noise 20 dB below each channel), OUT/taps.toml with four taps and
their records, simulated on the plate of SCENE, and OUT/thought.toml, the scene with a plate that is 1 % thinner: what is
known of the plate before it is tapped.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.records import Record
from analysis.resample import resample
from common.plate import FlexiblePlate, read_plate
from recognition.evaluation.tap_records import hammer_taps
from recognition.plate.plate_model import PlateModel

RATE_Hz, NOISE_dB, TAPS, HIGHEST_Hz = 40e3, 20.0, 4, 20e3
THINNER = 0.99


def record(run: Path, rng: np.random.Generator) -> pd.DataFrame:
    fast = pd.read_parquet(run / "fast.parquet")
    t_s = fast["t_s"].to_numpy()
    fine_Hz = round(1 / float(t_s[1] - t_s[0]))
    table = {}
    for name in (str(c) for c in fast if str(c).startswith("acc_")):
        values = resample(Record(fast[name].to_numpy(dtype=float), fine_Hz, name=name), RATE_Hz).values
        noise = 10 ** (-NOISE_dB / 20) * values.std()
        table[name] = values + noise * rng.standard_normal(len(values))
    return pd.DataFrame({"t_s": t_s[0] + np.arange(len(values)) / RATE_Hz, **table})


def write_taps(scene: Path, out: Path, rng: np.random.Generator) -> None:
    plate = PlateModel.from_scene(scene, HIGHEST_Hz)
    half = 0.9 * np.array([plate.lines_x_m[-1], plate.lines_y_m[-1]])
    lines = []
    for k, tap in enumerate(hammer_taps(plate, rng.uniform(-half, half, (TAPS, 2)), rng, rate_Hz=RATE_Hz,
                                        place_error_m=1e-3), 1):
        assert tap.force_N is not None
        columns = {f"acc_{name}_m_s2": row for name, row in zip(plate.sensor_names, tap.acceleration, strict=True)}
        table = pd.DataFrame({"t_s": np.arange(len(tap.force_N)) / RATE_Hz, **columns, "force_N": tap.force_N})
        table.to_parquet(out / f"tap_{k}.parquet", index=False)
        lines.append(f'[[taps]]\nrecord = "tap_{k}.parquet"\nx_m = {tap.place_m[0]:.4f}\ny_m = {tap.place_m[1]:.4f}\n')
    (out / "taps.toml").write_text("\n".join(lines))


def main(run: Path, scene: Path, out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(1)
    record(run, rng).to_parquet(out / "record.parquet", index=False)
    write_taps(scene, out, rng)
    plate = read_plate(scene)
    assert isinstance(plate, FlexiblePlate)
    (out / "thought.toml").write_text(f'base = "{scene.resolve()}"\nplate.thickness_m = {THINNER * plate.thickness_m:g}\n')


if __name__ == "__main__":
    main(*(Path(word) for word in sys.argv[1:4]))
