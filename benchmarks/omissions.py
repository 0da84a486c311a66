"""What each part of a scene costs: one bonded stone on the plate with all of them, and without one after the other.

    python -m benchmarks.omissions [--repeats 8] [--out runs/accuracy]

Writes omissions.csv (part, cpu_s, saved, saved_sem): processor time of engine and plate from deck to signals, the least
of the repeats, which take turns; `saved` is the share of the whole scene's in the same turn, mean and standard error.
Packing and modes are not in it. Bodies in the air stay in the force loops, so that each part has work for all of the 12
ms.
"""

from __future__ import annotations

import argparse
import re
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

import dem.deck.render
from benchmarks.cost import cpu_s
from benchmarks.stone import SCENES
from common.scene import changed_scene
from common.scene_file import scene_tables
from dem.run.prepare import PreparedRun, prepare
from dem.run.run import run_prepared

BASE: dict = {"time.duration_s": 1.2e-2, "time.free_flight_tolerance": 0.0, "stones.agglomerate.subspheres": 500,
              "output.view_interval_s": 1.2e-3}
SMOOTH = {f"contacts.{pair}.friction": 0.0 for pair in ("coal_plate", "gangue_plate", "coal_coal", "coal_gangue",
                                                        "gangue_gangue")}
WITHOUT: dict[str, dict] = {
    "nothing": {},
    "friction and its history": SMOOTH,
    "gravity": {"time.gravity_m_s2": None},
    "bond damping": {"stones.agglomerate.damping_ratio": 0.0},
    "breakage": {"stones.agglomerate.unbreakable": True},
    "pictures (VTK)": {"output": None},
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=8)
    parser.add_argument("--out", type=Path, default=Path("runs/accuracy"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    models = {part: prepare(changed_scene(SCENES / "single.toml", BASE | changes), "single.toml",
                            options.out / ".modes")
              for part, changes in WITHOUT.items()}
    times: dict[str, list[float]] = {part: [] for part in [*models, MONITOR]}
    for repeat in range(options.repeats + 1):
        for part, model in models.items():
            times[part].append(cost_s(model))
        times[MONITOR].append(with_monitors(models["nothing"], COPIES))
        if repeat == 0:  # warm-up
            times = {part: [] for part in times}
    whole = np.array(times["nothing"])
    rows = []
    for part, each in times.items():
        saved = 1 - np.array(each) / whole
        if part == MONITOR:
            saved /= 1 - COPIES  # one more for each of the others
        rows.append({"part": part, "cpu_s": None if part == MONITOR else min(each), "saved": saved.mean(),
                     "saved_sem": saved.std(ddof=1) / np.sqrt(len(saved))})
    table = pd.DataFrame(rows)
    table.to_csv(options.out / "omissions.csv", index=False, float_format="%.4g")
    print(table.to_string(index=False, float_format=lambda x: f"{x:.3g}"))


if __name__ == "__main__":
    main()
