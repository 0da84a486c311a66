"""Cost and memory of a stream of stones against how many fall and how fast: `python -m benchmarks.stream`, into
runs/bench.

Coal stones arrive one after another near the edge of a rigid plate, bounce once and leave it. The time is the engine's
own processor time. Beside it the same stones dropped alone, each in a run of its own; both less the time that the engine
takes to start. `--breaking` lets them break.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.stone import SCENES
from common.scene import Scene, changed_scene
from dem.coupling.launch import ENGINE
from dem.deck.render import write_deck
from dem.run.prepare import prepare

FALLS_s = 0.75  # from the first touch until nothing is left: a bounce, and the fall past the edge
PLATE = {"model": "rigid", "length_m": 0.5, "width_m": 0.5, "density_kg_m3": 7830.0, "youngs_modulus_Pa": 2.07e11,
         "poisson_ratio": 0.3}


@dataclass(frozen=True)
class Kind:
    """What the stones are made of."""

    subspheres: int
    breaking: bool


def scene_of(stones: list[dict[str, Any]], kind: Kind, duration_s: float | None) -> Scene:
    """Stones one by one on a rigid plate, until the last has left it if no duration is given."""
    volley = ("count", "radius_m", "positions", "speed_m_s", "gangue_order", "gangue_ratio")
    duration = duration_s or max(stone["arrival_s"] for stone in stones) + FALLS_s
    return changed_scene(SCENES / "single.toml", {
        **{f"stones.{key}": None for key in volley}, "stones.each": stones, "plate": PLATE, "assumptions": None,
        "stones.agglomerate": {"subspheres": kind.subspheres, "contact": "smooth", "unbreakable": not kind.breaking},
        "time.duration_s": duration, "output.view_interval_s": None})


def stones_of(count: int, rate_1_s: float) -> list[dict[str, Any]]:
    """They touch near the edge, moving towards it, in turn at 16 places along it."""
    return [{"material": "coal", "radius_m": 0.025, "x_m": 0.22, "y_m": 0.025 * (7 * k % 16 - 7.5), "seed": k % 8 + 1,
             "velocity_m_s": (1.5, 0.0, -3.0), "arrival_s": 0.32 + k / rate_1_s} for k in range(count)]


def measured(stones: list[dict[str, Any]], kind: Kind, duration_s: float | None = None) -> dict[str, float]:
    """Processor time of the engine, s, its peak memory, MB, and how many stones have left at the end."""
    with tempfile.TemporaryDirectory() as scratch:
        model = prepare(scene_of(stones, kind, duration_s), "stream", SCENES.parent / "runs" / "bench" / "cache")
        deck = Path(scratch) / "deck"
        write_deck(deck, model.scene, model.assembly, model.step, None)
        with open(deck / "engine.out", "wb") as out:
            process = subprocess.Popen([str(ENGINE), "-in", "deck.liggghts"], cwd=deck, stdout=out,
                                       stdin=subprocess.DEVNULL)
            peak_kB = 0  # asked while it runs: what the kernel counts at the end includes Python, from which it was forked
            while True:
                with suppress(FileNotFoundError):
                    found = re.search(r"VmHWM:\s+(\d+)", Path(f"/proc/{process.pid}/status").read_text())
                    peak_kB = max(peak_kB, int(found[1]) if found else 0)
                pid, status, usage = os.wait4(process.pid, os.WNOHANG)
                if pid:
                    break
                time.sleep(0.1)
        if status:
            raise RuntimeError((deck / "engine.out").read_text(errors="replace")[-500:])
        left = pd.read_csv(deck / "left.csv").groupby("agglomerate")["subspheres"].sum()
        return {"stones": len(stones), "cpu_s": usage.ru_utime + usage.ru_stime, "memory_MB": peak_kB / 1024,
                "left": int((left == kind.subspheres).sum())}


def alone(stones: list[dict[str, Any]], kind: Kind, start_s: float) -> float:
    """Mean processor time of a stone in a run of its own, s, less that of the start."""
    return float(np.mean([measured([stone | {"arrival_s": 0.32}], kind)["cpu_s"] for stone in stones])) - start_s


def main() -> None:
    """Measure, print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--counts", type=int, nargs="+", default=[50, 100, 200, 400])
    parser.add_argument("--rates", type=float, nargs="+", default=[50.0], help="stones a second")
    parser.add_argument("--subspheres", type=int, default=200)
    parser.add_argument("--alone", type=int, default=8, help="how many of them are dropped alone")
    parser.add_argument("--breaking", action="store_true")
    given = parser.parse_args()
    kind = Kind(given.subspheres, given.breaking)
    start_s = float(np.mean([measured(stones_of(1, 1.0), kind, 1.5e-4)["cpu_s"] for _ in range(3)]))  # before it enters
    rows = []
    for rate in given.rates:
        for count in given.counts:
            rows.append({"rate_1_s": rate, **measured(stones_of(count, rate), kind)})
            print(rows[-1], flush=True)
    table = pd.DataFrame(rows)
    table["cpu_per_stone_s"] = (table.cpu_s - start_s) / table.stones
    if len(given.counts) > 1:
        slope = np.polyfit(np.log(table.stones), np.log(table.cpu_s - start_s), 1)[0]
        print(f"cost goes with the number of stones to the power {slope:.3f}")
    if given.alone:
        one = alone(stones_of(given.alone, given.rates[0]), kind, start_s)
        table["cpu_alone_s"] = one
        table["over_alone"] = table.cpu_per_stone_s / one
        print(f"a stone alone takes {one:.3f} s, and the engine's start {start_s:.3f} s")
    out = SCENES.parent / "runs" / "bench"
    out.mkdir(parents=True, exist_ok=True)
    name = "stream_breaking" if given.breaking else "stream"
    table.to_csv(out / f"{name}.csv", index=False)
    print(table.to_string())


if __name__ == "__main__":
    main()
