"""`gangue learn-forces`: what `listen` believes of the forces of one's own rock and plate, from single stones."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from analysis.files.readers import read_table
from analysis.sweep.runs import read_run
from common.files.output_directory import at_work_in, is_sealed_as, refuse_file
from common.result import Result
from common.scene.plate import read_plate
from common.scene.scene import changed_scene
from common.tables import InputError
from dem.batch.sweep import run_missing
from dem.coupling.launch import check_engine
from dem.run.run import run_scene
from recognition.stone_forces.forces import FORMAT, MATERIALS, History, StoneForces, refuse_limits, save_forces

DURATION_s = 2.5e-3  # of a run, and kept of the force: the stone has left
INNER = 0.72  # of the half sides of the plate: stones fall within
FIRST_SEED = 30011
LEAST = 16  # stones, by which no law was ever fitted
AT_ONCE: dict[str, Any] = {"scatter.arrival_s": None, "scatter.place_m": None}  # whatever a stone has of its own


@dataclass(frozen=True)
class LearntForces(Result):
    """The law that was written, of how many stones of coal and of gangue, and by its run why a stone is not among
    them."""

    law: Path
    coal: int
    gangue: int
    failed: Mapping[str, str]

    def words(self) -> Iterator[str]:
        yield f"{self.coal} stones of coal and {self.gangue} of gangue, law written to {self.law}"
        if self.failed:
            yield f"WARNING: {len(self.failed)} runs failed: {', '.join(self.failed)}"


def learn_forces(scene_file: Path, out: Path, radius_m: tuple[float, float], speed_m_s: tuple[float, float],
                 stones: int = 48, jobs: int = 2) -> LearntForces:
    """Simulate single stones of a scene's coal and gangue, which fall anywhere on its plate with radii, and speeds
    across it, between limits, and write the law of their forces to `out` (.json). The runs stay in a directory of its
    name beside it, and are not made again. Raises InputError or RecognitionError for bad input, Busy where another
    process is there."""
    refuse_file(str(out), is_sealed_as(FORMAT), ".json")
    if not LEAST <= stones <= 10_000:
        raise InputError(f"--stones {stones}: must be from {LEAST} to 10000")
    refuse_limits(radius_m, speed_m_s)
    check_engine()
    plate = read_plate(scene_file)
    places = INNER / 2 * np.array(plate.size_m)
    falls_m_s = tuple(speed / np.cos(np.radians(plate.tilt_deg)) for speed in speed_m_s)
    scenes = [changed_scene(scene_file, alone(k % 2 == 1, FIRST_SEED + k, *values) | AT_ONCE) for k, values in
              enumerate(_spread(stones, radius_m, falls_m_s, places))]
    directory = out.with_suffix("")
    runs = {directory / f"stone_{k:04d}": scene for k, scene in enumerate(scenes)}
    with at_work_in(directory, "stones") as lock:
        run = partial(run_scene, source=str(scene_file), overwrite=True)
        failed = run_missing(str(scene_file), runs, run, jobs, lock, overwrite=True)
    histories = [history_of(path) for path in runs if path not in failed]
    try:
        save_forces(StoneForces.fit(histories), out)
    except ValueError as error:
        raise InputError(f"{scene_file}: {error}") from None
    gangue = sum(h.gangue for h in histories)
    return LearntForces(out, len(histories) - gangue, gangue, {path.name: why for path, why in failed.items()})


def alone(gangue: bool, seed: int, radius_m: float, speed_m_s: float, x_m: float, y_m: float) -> dict[str, Any]:
    """Keys of a scene in which one stone falls."""
    return {"stones.count": 1, "stones.gangue_order": [1], "stones.gangue_ratio": float(gangue),
            "stones.positions_m": [[x_m, y_m]], "stones.radius_m": radius_m, "stones.speed_m_s": speed_m_s,
            "stones.seed": seed, "time.duration_s": DURATION_s, "time.view_interval_s": DURATION_s}


def history_of(directory: Path) -> History:
    """The force of the stone of a finished run, and what it was by itself: size, density, speed across the plate."""
    run, fast = read_run(directory), read_table(directory / "fast.parquet")
    step_s = float(fast["t_s"][1] - fast["t_s"][0])
    force = np.zeros(round(DURATION_s / step_s))
    found = fast["force_01_N"].to_numpy()[1:len(force) + 1]
    force[:len(found)] = found
    stone = read_table(directory / "stones.parquet").iloc[0]
    return History(force, step_s, run.materials[0] == MATERIALS[1], float(stone["radius_m"]),
                   float(stone["density_kg_m3"]), -float(stone["velocity_z_m_s"]))


def _spread(count: int, radius_m: tuple[float, float], speed_m_s: tuple[float, ...],
            places_m: np.ndarray) -> list[tuple[float, ...]]:
    """Radii, speeds and places: a Latin hypercube, so that few stones are spread as evenly as many."""
    from scipy.stats import qmc  # late: it takes a second

    low, high = np.transpose([radius_m, speed_m_s, *([-h, h] for h in places_m)])
    points = low + qmc.LatinHypercube(4, seed=1).random(count) * (high - low)
    return [tuple(float(f"{value:.4g}") for value in row) for row in points]
