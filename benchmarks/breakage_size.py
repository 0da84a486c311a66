"""Broken area of one stone on a rigid plate at 3 m/s against the number of its sub-spheres.

    python -m benchmarks.breakage_size [--packings 24] [--exponent P] [--out runs/calibration]

Bonds are those of scenes/materials, their strengths times `strength_scale` of the packing's mean sub-sphere radius.
Writes size_independence.csv, a row a run. Breakage that comes after 0.9 ms (2 % of the area) is left out.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.stone import SCENES, strike
from common.tables import read_toml
from dem.stones.packing import pack_sphere
from dem.stones.strength import SIZE_EXPONENT, strength_scale

COUNTS = (500, 1000, 2000)
FIRST_SEED = 40011  # packings that had no part in finding the exponent
DURATION_s = 9e-4


def impact(material: str, count: int, seed: int, exponent: float) -> dict:
    """One run; returns its row of the table."""
    fitted = read_toml(SCENES / "materials" / f"{material}.toml")
    stone_radius = fitted["provenance"]["stone_radius_m"]
    radius = float(pack_sphere(stone_radius, count, seed).radius_m.mean())
    factor = float(strength_scale(radius, fitted["provenance"]["subsphere_radius_m"], exponent))
    bond = dict(fitted["bond"])
    for key in ("tensile_strength_Pa", "shear_strength_Pa"):
        bond[key] *= factor
    changes = {f"materials.{material}.bond.{key}": value for key, value in bond.items()}
    changes[f"materials.{material}.bond.reference_subsphere_radius_m"] = None  # scaled here, by the exponent asked for
    changes |= {"stones.agglomerate.subspheres": count, "stones.seed": seed, "stones.radius_m": stone_radius}
    summary = strike(material, changes, DURATION_s)
    return {"material": material, "subspheres": count, "seed": seed, "subsphere_radius_m": radius,
            "exponent": exponent, "strength_factor": factor, "bonds": summary["n_bonds"],
            "broken_bonds": summary["n_bonds_broken"], "broken_area_m2": summary["broken_area_m2"],
            "peak_force_N": summary["peak_force_N"]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--packings", type=int, default=24)
    parser.add_argument("--exponent", type=float, default=SIZE_EXPONENT)
    parser.add_argument("--materials", nargs="+", default=["coal", "gangue"])
    parser.add_argument("--out", type=Path, default=Path("runs/calibration"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for material in options.materials:
        for count in COUNTS:
            rows += [impact(material, count, FIRST_SEED + 10 * k, options.exponent) for k in range(options.packings)]
            area = np.array([row["broken_area_m2"] for row in rows[-options.packings:]]) * 1e4
            deviation = area.std(ddof=1)
            print(f"{material} {count}: {area.mean():.2f} cm2, deviation of one packing {deviation:.2f}, "
                  f"of the mean {deviation / np.sqrt(len(area)):.2f}", flush=True)
    pd.DataFrame(rows).to_csv(options.out / "size_independence.csv", index=False, float_format="%.6g")


if __name__ == "__main__":
    main()
