"""Extreme cases of scenes as users have them, drawn at random: a shipped scene and the keys that are changed in it.

`ten stones`: scenes/paper.toml, ten stones of 500 sub-spheres over 0.04 s. `crushing`, `tilt`, `shape` and `stream`: one
stone that crushes, one on a tilted plate, polyhedra, and a short stream of stones.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from common.scene.file import scene_tables
from lab.rock.stone import SCENES

SEED = 20012
COUNTS = {"ten stones": 60, "crushing": 30, "tilt": 30, "shape": 30, "stream": 40}
PAIRS = ("coal_plate", "gangue_plate", "coal_coal", "coal_gangue", "gangue_gangue")
COARSE_PLATE = {"plate.max_frequency_Hz": 2000.0, "plate.mesh_size_m": 0.12}
SHORT = {"time.duration_s": 2e-3, "time.sample_interval_s": 1e-4, "time.view_interval_s": None} | COARSE_PLATE
Draw = np.random.Generator
Changes = dict[str, Any]


def scene_cases() -> list[tuple[str, str, Changes]]:
    """(name, scene's file, changed keys) of each case."""
    random, drawn = np.random.default_rng(SEED), []
    draws: dict[str, tuple[str, Callable[[Draw], Changes]]] = {
        "ten stones": ("paper.toml", _ten_stones), "crushing": ("single.toml", _crushing),
        "tilt": ("single.toml", _tilt), "shape": ("polyhedra.toml", _shape), "stream": ("stream.toml", _stream)}
    for kind, count in COUNTS.items():
        file, draw = draws[kind]
        drawn += [(f"{kind} {k + 1}", file, draw(random)) for k in range(count)]
    return drawn


def _log(random: Draw, least: float, most: float) -> float:
    return float(np.exp(random.uniform(np.log(least), np.log(most))))


def _contacts(random: Draw) -> Changes:
    contact = {"restitution": float(random.uniform(0.1, 1.0)), "friction": float(random.choice([0.0, 0.2, 0.5, 1.0, 2.0]))}
    return {f"contacts.{pair}": contact for pair in PAIRS}


def _strengths(random: Draw) -> Changes:
    factor = _log(random, 0.05, 20.0)
    return {f"materials.{name}.bond.{key}": factor * table["bond"][key]
            for name, table in scene_tables(SCENES / "paper.toml")["materials"].items()
            for key in ("tensile_strength_Pa", "shear_strength_Pa")}


def _ten_stones(random: Draw) -> Changes:
    return _contacts(random) | _strengths(random) | {
        "time.duration_s": 0.04, "time.view_interval_s": None, "stones.seed": int(random.integers(1, 10**6)),
        "stones.gangue_ratio": float(random.integers(11)) / 10, "stones.speed_m_s": _log(random, 0.1, 15.0),
        "stones.agglomerate.damping_ratio": float(random.choice([0.0, 0.05, 0.3])),
        "plate.thickness_m": float(random.choice([0.01, 0.02, 0.05])),
        "plate.damping_ratio": float(random.choice([0.0, 0.01, 0.2])),
        "plate.tilt_deg": float(random.choice([0.0, 0.0, 30.0]))} | COARSE_PLATE


def _one_stone(random: Draw) -> Changes:
    return SHORT | _contacts(random) | {
        "stones.agglomerate.subspheres": 200, "stones.speed_m_s": _log(random, 0.1, 30.0),
        "stones.gangue_ratio": float(random.integers(2)), "stones.seed": int(random.integers(1, 10**6)),
        "stones.positions_m": [[float(random.uniform(-0.25, 0.25)), float(random.uniform(-0.25, 0.25))]]}


def _crushing(random: Draw) -> Changes:
    strength = _log(random, 1e6, 1e10)
    return _one_stone(random) | {f"materials.{name}.contact_strength_Pa": strength for name in ("coal", "gangue")}


def _tilt(random: Draw) -> Changes:
    return _one_stone(random) | _strengths(random) | {"plate.tilt_deg": float(random.uniform(0.0, 75.0))}


def _shape(random: Draw) -> Changes:
    return SHORT | _contacts(random) | _strengths(random) | {
        "stones.drawn.speed_m_s": _log(random, 0.1, 15.0), "plate.tilt_deg": float(random.choice([0.0, 20.0]))}


def _stream(random: Draw) -> Changes:
    least = _log(random, 0.015, 0.03)
    return COARSE_PLATE | _contacts(random) | _strengths(random) | {
        "time.duration_s": 0.05, "time.view_interval_s": None, "stones.drawn.arrival_s": [0.0, 0.05],
        "stones.drawn.rate_1_s": _log(random, 20.0, 500.0), "stones.drawn.drop_height_m": _log(random, 1e-3, 2.0),
        "stones.drawn.size_m": [least, 1.5 * least], "plate.tilt_deg": float(random.uniform(0.0, 40.0)),
        "stones.seed": int(random.integers(1, 10**6))}
