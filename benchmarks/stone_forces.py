"""Forces of single stones, and the law of them that recognition/stream uses.

    python -m benchmarks.stone_forces [--out runs/stone_forces]

Runs scenes/single.toml 128 times (about half a minute of one core each): coal and gangue in turn, speeds 2 to 4 m/s,
places, and for half of the runs radii of 15 to 35 mm, else the paper's 25 mm. Runs that are there are kept. Then it
writes recognition/stream/stone_forces.json.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

import pandas as pd
from scipy.stats import qmc

from recognition.stream.forces import History, StoneForces
from recognition.stream.law_file import SHIPPED, save_forces

COUNT, FIRST_SEED = 128, 20011
DENSITY_kg_m3 = {False: 1380.0, True: 2400.0}


def cases() -> pd.DataFrame:
    """What is run: gangue, speed_m_s, radius_m, x_m, y_m."""
    u = qmc.Sobol(4, seed=7).random(COUNT)
    k = pd.Series(range(COUNT))
    speed, radius = 2 + 2 * u[:, 0], 0.015 + 0.02 * u[:, 1]
    table = pd.DataFrame({"gangue": k % 2 == 1, "speed_m_s": pd.Series(speed).where(k % 8 < 6, 3.0),
                         "radius_m": pd.Series(radius).where(k % 4 < 2, 0.025),
                         "x_m": -0.18 + 0.36 * u[:, 2], "y_m": -0.18 + 0.36 * u[:, 3]})
    return table.round({"speed_m_s": 4, "radius_m": 5, "x_m": 4, "y_m": 4})


def simulate(case: pd.Series, seed: int, out: Path) -> None:
    keys = {"stones.speed_m_s": case.speed_m_s, "stones.radius_m": case.radius_m, "stones.seed": seed,
            "stones.positions": f"[{{x_m={case.x_m:.4f},y_m={case.y_m:.4f}}}]"}
    settings = [word for key, value in keys.items() for word in ("--set", f"{key}={value}")]
    subprocess.run([sys.executable, "-m", "dem", "run", "scenes/single.toml", "--gangue", str(int(case.gangue)),
                    "--out", str(out), *settings], check=False)


def history_of(case: pd.Series, out: Path) -> History:
    force = pd.read_parquet(out / "fast.parquet", columns=["t_s", "force_01_N"])
    return History(force["force_01_N"].to_numpy()[1:], float(force["t_s"][1] - force["t_s"][0]), bool(case.gangue),
                   case.radius_m, DENSITY_kg_m3[bool(case.gangue)], case.speed_m_s)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("runs/stone_forces"))
    out = parser.parse_args().out
    histories = []
    for k, case in cases().iterrows():
        directory = out / f"s{k:03d}"
        if not directory.is_dir():
            simulate(case, FIRST_SEED + int(str(k)), directory)
        if directory.is_dir():  # a run that failed is passed over
            histories.append(history_of(case, directory))
    save_forces(StoneForces.fit(histories), SHIPPED)
    print(f"law of {len(histories)} stones written to {SHIPPED}")


if __name__ == "__main__":
    main()
