"""Cost and memory of a stream of stones against how many fall and how fast: `python -m benchmarks.stream`, into
runs/bench.

Coal stones arrive one after another near the edge of a rigid plate, bounce once and leave it. The time is the engine's
own processor time. Beside it the same stones dropped alone, each in a run of its own; both less the time that the engine
takes to start. With `--rates`, stones of 30 mm fall anywhere on a plate that is tilted by 20 degrees, and hit each other
the more, the faster they come. `--breaking` lets them break.
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

RATE_1_s = 50.0
FALLS_s = 0.75  # from the first touch until nothing is left: a bounce, and the fall past the edge
PLATE = {"model": "rigid", "length_m": 0.5, "width_m": 0.5, "density_kg_m3": 7830.0, "youngs_modulus_Pa": 2.07e11,
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
    stream = {"rate_1_s": rate_1_s, "begin_s": 0.32, "duration_s": count / rate_1_s, "size_m": 0.03, "speed_m_s": 3.0}
    return _scene({"stones.stream": stream, "plate": PLATE | {"tilt_deg": 20.0}}, kind,
                  0.32 + count / rate_1_s + FALLS_s)


def _scene(changes: dict[str, Any], kind: Kind, duration_s: float) -> Scene:
    volley = ("count", "radius_m", "positions", "speed_m_s", "gangue_order")
    return changed_scene(SCENES / "single.toml", {
        **{f"stones.{key}": None for key in volley}, "assumptions": None, "time.duration_s": duration_s,
        "stones.agglomerate": {"subspheres": kind.subspheres, "contact": "smooth", "unbreakable": not kind.breaking},
        "output.view_interval_s": None} | changes)


def stones_of(count: int) -> list[dict[str, Any]]:
    """They touch near the edge, moving towards it, in turn at 16 places along it."""
    return [{"material": "coal", "radius_m": 0.025, "x_m": 0.22, "y_m": 0.025 * (7 * k % 16 - 7.5), "seed": k % 8 + 1,
             "velocity_m_s": (1.5, 0.0, -3.0), "arrival_s": 0.32 + k / RATE_1_s} for k in range(count)]


def measured(scene: Scene) -> dict[str, float]:
    """Processor time of the engine, s, its peak memory, MB, and how many stones have left at the end."""
    with tempfile.TemporaryDirectory() as scratch:
        model = prepare(scene, "stream", SCENES.parent / "runs" / "bench" / "cache")
        deck = Path(scratch) / "deck"
        write_deck(deck, model.scene, model.assembly, model.step, None)
        with open(deck / "engine.out", "wb") as out:
            process = subprocess.Popen([str(ENGINE), "-in", "deck.liggghts"], cwd=deck, stdout=out,
                                       stdin=subprocess.DEVNULL)
            peak_kB = 0  # asked while it runs: what the kernel counts at the end includes Python, from which it was forked
            while True:
                with suppress(FileNotFoundError):
                    high = re.search(r"VmHWM:\s+(\d+)", Path(f"/proc/{process.pid}/status").read_text())
                    peak_kB = max(peak_kB, int(high[1]) if high else 0)
                pid, status, usage = os.wait4(process.pid, os.WNOHANG)
                if pid:
                    break
                time.sleep(0.1)
        if status:
            raise RuntimeError((deck / "engine.out").read_text(errors="replace")[-500:])
        left = pd.read_csv(deck / "left.csv").groupby("agglomerate")["subspheres"].sum()
        found = {"stones": len(model.assembly.stones), "cpu_s": usage.ru_utime + usage.ru_stime,
                 "memory_MB": peak_kB / 1024, "left": int((left == model.assembly.sizes[left.index - 1]).sum())}
        print(found, flush=True)
        return found


def alone(stones: list[dict[str, Any]], kind: Kind, start_s: float) -> float:
    """Mean processor time of a stone in a run of its own, s, less that of the start."""
    return float(np.mean([measured(scene_of([stone | {"arrival_s": 0.32}], kind))["cpu_s"] for stone in stones])) - start_s


def main() -> None:
    """Measure, print and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--counts", type=int, nargs="*", default=[50, 100, 200, 400], help="of stones near the edge")
    parser.add_argument("--rates", type=float, nargs="*", default=[], help="stones a second, anywhere on a tilted plate")
    parser.add_argument("--stones", type=int, default=60, help="of each rate")
    parser.add_argument("--subspheres", type=int, default=200)
    parser.add_argument("--alone", type=int, default=8, help="how many of them are dropped alone")
    parser.add_argument("--breaking", action="store_true")
    given = parser.parse_args()
    kind = Kind(given.subspheres, given.breaking)
    start_s = float(np.mean([measured(scene_of(stones_of(1), kind, 1.5e-4))["cpu_s"] for _ in range(3)]))
    print(f"the engine's start takes {start_s:.3f} s")
    if given.counts:
        _write(_by_count(given.counts, given.alone, kind, start_s), f"stream{'_breaking' * kind.breaking}")
    if given.rates:
        scenes = {rate: drawn_scene(given.stones, rate, kind) for rate in given.rates}
        _write(pd.DataFrame([{"rate_1_s": rate, **measured(scene)} for rate, scene in scenes.items()]),
               f"stream_rates{'_breaking' * kind.breaking}")


def _by_count(counts: list[int], n_alone: int, kind: Kind, start_s: float) -> pd.DataFrame:
    table = pd.DataFrame([measured(scene_of(stones_of(count), kind)) for count in counts])
    table["cpu_per_stone_s"] = (table.cpu_s - start_s) / table.stones
    if len(counts) > 1:
        slope = np.polyfit(np.log(table.stones), np.log(table.cpu_s - start_s), 1)[0]
        print(f"cost goes with the number of stones to the power {slope:.3f}")
    if n_alone:
        one = alone(stones_of(n_alone), kind, start_s)
        table["over_alone"] = table.cpu_per_stone_s / one
        print(f"a stone alone takes {one:.3f} s")
    return table


def _write(table: pd.DataFrame, name: str) -> None:
    out = SCENES.parent / "runs" / "bench"
    out.mkdir(parents=True, exist_ok=True)
    table.to_csv(out / f"{name}.csv", index=False)
    print(table.to_string())


if __name__ == "__main__":
    main()
