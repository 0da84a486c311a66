"""What breaks of one stone on a rigid plate against the number of its sub-spheres.

    python -m benchmarks.breakage_size [--packings 24] [--speeds 3 6] [--counts 500 1000 2000] [--out runs/calibration]

Bonds are those of scenes/single.toml. Writes size_independence.csv, a row a run: share of the bonds that broke, broken area,
mass of the largest fragment over that of the stone, and the energy that broken bonds held. Breakage that comes after 0.9
ms is left out. Prints mean and standard error, and of the broken area the exponent of its growth with the count.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.stone import strike

COUNTS = (500, 1000, 2000)
FIRST_SEED = 40011
DURATION_s = 9e-4
FOUND = ["broken_share", "broken_area_cm2", "largest_fragment", "released_mJ"]


def impact(material: str, count: int, seed: int, speed_m_s: float) -> dict:
    """One run; returns its row of the table."""
    summary = strike(material, {"stones.agglomerate.subspheres": count, "stones.seed": seed,
                                "stones.speed_m_s": speed_m_s, "stones.agglomerate.contact": "smooth"}, DURATION_s)
    return {"material": material, "speed_m_s": speed_m_s, "subspheres": count, "seed": seed,
            "broken_bonds": summary["n_bonds_broken"],
            "broken_share": float(summary["stone"].broken.mean()), "peak_force_N": summary["peak_force_N"],
            "broken_area_cm2": 1e4 * summary["broken_area_m2"], "largest_fragment": summary["largest_fragment"],
            "released_mJ": 1e3 * summary["energy"]["released_by_breakage_J"]}


def table(rows: list[dict]) -> pd.DataFrame:
    """Mean and standard error over the packings."""
    groups = pd.DataFrame(rows).groupby(["material", "speed_m_s", "subspheres"])[FOUND]
    return groups.agg(["mean", "sem", "count"])


def exponent(rows: list[dict], draws: int = 1000) -> pd.DataFrame:
    """Of the broken area ~ count^exponent, by least squares of the logarithms of its means, with the standard error of
    redrawn packings; of each material and speed where something breaks at every count."""
    found = []
    for (material, speed), of_speed in pd.DataFrame(rows).groupby(["material", "speed_m_s"]):
        area = of_speed.pivot(index="seed", columns="subspheres", values="broken_area_cm2")
        if area.shape[1] < 2 or (area.mean() == 0).any():
            continue
        size = np.log(area.columns.to_numpy(dtype=float))
        drawn = [np.polyfit(size, np.log(area.sample(frac=1, replace=True, random_state=k).mean()), 1)[0]
                 for k in range(draws)]
        found.append({"material": material, "speed_m_s": speed, "exponent": np.polyfit(size, np.log(area.mean()), 1)[0],
                      "error": np.std(drawn)})
    return pd.DataFrame(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--packings", type=int, default=24)
    parser.add_argument("--speeds", type=float, nargs="+", default=[3.0, 6.0])
    parser.add_argument("--materials", nargs="+", default=["coal", "gangue"])
    parser.add_argument("--counts", type=int, nargs="+", default=list(COUNTS))
    parser.add_argument("--out", type=Path, default=Path("runs/calibration"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rows: list[dict] = []
    for k in range(options.packings):
        rows += [impact(material, count, FIRST_SEED + 10 * k, speed)
                 for material in options.materials for speed in options.speeds for count in options.counts]
        pd.DataFrame(rows).to_csv(options.out / "size_independence.csv", index=False)
    print(table(rows).to_string(float_format=lambda x: f"{x:.3g}"))
    print(exponent(rows).to_string(index=False, float_format=lambda x: f"{x:.3g}"))


if __name__ == "__main__":
    main()
