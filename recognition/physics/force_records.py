"""What simulated runs teach besides their records: how each stone pushed, and what the plate makes of a push.

Needs the simulation's plate model (plate_fem): import it late.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
from scipy.signal import fftconvolve

from analysis.readers import read_table
from analysis.real_plate import flexible_plate
from analysis.records import RecordError
from analysis.runs import Run
from analysis.setup import places_of
from common.plate import FlexiblePlate
from plate_fem.modes import plate_modes
from plate_fem.response import pulse_response


@dataclass(frozen=True)
class Lesson:
    """One run. force_N (stones, rows): means over steps of step_s from t = 0 on; sample_s: of its record; gangue (stones,);
    at_once: all stones touch the plate together; modes_dir: where the plate's modes may be found ready."""

    plate: FlexiblePlate
    modes_dir: Path | None
    place_m: np.ndarray
    at_once: bool
    speed_m_s: float
    sample_s: float
    step_s: float
    force_N: np.ndarray
    gangue: np.ndarray

    @cached_property
    def told(self) -> np.ndarray:
        """What the plate's model makes of these forces, (channels, rows): velocity of the centre of mass, accelerometers and
        rods, each by name."""
        return pushed(response(self, self.plate.damping_ratio), self.force_N.T).sum(axis=2)


def lesson_of(run: Run, listened_s: float) -> Lesson:
    """Of a finished run, its first listened_s. RecordError without a fast stream so long, a flexible plate or places of stones."""
    path = run.path / "fast.parquet"
    table = read_table(path)
    t_s = table["t_s"].to_numpy(dtype=float)
    step_s = float(t_s[1] - t_s[0]) if len(t_s) > 1 else listened_s
    rows = round(listened_s / step_s)
    if len(t_s) <= rows or not np.allclose(np.diff(t_s[:rows + 1]), step_s):
        raise RecordError(f"{path}: needs {listened_s:g} s without gaps")
    stones = run.info.get("scene", {}).get("stones", {})
    speed_m_s = stones.get("speed_m_s")
    if not isinstance(speed_m_s, (int, float)):
        raise RecordError(f"{run.path}/run.json: scene.stones.speed_m_s = {speed_m_s!r}; needs a number")
    forces = [name for name in table.columns.astype(str) if name.startswith("force_") and name != "force_N"]
    return Lesson(flexible_plate(run), _modes_dir(run.path), places_of(run), stones.get("arrival_s") is None, float(speed_m_s),
                  1 / run.rate_Hz, step_s, table[forces].to_numpy(dtype=float)[1:rows + 1].T,
                  np.array(run.materials) == "gangue")


def lessons_of(runs: list[Run], listened_s: float) -> list[Lesson | None]:
    """What each run teaches; None where that is nothing: no fast stream, a rigid plate, no places."""
    lessons: list[Lesson | None] = []
    for run in runs:
        try:
            lessons.append(lesson_of(run, listened_s))
        except RecordError:
            lessons.append(None)
    return lessons


def response(lesson: Lesson, damping_ratio: float, moved_m: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Of each channel to a force of 1 N on each stone's place, moved_m from it, during the first step, shape (channels, rows,
    stones)."""
    plate = lesson.plate.model_copy(update={"damping_ratio": float(damping_ratio)})
    return _response(plate.model_dump_json(), tuple(map(tuple, lesson.place_m)), moved_m, lesson.step_s,
                     lesson.force_N.shape[1], lesson.modes_dir)


def pushed(one: np.ndarray, force_N: np.ndarray) -> np.ndarray:
    """Responses (channels, rows, stones) to forces (rows, stones) or, the same at every place, (rows, 1)."""
    return fftconvolve(one, force_N[None], axes=1)[:, :one.shape[1]]


@lru_cache(maxsize=64)
def _response(plate_json: str, places: tuple, moved_m: tuple[float, float], step_s: float, rows: int,
              modes_dir: Path | None) -> np.ndarray:
    plate = FlexiblePlate.model_validate_json(plate_json)
    modes = plate_modes(plate, modes_dir, np.array(places))
    amplitude, rate, acceleration = pulse_response(modes, step_s, rows)
    down = -modes.shape_at(np.array(places) + moved_m)
    sensors = sorted(plate.sensors, key=lambda sensor: f"acc_{sensor.name}_m_s2")  # as sorted columns are
    at_sensors = modes.shape_at(np.array([[s.x_m, s.y_m] for s in sensors]))
    rods = modes.rod_force[sorted(range(len(modes.rod_force)), key=lambda k: f"rod_{k + 1}_N")]
    return np.concatenate([_channels(rate, modes.mean_shape[None], down), _channels(acceleration, at_sensors, down),
                           _channels(amplitude, rods, down)])


def _channels(motion: np.ndarray, seen: np.ndarray, down: np.ndarray) -> np.ndarray:
    """Modal motion (rows, n) under a unit modal force, seen by (channels, n), pushed at (stones, n)."""
    return np.einsum("tn,cn,in->cti", motion, seen, down, optimize=True)


def _modes_dir(path: Path) -> Path | None:
    """Where the simulation has kept the plate's modes; they take half a minute to find."""
    return next((up / ".modes" for up in path.resolve().parents if (up / ".modes").is_dir()), None)
