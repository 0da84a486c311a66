"""What whole scenes cost: preparation, memory and a step, of stones of the paper's coal on a rigid plate.

The time of a step is LIGGGHTS' own, from 20 us before the impact on, by one rank and by two, on a machine that has
nothing else to do. Packing and peak memory are those of the whole preparation, in a process of its own. Stones share
one packing, whose time is taken times their number: memory and steps do not know.
"""

from __future__ import annotations

import resource
import tempfile
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import dem.stones.assembly
from common.process.processes import apart
from common.scene.scene import Scene, changed_scene
from dem.coupling.launch import mpirun
from dem.deck.render import write_deck
from dem.run.prepare import prepare
from dem.stones.packing import Packing, REFERENCE_RADIUS_m, pack_sphere
from lab.rock.stone import RIGID, SCENES
from lab.speed.engine import engine_run
from lab.study import Row

CASES = [(10, 500), (10, 1000), (10, 2000), (10, 5000), (10, 10_000), (60, 500), (60, 10_000)]
TWO_RANKS = 10  # stones of the cases that two ranks run too
PARTICLE_STEPS = 10_000_000
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


def measure(stones: int, subspheres: int) -> dict[str, Any]:
    """Of one scene. Peak memory of this process needs one that measures nothing else."""
    began = time.process_time()
    packing = pack_sphere(REFERENCE_RADIUS_m, subspheres, 20011)
    packing_s = time.process_time() - began

    def shared(*_: Any) -> Packing:
        return packing

    began = time.process_time()
    with patch.object(dem.stones.assembly, "packed", shared):
        model = prepare(scene(stones, subspheres), "paper.toml", None)
    prepared_s = time.process_time() - began + stones * packing_s
    python_MB = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    with tempfile.TemporaryDirectory() as here:
        deck = Path(here) / "deck"
        write_deck(deck, model.scene, model.assembly, model.step, None)
        deck_MB = sum(f.stat().st_size for f in deck.iterdir()) / 1e6
        steps = max(60, PARTICLE_STEPS // model.assembly.n_particles)
        used = engine_run(deck, steps)
        ms = {ranks: 1e3 / steps * min(engine_run(deck, steps, tuple(mpirun(ranks))).loop_s for _ in range(2))
              for ranks in (1, 2) if stones == TWO_RANKS}
    step_ms = 1e3 * used.loop_s / steps
    return {"bonds": model.assembly.n_bonds, "packing_s": stones * packing_s, "prepared_s": prepared_s,
            "python_MB": python_MB, "engine_MB": used.memory_MB, "deck_MB": deck_MB, "dt_us": 1e6 * model.step.dt_s,
            "ms_per_step": step_ms, "ms_of_two_ranks": ms.get(2), "speed_up": ms[1] / ms[2] if ms else None,
            "hours_of_a_run": step_ms / 1e3 * PAPER_s / model.step.dt_s / 3600}


def scaling(out: Path) -> Iterator[Row]:
    """Numbers of stones and of sub-spheres."""
    for stones, subspheres in CASES:
        yield Row({"stones": stones, "subspheres": subspheres},
                  partial(apart, partial(measure, stones, subspheres)))
