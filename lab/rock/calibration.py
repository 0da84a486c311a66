"""What the calibrated bonds of the shipped rocks reach in virtual tests, beside the targets: read from scenes/materials."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

from common.tables import read_toml
from lab.rock.stone import SCENES
from lab.study import Row

NAMES = {"youngs_modulus_Pa": ("E", "GPa", 1e9), "poisson_ratio": ("nu", "1", 1.0),
         "tensile_strength_Pa": ("Brazilian strength", "MPa", 1e6), "compressive_strength_Pa": ("UCS", "MPa", 1e6)}


def beside_target(found: dict[str, Any], one: float) -> dict[str, Any]:
    """Target and what is reached, in units of `one`."""
    return {"source": found["source"], "target": found["target"] / one, "reached": found["mean"] / one,
            "deviation": found["deviation"] / one, "error_percent": 100 * found["error"]}


def calibration(out: Path) -> Iterator[Row]:
    """A row per rock and target. The packings took no part in the fit."""
    for file in sorted((SCENES / "materials").glob("*.toml")):
        reached = read_toml(file).get("reached", {})
        for key, (name, unit, one) in NAMES.items():
            if key in reached:
                yield Row({"rock": file.stem.replace("_", " "), "quantity": name, "unit": unit},
                          partial(beside_target, reached[key], one))
