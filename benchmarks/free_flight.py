"""What bodies in free flight save, and what they change: the default scene beside brute force.

    python -m benchmarks.free_flight [--windows 0.04 0.6] [--seeds 1] [--out runs/accuracy]

Writes free_flight.csv, a row a window and seed: processor time of engine, plate and output over that of brute
force (packing and modes are in neither), errors of the largest total force and of the largest energy of the plate over
the window and over its second half, broken bonds of both. Brute force of 0.6 s takes about ten minutes a seed.
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


def run(window_s: float, seed: int, tolerance: float, cache: Path) -> tuple[float, int, pd.DataFrame]:
    """Processor time in s, broken bonds, fast stream."""
    changes = {"time.duration_s": window_s, "time.free_flight_tolerance": tolerance, "stones.seed": seed}
    model = prepare(changed_scene(PAPER, changes), str(PAPER), cache)
    with tempfile.TemporaryDirectory() as directory:
        out, broken = Path(directory) / "run", []
        cost = cpu_s(lambda: broken.append(run_prepared(model, out)["n_bonds_broken"]))
        return cost, broken[0], pd.read_parquet(out / "fast.parquet", columns=["t_s", "force_N", "total_J"])


def compare(window_s: float, seed: int, tolerance: float, cache: Path) -> dict[str, float]:
    cost, broken, default = run(window_s, seed, tolerance, cache)
    brute_cost, brute_broken, brute = run(window_s, seed, 0.0, cache)

    def error(name: str, start_s: float) -> float:
        expected = brute[name][brute["t_s"] >= start_s].max()
        return float(abs(default[name][default["t_s"] >= start_s].max() - expected) / expected) if expected else 0.0

    return {"window_s": window_s, "seed": seed, "tolerance": tolerance, "cost_ratio": cost / brute_cost,
            "cost_s": cost, "cost_brute_s": brute_cost,
            "peak_force_error": error("force_N", 0), "plate_energy_error": error("total_J", 0),
            "late_peak_force_error": error("force_N", window_s / 2),
            "late_plate_energy_error": error("total_J", window_s / 2),
            "broken_bonds": broken, "broken_bonds_brute": brute_broken}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--windows", type=float, nargs="+", default=[0.04, 0.6])
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("runs/accuracy"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    scene = read_scene(PAPER)
    rows = []
    for window_s in options.windows:
        for k in range(options.seeds):
            rows.append(compare(window_s, scene.stones.seed + 100 * k, scene.time.free_flight_tolerance,
                                options.out / ".modes"))
            pd.DataFrame(rows).to_csv(options.out / "free_flight.csv", index=False, float_format="%.4g")
    print(pd.DataFrame(rows).to_string(index=False, float_format=lambda x: f"{x:.3g}"))


if __name__ == "__main__":
    main()
