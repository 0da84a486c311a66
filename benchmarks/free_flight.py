"""What bodies in free flight save, and what they change: the default scene beside brute force.

    python -m benchmarks.free_flight [--windows 0.04 0.6] [--seeds 1] [--first-seed SEED] [--brute-window S]
                                     [--brute-seeds N] [--out runs/accuracy]

Writes free_flight.csv, a row a window and seed: processor time of engine, plate and output over that of brute
force (packing and modes are in neither), errors of the largest total force and of the largest energy of the plate over
the window that brute force ran and over its second half, broken bonds of both in that window. Brute force of 0.6 s
takes about ten minutes a seed, and as much in each step, so `--brute-window` lets it run a shorter time, from which its
cost over the whole window follows; with `--brute-seeds` it runs for the first seeds only, and the mean of their costs
stands for the others.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import pandas as pd

from benchmarks.cost import cpu_s
from benchmarks.stone import SCENES
from common.scene import changed_scene, read_scene
from dem.run.prepare import prepare
from dem.run.run import run_prepared

PAPER = SCENES / "paper.toml"
STEP = 100  # from one seed to the next


def run(window_s: float, seed: int, tolerance: float, cache: Path) -> tuple[float, pd.DataFrame, pd.DataFrame]:
    """Processor time in s, fast stream, broken bonds."""
    changes = {"time.duration_s": window_s, "time.free_flight_tolerance": tolerance, "stones.seed": seed}
    model = prepare(changed_scene(PAPER, changes), str(PAPER), cache)
    with tempfile.TemporaryDirectory() as directory:
        out = Path(directory) / "run"
        cost = cpu_s(lambda: run_prepared(model, out))
        fast = pd.read_parquet(out / "fast.parquet", columns=["t_s", "force_N", "total_J"])
        return cost, fast, pd.read_parquet(out / "breakage.parquet", columns=["t_s"])


def compare(window_s: float, seed: int, tolerance: float, cache: Path, brute_s: float) -> dict[str, float]:
    """A row of the table; brute_s: what brute force runs of the window, 0 for nothing."""
    cost, fast, broken = run(window_s, seed, tolerance, cache)
    row = {"window_s": window_s, "seed": seed, "tolerance": tolerance, "cost_s": cost, "broken_bonds": len(broken)}
    if not brute_s:
        return row | {"cost_brute_s": float("nan")}
    brute_cost, brute, brute_broken = run(brute_s, seed, 0.0, cache)

    def error(name: str, start_s: float) -> float:
        expected, found = (table[name][(table["t_s"] >= start_s) & (table["t_s"] <= brute_s)].max()
                           for table in (brute, fast))
        return float(abs(found - expected) / expected) if expected else 0.0

    return row | {"brute_window_s": brute_s, "cost_brute_s": brute_cost * window_s / brute_s,
                  "peak_force_error": error("force_N", 0), "plate_energy_error": error("total_J", 0),
                  "late_peak_force_error": error("force_N", brute_s / 2),
                  "late_plate_energy_error": error("total_J", brute_s / 2),
                  "broken_in_brute_window": int((broken["t_s"] <= brute_s).sum()),
                  "broken_bonds_brute": len(brute_broken)}


def main() -> None:
    scene = read_scene(PAPER)
    options = _options(scene.stones.seed)
    options.out.mkdir(parents=True, exist_ok=True)
    rows: list[dict[str, float]] = []
    for window_s in options.windows:
        brute_s = options.brute_window or window_s
        for k in range(options.seeds):
            rows.append(compare(window_s, options.first_seed + STEP * k, scene.time.free_flight_tolerance,
                                options.out / ".modes", brute_s if k < options.brute_seeds else 0.0))
            table = _with_ratio(pd.DataFrame(rows))
            table.to_csv(options.out / "free_flight.csv", index=False, float_format="%.4g")
            print(table.tail(1).to_string(index=False, float_format=lambda x: f"{x:.3g}"), flush=True)


def _with_ratio(table: pd.DataFrame) -> pd.DataFrame:
    """With the cost over that of brute force, where that was not run over the mean of the seeds for which it was."""
    mean = table.groupby("window_s")["cost_brute_s"].transform("mean")
    return table.assign(cost_ratio=table["cost_s"] / table["cost_brute_s"].fillna(mean))


def _options(seed: int) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--windows", type=float, nargs="+", default=[0.04, 0.6])
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--first-seed", type=int, default=seed)
    parser.add_argument("--brute-window", type=float, help="s that brute force runs (default: the whole window)")
    parser.add_argument("--brute-seeds", type=int, default=10**6, help="seeds for which brute force runs (default: all)")
    parser.add_argument("--out", type=Path, default=Path("runs/accuracy"))
    return parser.parse_args()


if __name__ == "__main__":
    main()
