"""The shipped rocks: what calibration reached of their laboratory strengths, and what breaks of each in one impact."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from common.resources import resource
from common.tables import read_toml

#: What benchmarks/rocks.py measured.
KEPT = Path(__file__).with_name("rocks.json")
#: Files of scenes/materials and what the report calls them; coal and gangue are those of the shipped scenes.
ROCK_NAMES = {"coal": "soft coal", "hard_coal": "hard coal", "gangue": "gangue"}


@dataclass(frozen=True)
class Property:
    """Of a rock in virtual tests: the laboratory value it was fitted to, and mean and deviation of other packings."""

    rock: str
    key: str
    target: float
    mean: float
    deviation: float
    error: float
    source: str


@dataclass(frozen=True)
class StruckRock:
    """A rock and what broke of its stone.

    bond: as in scenes/materials. bonds: of the stone. impacts: `speed_m_s`, `broken_bonds`, `broken_area_cm2`,
    `largest_fragment`, a row a speed. slice: `x_mm`, `y_mm`, `radius_mm` and `fragment` (rank by mass) of sub-spheres.
    """

    name: str
    bond: dict[str, float]
    bonds: int
    impacts: pd.DataFrame
    slice: dict[str, np.ndarray]


def fitted_properties() -> list[Property]:
    """All that the bonds of each rock were fitted to, in the order of the fit."""
    found = []
    for name, title in ROCK_NAMES.items():
        reached = material(name)["reached"]
        found += [Property(title, key, values["target"], values["mean"], values["deviation"], values["error"],
                           values["source"])
                  for key, values in reached.items() if not key.startswith("stone_")]
    return found


def material(name: str) -> dict[str, Any]:
    """The file of a rock in scenes/materials."""
    return read_toml(resource("scenes") / "materials" / f"{name}.toml")


def struck_rocks() -> tuple[float, list[StruckRock]]:
    """The speed at which the slices are, m/s, and each rock."""
    kept = json.loads(KEPT.read_text())
    return kept["shown_m_s"], [
        StruckRock(ROCK_NAMES[name], rock["bond"], rock["bonds"], pd.DataFrame(rock["impacts"]),
                   {key: np.array(values) for key, values in rock["slice"].items()})
        for name, rock in kept["rocks"].items()
    ]
