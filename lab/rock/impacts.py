"""Studies of one bonded stone that falls on a rigid plate, by its number of sub-spheres and its speed. Every row is an
impact (`impact`); tables have means and standard errors over the packings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.interpolate import interp1d

from common.scene.file import OF_A_MATERIAL
from common.scene.scene import changed_scene
from common.tables import read_toml
from dem.deck.plausible import CRITICAL_SPEED
from lab.rock.stone import SCENES, strike
from lab.study import Row

FIRST_SEED = 40011
SHORT_s = 9e-4  # all that breaks but what comes later


def impact(material: str, changes: dict[str, Any], duration_s: float = SHORT_s) -> dict[str, Any]:
    """Figures of one impact."""
    found = strike(material, changes, duration_s)
    over_critical = found["speed_over_critical"][0]
    return {"broken_share": float(found["stone"].broken.mean()), "broken_area_cm2": 1e4 * found["broken_area_m2"],
            "released_mJ": 1e3 * found["energy"]["released_by_breakage_J"], "largest_fragment": found["largest_fragment"],
            "resolution": (found["fragment_size_over_subsphere"] or [None])[0],
            "formula_m_s": over_critical and found["scene"]["stones"]["speed_m_s"] / over_critical}


def means(rows: pd.DataFrame, by: Sequence[str], columns: Sequence[str]) -> pd.DataFrame:
    """Of each group the number of stones and, of each column, mean and standard error of the mean."""
    groups = rows.groupby(list(by), sort=False)
    table = groups.size().rename("stones").to_frame()
    for name in columns:
        table[name], table[f"{name}_sem"] = groups[name].mean(), groups[name].sem()
    return table.reset_index()


ROCKS = {"coal": "coal", "hard_coal": "coal", "gangue": "gangue", "soft_coal": "coal"}  # with what they stand for
COHERENT = "soft_coal"  # whose elastic constants and strengths are of one table, with flaws
AREAS_cm2 = (100, 200)  # of which the speed is sought
LOWER = 0.9  # of the least area: so far the first line goes on
SLOW_m_s = 3.0  # at which few stones break: here each has a strength of its own, as in natural.toml
RESTITUTION = 0.9
OTHERS = (0.8, 1.0)  # restitutions, of the fewest sub-spheres


def of_rock(rock: str) -> dict[str, Any]:
    """What makes a scene's coal or gangue one of scenes/materials."""
    table = read_toml(SCENES / "materials" / f"{rock}.toml")
    return {f"materials.{ROCKS[rock]}": {key: table[key] for key in OF_A_MATERIAL if key in table}}


def breakage_mesh(out: Path, packings: int = 24, counts: tuple[int, ...] = (500, 1000, 2000),
                  speeds: tuple[float, ...] = (SLOW_m_s, 4.2, 5.0, 6.0)) -> Iterator[Row]:
    """Numbers of sub-spheres, of a coal with flaws; a seed has the same flaws at each. Of the fewest, other restitutions
    too."""
    strength = read_toml(SCENES / "natural.toml")["scatter"]["strength_factor"]
    for k in range(packings):
        for speed in speeds:
            for count in counts:
                for restitution in (RESTITUTION, *(OTHERS if speed > SLOW_m_s and count == counts[0] else ())):
                    changes = of_rock(COHERENT) | {
                        "stones.agglomerate.subspheres": count, "stones.agglomerate.contact": "smooth",
                        "stones.seed": FIRST_SEED + 10 * k, "stones.speed_m_s": speed,
                        "contacts.coal_plate": {"restitution": restitution, "friction": 0.4}}
                    if speed == SLOW_m_s:
                        changes |= {"scatter": {"strength_factor": strength, "seed": FIRST_SEED + 10 * k}}
                    yield Row({"speed_m_s": speed, "subspheres": count, "restitution": restitution, "packing": k},
                              partial(impact, "coal", changes))


def breakage_mesh_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """`at_N_cm2_m_s`: the speed at which N cm2 break, on straight lines through the means over the speeds. Of the energy of
    the impact what breakage releases, and the bonds' fracture energy times the broken area."""
    table = means(rows, ["speed_m_s", "subspheres", "restitution"],
                  ["broken_area_cm2", "largest_fragment", "released_mJ", "resolution"])
    table = table.drop(columns="resolution_sem").sort_values(["speed_m_s", "subspheres", "restitution"])
    scene = changed_scene(SCENES / "single.toml", of_rock(COHERENT))
    coal, radius_m = scene.materials["coal"], scene.stones.volley[1]
    assert coal.bond is not None and coal.bond.fracture_energy_J_m2 is not None
    impact_J = coal.density_kg_m3 * 2 / 3 * np.pi * radius_m**3 * table["speed_m_s"] ** 2
    table["released_percent"] = 0.1 * table["released_mJ"] / impact_J
    table["fracture_percent"] = 0.01 * coal.bond.fracture_energy_J_m2 * table["broken_area_cm2"] / impact_J
    for _, own in table[table["speed_m_s"] > SLOW_m_s].groupby(["subspheres", "restitution"]):
        for area in AREAS_cm2:
            if LOWER * own["broken_area_cm2"].min() < area < own["broken_area_cm2"].max():
                at = interp1d(own["broken_area_cm2"], own["speed_m_s"], fill_value="extrapolate")
                table.loc[own.index[0], f"at_{area}_cm2_m_s"] = float(at(area))
    return table


CRITICAL_STONES = {**dict.fromkeys(("coal", "hard_coal", "gangue"), (25.0,)), "soft_coal": (12.5, 25.0, 50.0)}  # R in mm
WHOLE = 0.7             # of a stone's mass: with less in its largest fragment it has fallen apart
SPAN = (0.6, 1.5)       # of the speed by the formula, within which the critical speed is sought


def critical_speed(out: Path, packings: int = 3, halvings: int = 4) -> Iterator[Row]:
    """The speed at which each rock falls apart, for itself by packing; of the coal with flaws in three sizes."""
    for rock, radii_mm in CRITICAL_STONES.items():
        for radius_mm in radii_mm:
            for k in range(packings):
                yield Row({"rock": rock, "radius_mm": radius_mm, "packing": k},
                          partial(falls_apart, rock, radius_mm, FIRST_SEED + 10 * k, halvings))


def falls_apart(rock: str, radius_mm: float, seed: int, halvings: int) -> dict[str, float]:
    """The critical speed of one stone, by halving the span, beside that of the formula."""
    changes = of_rock(rock) | {"stones.seed": seed, "stones.radius_m": 1e-3 * radius_mm}

    def at(speed: float, duration_s: float = SHORT_s * radius_mm / 25.0) -> dict[str, Any]:
        return impact(ROCKS[rock], changes | {"stones.speed_m_s": speed}, duration_s)

    formula_m_s = at(1.0, 1.5e-4)["formula_m_s"]
    low, high = (share * formula_m_s for share in SPAN)
    for _ in range(halvings):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if at(middle)["largest_fragment"] < WHOLE else (middle, high)
    return {"speed_m_s": float(np.sqrt(low * high)), "formula_m_s": formula_m_s}


def critical_speed_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """`over_formula`: what `critical_speed` of the product would have to be multiplied with. `energy_exponent`: of the
    diameter, in the energy a mass at that speed."""
    table = means(rows, ["rock", "radius_mm"], ["speed_m_s", "formula_m_s"]).drop(columns="formula_m_s_sem")
    table["over_formula"] = table["speed_m_s"] / table["formula_m_s"]
    table["constant"] = CRITICAL_SPEED * table["over_formula"]
    for _, own in table.groupby("rock"):
        if len(own) > 1:
            table.loc[own.index, "energy_exponent"] = 2 * np.polyfit(np.log(own["radius_mm"]), np.log(own["speed_m_s"]), 1)[0]
    return table
