"""What whole scenes cost: `python -m benchmarks.scaling`, into runs/bench/scaling.csv; `--ranks` into ranks.csv.

Stones of the paper's coal on a rigid plate, from 20 us before the impact on. Packing and peak memory are those of the
whole preparation; the time of a step is LIGGGHTS' own loop time, on a machine that has nothing else to do. Stones share
one packing, whose time is taken times their number: memory and steps do not know.
"""

from __future__ import annotations

import argparse
import json
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

import dem.stones.assembly
from benchmarks.growth import engine_run
from benchmarks.stone import SCENES
from common.scene import changed_scene
from common.scene_file import scene_tables
from dem.coupling.launch import mpirun
from dem.deck.render import write_deck
from dem.run.prepare import prepare
from dem.stones.packing import pack_sphere

CASES = [(10, 500), (10, 1000), (10, 2000), (10, 5000), (10, 10_000), (60, 500), (60, 10_000)]
RANK_CASES = [(10, 500), (10, 1000), (10, 2000), (10, 5000), (10, 10_000)]
PARTICLE_STEPS = 10_000_000
SPACING_m = 0.055
PAPER_s = 0.04


def scene(stones: int, subspheres: int):
    """`stones` side by side in a square grid on the rigid plate."""
    side = int(np.ceil(np.sqrt(stones)))
    places = [{"x_m": (k % side - (side - 1) / 2) * SPACING_m, "y_m": (k // side - (side - 1) / 2) * SPACING_m}
              for k in range(stones)]
    return changed_scene(SCENES / "paper.toml", {
        "plate": scene_tables(SCENES / "hertz_coal.toml")["plate"], "output": None, "stones.circle_radius_m": None,
        "stones.positions": places, "stones.count": stones, "stones.gangue_order": list(range(1, stones + 1)),
        "stones.gangue_ratio": 0.0, "stones.agglomerate.subspheres": subspheres,
        "time.free_flight_tolerance": 0.0})  # which one rank alone could use


def one_packing() -> list[float]:
    """Let all stones of a size share a packing; returns the list to which the time of each packing is added."""
    times: list[float] = []

    @cache
    def packed(radius_m: float, count: int):
        start = time.process_time()
        packing = pack_sphere(radius_m, count, 20011)
        times.append(time.process_time() - start)
        return packing

    def shared(radius_m: float, count: int, seed: int, size_ratio: float = 1.5):
        return packed(radius_m, count)

    dem.stones.assembly.pack_sphere = shared  # type: ignore[attr-defined]
    return times


def loop_time_s(deck: Path, steps: int, np_ranks: int) -> float:
    """LIGGGHTS' own time for `steps` steps, s."""
    text = (deck / "deck.liggghts").read_text()
    (deck / "deck.liggghts").write_text(re.sub(r"(?m)^run .*$", f"run {steps}", text))
    for name in ("ledger.bin", "forces.bin", "events.csv"):
        (deck / name).unlink(missing_ok=True)
    done = subprocess.run([*mpirun(np_ranks), "-in", "deck.liggghts"], cwd=deck, stdin=subprocess.DEVNULL, capture_output=True,
                          text=True, errors="replace", check=True)
    return float(re.findall(r"Loop time of (\S+) on", done.stdout)[-1])


def measure(stones: int, subspheres: int, rank_numbers: tuple[int, ...]) -> dict:
    """One row; peak memory of this process needs one that measures nothing else, see `main`."""
    packing_s = one_packing()
    start = time.process_time()
    model = prepare(scene(stones, subspheres), "paper.toml", None)
    prepared_s = time.process_time() - start + (stones - 1) * sum(packing_s)
    python_MB = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    here = Path(tempfile.mkdtemp())
    try:
        write_deck(here / "deck", model.scene, model.assembly, model.step, None)
        deck_MB = sum(f.stat().st_size for f in (here / "deck").iterdir()) / 1e6
        n = model.assembly.n_particles
        steps = max(60, PARTICLE_STEPS // n)
        begin = time.perf_counter()
        engine_run(here / "deck", 0)
        set_up_s = time.perf_counter() - begin
        loop_s, engine_MB = engine_run(here / "deck", steps)
        times = {ranks: min(loop_time_s(here / "deck", steps, ranks) for _ in range(2)) / steps for ranks in rank_numbers}
    finally:
        shutil.rmtree(here)
    row = {"stones": stones, "subspheres": subspheres, "sub_spheres_in_all": n, "bonds": model.assembly.n_bonds,
           "packing_s": stones * sum(packing_s), "prepared_s": prepared_s, "python_MB": python_MB,
           "engine_MB": engine_MB, "set_up_s": set_up_s, "deck_MB": deck_MB, "dt_s": model.step.dt_s,
           "ms_per_step": 1e3 * loop_s / steps}
    row |= {f"loop_ms_{ranks}": 1e3 * t for ranks, t in times.items()}
    return row | {"hours_of_a_run": row["ms_per_step"] / 1e3 * PAPER_s / model.step.dt_s / 3600}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ranks", action="store_true", help="one rank against two")
    parser.add_argument("--case", nargs=2, type=int, help="stones and sub-spheres of each; prints the row")
    options = parser.parse_args()
    if options.case:
        stones, subspheres = options.case
        print(pd.Series(measure(stones, subspheres, (1, 2) if options.ranks else ())).to_json())
        return
    rows = []
    for stones, subspheres in RANK_CASES if options.ranks else CASES:
        command = [sys.executable, "-m", "benchmarks.scaling", "--case", str(stones), str(subspheres)]
        done = subprocess.run(command + ["--ranks"] * options.ranks, stdout=subprocess.PIPE, text=True, check=True)
        rows.append(json.loads(done.stdout))
        print(rows[-1], flush=True)
    table = pd.DataFrame(rows)
    out = Path("runs/bench")
    out.mkdir(parents=True, exist_ok=True)
    table.to_csv(out / ("ranks.csv" if options.ranks else "scaling.csv"), index=False, float_format="%.6g")


if __name__ == "__main__":
    main()
