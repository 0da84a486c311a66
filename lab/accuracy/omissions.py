"""What each part of a scene costs: one bonded stone on the plate with all of them, and without one after the other.

Processor time of engine and plate from deck to signals, the least of the repeats, which take turns; `saved` is the share
of the whole scene's in the same turn, mean and standard error. Packing and modes are not in it. Bodies in the air stay in
the force loops, so that each part has work for all of the 12 ms.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pandas as pd

import dem.deck.render
from common.scene.file import scene_tables
from common.scene.scene import changed_scene
from dem.run.prepare import PreparedRun, prepare
from dem.run.run import run_prepared
from lab.cost import cpu_s
from lab.rock.stone import SCENES
from lab.study import Row

BASE: dict = {"time.duration_s": 1.2e-2, "time.free_flight_tolerance": 0.0, "stones.agglomerate.subspheres": 500,
              "time.view_interval_s": 1.2e-3}
SMOOTH = {f"contacts.{pair}.friction": 0.0 for pair in ("coal_plate", "gangue_plate", "coal_coal", "coal_gangue",
                                                        "gangue_gangue")}
WITHOUT: dict[str, dict] = {
    "nothing": {},
    "friction and its history": SMOOTH,
    "gravity": {"time.gravity_m_s2": None},
    "bond damping": {"stones.agglomerate.damping_ratio": 0.0},
    "breakage": {"stones.agglomerate.unbreakable": True},
    "pictures (VTK)": {"time.view_interval_s": None},
    "rods": {"plate.rods": None, "plate.edges": "simply_supported"},
    "coupling (rigid plate)": {"plate": scene_tables(SCENES / "hertz_coal.toml")["plate"]},
    "bonds (one sphere)": {"stones.agglomerate": None},
}
MONITOR = "monitor"
COPIES = 200


def cost_s(model: PreparedRun) -> float:
    with tempfile.TemporaryDirectory() as directory:
        return cpu_s(lambda: run_prepared(model, Path(directory) / "run"))


def with_monitors(model: PreparedRun, count: int) -> float:
    """The monitor is in every run and too cheap to be seen; so the deck gets `count` of them."""
    render = dem.deck.render.render

    def render_many(*scene):
        return re.sub(r"^fix monitor( .*\n)", lambda line: "".join(f"fix monitor{k}{line[1]}" for k in range(count)),
                      render(*scene), flags=re.MULTILINE)

    dem.deck.render.render = render_many
    try:
        return cost_s(model)
    finally:
        dem.deck.render.render = render


def omissions(out: Path, repeats: int = 8) -> Iterator[Row]:
    """Each turn runs all parts; the first is the warm-up."""
    model = cache(lambda part: prepare(changed_scene(SCENES / "single.toml", BASE | WITHOUT[part]), "single.toml",
                                       out / ".modes"))
    for turn in range(repeats + 1):
        for part in WITHOUT:
            yield Row({"turn": turn, "part": part}, lambda part=part: {"cpu_s": cost_s(model(part))})  # type: ignore[misc]
        yield Row({"turn": turn, "part": MONITOR}, lambda: {"cpu_s": with_monitors(model("nothing"), COPIES)})


def omissions_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    times = rows[rows["turn"] > 0].pivot(index="turn", columns="part", values="cpu_s")
    saved = 1 - times.div(times["nothing"], axis=0)
    saved[MONITOR] /= 1 - COPIES  # one more for each of the others
    found = [{"part": part, "cpu_s": None if part == MONITOR else times[part].min(), "saved": saved[part].mean(),
              "saved_sem": saved[part].sem()} for part in [*WITHOUT, MONITOR] if part != "nothing"]
    return pd.DataFrame(found)
