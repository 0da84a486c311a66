"""The shipped rocks in one and the same impact, for the report: `python -m benchmarks.rocks`.

One packing of 500 sub-spheres on a rigid plate, at a restitution of 0.9, with the bonds of each rock of scenes/materials.
Writes report/results/rocks.json: bonds, broken area and largest fragment at each speed, and the slice across the impact
that the report draws. To be run again when one of these rocks changes.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.fragments import ROCKS, impact
from benchmarks.stone import SCENES, Stone
from common.tables import read_toml
from report.results.rocks import KEPT

SPEEDS_m_s = (3.0, 4.0, 5.0, 6.0, 8.0)
SHOWN_m_s = 4.0
SUBSPHERES, SEED = 500, 20011
HALF_SLICE_m = 5e-3


def row(speed_m_s: float, found: dict[str, Any]) -> dict[str, float]:
    return {"speed_m_s": speed_m_s, "broken_bonds": found["n_bonds_broken"],
            "broken_area_cm2": round(1e4 * found["broken_area_m2"], 3),
            "largest_fragment": round(found["largest_fragment"], 4)}


def slice_of(stone: Stone) -> dict[str, list[float]]:
    """Sub-spheres about the middle, where they were before the impact, and the rank of their fragments by mass."""
    label = stone.fragment_of_sphere()
    rank = np.argsort(np.argsort(-np.bincount(label, stone.volume)))[label]
    inside = np.abs(stone.center_m[:, 2]) < HALF_SLICE_m
    return {"x_mm": np.round(1e3 * stone.center_m[inside, 0], 2).tolist(),
            "y_mm": np.round(1e3 * stone.center_m[inside, 1], 2).tolist(),
            "radius_mm": np.round(500 * np.cbrt(stone.volume[inside]), 2).tolist(), "fragment": rank[inside].tolist()}


def main() -> None:
    rocks: dict[str, Any] = {}
    for name in ROCKS:
        runs = {speed: impact(name, speed, SUBSPHERES, SEED) for speed in SPEEDS_m_s}
        rocks[name] = {"bond": read_toml(Path(SCENES) / "materials" / f"{name}.toml")["bond"],
                       "bonds": len(runs[SHOWN_m_s]["stone"].broken),
                       "impacts": [row(speed, found) for speed, found in runs.items()],
                       "slice": slice_of(runs[SHOWN_m_s]["stone"])}
        print(name, rocks[name]["impacts"])
    KEPT.write_text(json.dumps({"subspheres": SUBSPHERES, "shown_m_s": SHOWN_m_s, "rocks": rocks}) + "\n")


if __name__ == "__main__":
    main()
