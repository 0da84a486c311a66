"""Forces of single stones, and the law of them that recognition/stream uses.

    python -m benchmarks.stone_forces [--out runs/stone_forces]

Runs scenes/single.toml 176 times (up to half a minute of one core each): coal and gangue in turn, speeds 2 to 4 m/s,
places, and radii of 15 to 35 mm or the paper's 25 mm. Runs that are there are kept. Then it
writes recognition/stream/stone_forces.json.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import qmc

from recognition.stream.forces import History, StoneForces
from recognition.stream.law_file import SHIPPED, save_forces

COUNT, FIRST_SEED, CORNERS = 128, 20011, 48
DENSITY_kg_m3 = {False: 1380.0, True: 2400.0}


def cases() -> pd.DataFrame:
    """What is run: gangue, speed_m_s, radius_m, x_m, y_m, duration_s, seed."""
    return pd.concat([_first(), _corners()], ignore_index=True)


def _corners() -> pd.DataFrame:
    """What `_first` leaves out, whose even and odd numbers lie in different halves of each range: fast coal and slow
    gangue of the paper's size, small coal and large gangue."""
    rng, rows = np.random.default_rng(11), []
    for k in range(CORNERS):
        gangue, speed, radius = k % 2 == 1, 0.0, 0.025
        speed = rng.uniform(2, 3) if gangue else rng.uniform(3, 4)
        if k // 2 % 3 == 2:
            radius = rng.uniform(0.025, 0.035) if gangue else rng.uniform(0.015, 0.025)
            speed = rng.uniform(2, 4)
        x_m, y_m = rng.uniform(-0.18, 0.18, 2)
        rows.append((gangue, speed, radius, x_m, y_m, 1e-3, 40011 + k))
    names = ["gangue", "speed_m_s", "radius_m", "x_m", "y_m", "duration_s", "seed"]
    return pd.DataFrame(rows, columns=names).round({"speed_m_s": 4, "radius_m": 5, "x_m": 4, "y_m": 4})


def _first() -> pd.DataFrame:
    u = qmc.Sobol(4, seed=7).random(COUNT)
    k = pd.Series(range(COUNT))
    speed, radius = 2 + 2 * u[:, 0], 0.015 + 0.02 * u[:, 1]
    table = pd.DataFrame({"gangue": k % 2 == 1, "speed_m_s": pd.Series(speed).where(k % 8 < 6, 3.0),
                         "radius_m": pd.Series(radius).where(k % 4 < 2, 0.025),
                         "x_m": -0.18 + 0.36 * u[:, 2], "y_m": -0.18 + 0.36 * u[:, 3], "duration_s": 6e-3,
                         "seed": FIRST_SEED + k})
    return table.round({"speed_m_s": 4, "radius_m": 5, "x_m": 4, "y_m": 4})


def simulate(case: pd.Series, out: Path) -> None:
    keys = {"stones.speed_m_s": case.speed_m_s, "stones.radius_m": case.radius_m, "stones.seed": case.seed,
            "time.duration_s": case.duration_s,
            "stones.positions": f"[{{x_m={case.x_m:.4f},y_m={case.y_m:.4f}}}]"}
    settings = [word for key, value in keys.items() for word in ("--set", f"{key}={value}")]
    subprocess.run([sys.executable, "-m", "dem", "run", "scenes/single.toml", "--gangue", str(int(case.gangue)),
                    "--out", str(out), *settings], check=False)


def history_of(case: pd.Series, out: Path) -> History:
    force = pd.read_parquet(out / "fast.parquet", columns=["t_s", "force_01_N"])
    return History(force["force_01_N"].to_numpy()[1:], float(force["t_s"][1] - force["t_s"][0]), bool(case.gangue),
                   case.radius_m, DENSITY_kg_m3[bool(case.gangue)], case.speed_m_s)


def main() -> None:
    out = _out()
    save_forces(StoneForces.fit(histories := histories_in(out)), SHIPPED)
    print(f"law of {len(histories)} stones written to {SHIPPED}")


def histories_in(out: Path) -> list[History]:
    """Of all cases; what is missing in a directory is run. A run that failed is passed over."""
    histories = []
    for k, case in cases().iterrows():
        directory = out / f"s{k:03d}"
        if not directory.is_dir():
            simulate(case, directory)
        if directory.is_dir():
            histories.append(history_of(case, directory))
    return histories


def _out() -> Path:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("runs/stone_forces"))
    out: Path = parser.parse_args().out
    return out


if __name__ == "__main__":
    main()
