"""Makes recognition/evaluation/data/force_pulses.npz: the force of single stones on the plate, from simulations.

    python benchmarks/pulse_library.py DIRECTORY

Runs scenes/single.toml for both rocks, five radii and three speeds, keeps the runs in DIRECTORY, passes over those that
are there, and stores each force over its first 2.5 ms as means over 10 us.
"""

import itertools
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd

RADII_m, SPEEDS_m_s, SEEDS = (0.015, 0.02, 0.025, 0.03, 0.035), (2.0, 3.0, 4.0), (20011,)
STEP_s, DURATION_s = 1e-5, 2.5e-3
OUT = Path(__file__).parents[1] / "recognition/evaluation/data/force_pulses.npz"


def simulate(out: Path, gangue: int, radius_m: float, speed_m_s: float, seed: int) -> None:
    keys = {"time.duration_s": 3e-3, "stones.radius_m": radius_m, "stones.speed_m_s": speed_m_s, "stones.seed": seed}
    settings = [word for key, value in keys.items() for word in ("--set", f"{key}={value}")]
    subprocess.run([sys.executable, "-m", "dem", "run", "scenes/single.toml", "--gangue", str(gangue), *settings,
                    "--out", str(out)], check=True, stdout=subprocess.DEVNULL)


def pulse(out: Path) -> np.ndarray:
    """Means of the force over STEP_s (n,), of a stream that holds means over its own interval."""
    fast = pd.read_parquet(out / "fast.parquet")
    edges = np.arange(round(DURATION_s / STEP_s) + 1) * STEP_s
    t_s = fast["t_s"].to_numpy()
    impulse = np.concatenate([[0.0], np.cumsum(fast["force_01_N"].to_numpy()[1:] * np.diff(t_s))])
    return np.diff(np.interp(edges, t_s, impulse)) / STEP_s


def main(directory: Path) -> None:
    cases = list(itertools.product(SEEDS, (0, 1), SPEEDS_m_s, RADII_m))
    rows = []
    for seed, gangue, speed, radius in cases:
        out = directory / f"gangue{gangue}_{1000 * radius:.0f}mm_{speed:.0f}m_s_{seed}"
        if not (out / "fast.parquet").exists():
            simulate(out, gangue, radius, speed, seed)
        rows.append(pulse(out))
    table = np.array(cases)
    np.savez_compressed(OUT, force_N=np.array(rows).astype(np.float32), step_s=STEP_s, gangue=table[:, 1].astype(bool),
                        speed_m_s=table[:, 2], radius_m=table[:, 3], seed=table[:, 0].astype(int))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
