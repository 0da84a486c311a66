"""Cost and memory of a stream of stones against how many fall and how fast.

Coal stones arrive one after another near the edge of a rigid plate, bounce once and leave it. The time is the engine's
own processor time. Beside it the same stones dropped alone, each in a run of its own; both less the time that the engine
takes to start. At each of the rates stones of 30 mm fall anywhere on a plate that is tilted by 20 degrees, and hit each
other the more, the faster they come.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from common.scene.scene import Scene, changed_scene
from dem.deck.render import write_deck
from dem.run.prepare import prepare
from lab.rock.stone import SCENES
from lab.speed.engine import engine_run
from lab.study import Row

RATE_1_s = 50.0
FALLS_s = 0.75  # from the first touch until nothing is left: a bounce, and the fall past the edge
PLATE = {"size_m": [0.5, 0.5], "density_kg_m3": 7830.0, "youngs_modulus_Pa": 2.07e11,
         "poisson_ratio": 0.3}


@dataclass(frozen=True)
class Kind:
    """What the stones are made of."""

    subspheres: int
    breaking: bool


def scene_of(stones: list[dict[str, Any]], kind: Kind, duration_s: float | None = None) -> Scene:
    """Stones one by one on a rigid plate, until the last has left it if no duration is given."""
    return _scene({"stones.each": stones, "stones.gangue_ratio": None, "plate": PLATE}, kind,
                  duration_s or max(stone["arrival_s"] for stone in stones) + FALLS_s)


def drawn_scene(count: int, rate_1_s: float, kind: Kind) -> Scene:
    """Stones at random times and places on a tilted plate."""
    stream = {"rate_1_s": rate_1_s, "arrival_s": [0.32, 0.32 + count / rate_1_s], "size_m": 0.03,
              "speed_m_s": 3.0}
    return _scene({"stones.drawn": stream, "plate": PLATE | {"tilt_deg": 20.0}}, kind,
                  0.32 + count / rate_1_s + FALLS_s)


def _scene(changes: dict[str, Any], kind: Kind, duration_s: float) -> Scene:
    volley = ("count", "radius_m", "positions_m", "speed_m_s", "gangue_order")
    return changed_scene(SCENES / "single.toml", {
        **{f"stones.{key}": None for key in volley}, "assumptions": None, "time.duration_s": duration_s,
        "stones.agglomerate": {"subspheres": kind.subspheres, "contact": "smooth", "unbreakable": not kind.breaking},
        "time.view_interval_s": None} | changes)


def stones_of(count: int) -> list[dict[str, Any]]:
    """They touch near the edge, moving towards it, in turn at 16 places along it."""
    return [{"material": "coal", "radius_m": 0.025, "place_m": [0.22, 0.025 * (7 * k % 16 - 7.5)],
             "velocity_m_s": (1.5, 0.0, -3.0), "arrival_s": 0.32 + k / RATE_1_s} for k in range(count)]


def measured(scene: Scene, cache: Path) -> dict[str, float]:
    """Processor time and peak memory of the engine, and how many stones have left at the end."""
    with tempfile.TemporaryDirectory() as scratch:
        model, deck = prepare(scene, "stream", cache), Path(scratch) / "deck"
        write_deck(deck, model.scene, model.assembly, model.step, None)
        used = engine_run(deck)
        left = pd.read_csv(deck / "left.csv").groupby("agglomerate")["subspheres"].sum()
    return {"stones": len(model.assembly.stones), "cpu_s": used.cpu_s, "memory_MB": used.memory_MB,
            "left": int((left == model.assembly.sizes[left.index - 1]).sum())}


def stream_cost(out: Path, counts: tuple[int, ...] = (50, 200, 1000), rates: tuple[float, ...] = (10.0, 50.0, 200.0, 400.0),
                stones: int = 60, subspheres: int = 300, alone: int = 6, breaking: int = 0) -> Iterator[Row]:
    """The start by itself, stones alone, so many near the edge, and `stones` of them at each rate."""
    kind, cache = Kind(subspheres, bool(breaking)), out / ".modes"
    scenes: list[tuple[str, float, Scene]] = [("start", 0, scene_of(stones_of(1), kind, 1.5e-4))]
    scenes += [("alone", k, scene_of([stone | {"arrival_s": 0.32}], kind)) for k, stone in enumerate(stones_of(alone))]
    scenes += [("near the edge", count, scene_of(stones_of(count), kind)) for count in counts]
    scenes += [("tilted plate, stones a second", rate, drawn_scene(stones, rate, kind)) for rate in rates]
    for name, value, scene in scenes:
        yield Row({"study": name, "value": value}, partial(measured, scene, cache))


def stream_cost_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """With the time of a stone less that of the start, also over that of one alone."""
    start_s = rows.loc[rows["study"] == "start", "cpu_s"].mean()
    table = rows.groupby(["study", "value"], sort=False).mean().reset_index()
    table["cpu_per_stone_s"] = (table["cpu_s"] - start_s) / table["stones"]
    one_s = table.loc[table["study"] == "alone", "cpu_per_stone_s"].mean()
    return table.assign(over_alone=(table["cpu_per_stone_s"] / one_s).where(table["study"] == "near the edge"))
