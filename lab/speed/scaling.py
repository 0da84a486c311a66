"""What whole scenes cost: preparation, memory and a step, of stones of the paper's coal on a rigid plate.

A step is processor time of the engine, of a run from 20 us before the impact on less one of no steps, so that other
programs on the machine matter little; scenes take turns, and a figure is the median of the rounds. Preparation and
its peak memory are those of processes of their own. Stones share one packing, whose time is taken times their number:
memory and steps do not know.
"""

from __future__ import annotations

import resource
import shutil
import time
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import dem.stones.assembly
from common.process.processes import apart
from common.scene.scene import Scene, changed_scene
from dem.coupling.launch import mpirun
from dem.deck.render import write_deck
from dem.run.prepare import PreparedRun, prepare
from dem.stones.packing import Packing, packed
from lab.rock.stone import RIGID, SCENES
from lab.speed.engine import Used, engine_run
from lab.study import Row

CASES = [(10, 500), (10, 2000), (20, 10_000)]
OF_CACHE = (10, 2000)  # the case that steps of larger ones are compared with
PARTICLE_STEPS, LEAST_STEPS = 10_000_000, 300
SPACING_m = 0.055
PAPER_s = 0.04


def scene(stones: int, subspheres: int) -> Scene:
    """`stones` side by side in a square grid on the rigid plate."""
    side = int(np.ceil(np.sqrt(stones)))
    places = [[(k % side - (side - 1) / 2) * SPACING_m, (k // side - (side - 1) / 2) * SPACING_m]
              for k in range(stones)]
    return changed_scene(SCENES / "paper.toml", {
        "plate": RIGID, "time.view_interval_s": None,
        "stones.positions_m": places, "stones.count": stones, "stones.gangue_order": list(range(1, stones + 1)),
        "stones.gangue_ratio": 0.0, "stones.agglomerate.subspheres": subspheres,
        "time.free_flight_tolerance": 0.0})  # which one rank alone could use


def prepared(stones: int, subspheres: int) -> PreparedRun:
    return prepare(scene(stones, subspheres), "paper.toml", None)


def of_one(stones: int, subspheres: int) -> float:
    """Processor time of packing and compliance of so many stones: that of one times their number."""
    began = time.process_time()
    prepared(1, subspheres)
    return stones * (time.process_time() - began)


def deck_of(stones: int, subspheres: int, deck: Path) -> dict[str, Any]:
    """Write the deck. Peak memory of this process needs one that does nothing else."""
    kept = deck.parent / "cache"

    def shared(solid: None, count: int, seed: int, cache_dir: Path | None) -> Packing:
        return packed(solid, count, 1, kept)

    with patch.object(dem.stones.assembly, "packed", shared):
        model = prepare(scene(stones, subspheres), "paper.toml", kept)
    write_deck(deck, model.scene, model.assembly, model.step, None)
    return {"particles": model.assembly.n_particles, "bonds": model.assembly.n_bonds, "dt_us": 1e6 * model.step.dt_s,
            "python_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
            "deck_MB": sum(f.stat().st_size for f in deck.iterdir()) / 1e6}


def measured(work: Path, rounds: int, ranks: int) -> dict[tuple[int, int], dict[str, Any]]:
    """Of all cases, whose engines take turns."""
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    of = {case: apart(partial(deck_of, *case, work / f"{case[0]}_{case[1]}")) for case in CASES}
    taken: dict[tuple[int, int], list[float]] = {case: [] for case in CASES}

    def run(case: tuple[int, int], steps: int) -> Used:
        return engine_run(work / f"{case[0]}_{case[1]}", steps, tuple(mpirun(ranks)))

    for _ in range(rounds):
        for case, figures in of.items():
            steps = max(LEAST_STEPS, PARTICLE_STEPS // figures["particles"])
            idle, used = run(case, 0), run(case, steps)
            figures["engine_MB"] = used.memory_MB
            taken[case].append((used.cpu_s - idle.cpu_s) / steps / figures["particles"])
    for case, figures in of.items():
        step_s = float(np.median(taken[case])) * figures["particles"]
        figures |= {"ns_per_subsphere": 1e9 * float(np.median(taken[case])), "ms_per_step": 1e3 * step_s,
                    "over_20000": float(np.median(np.divide(taken[case], taken[OF_CACHE]))),
                    "hours_of_a_run": step_s * PAPER_s / (1e-6 * figures["dt_us"]) / 3600}
    shutil.rmtree(work)
    return of


def scaling(out: Path, rounds: int = 3, ranks: int = 1) -> Iterator[Row]:
    """Numbers of stones and of sub-spheres."""
    found = cache(partial(measured, out / "scaling", rounds, ranks))
    for case in CASES:
        yield Row({"stones": case[0], "subspheres": case[1]},
                  lambda case=case: {"prepared_s": apart(partial(of_one, *case)), **found()[case]})  # type: ignore[misc]
