"""The streams of a run: what the plate did, what the stones pushed, which bonds broke."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from common.channels import (
    DAMPING_IMPULSE,
    RESPONSES,
    RODS_MOMENTUM,
    SENSORS,
    force_column,
    rod_column,
    sensor_column,
)  # fmt: skip
from common.files.parquet import Columns
from common.scene.plate import FlexiblePlate
from common.scene.scene import Scene
from dem.deck.pictures import PictureSchedule
from dem.deck.time_step import TimeStep
from plate_fem.modes import PlateModes
from plate_fem.motion import ModalMotion, RecordedMotion
from plate_fem.stress import StressPeak


class PlateRecorder:
    """Collects the plate's state at each row of the fast stream, its modal state at the samples, and its modal
    amplitudes where there may be a picture.

    The signals of the rows are computed in blocks, since a product of matrices costs little more than one of vectors.
    `check(t_s, total_J)` is called with the energy of each block, arrays (k,).
    """

    BLOCK = 128  # rows

    def __init__(self, scene: Scene, modes: PlateModes, motion: ModalMotion, step: TimeStep,
                 pictures: PictureSchedule | None, check: Callable[[np.ndarray, np.ndarray], None]):
        self._motion = motion
        self._step = step
        self._pictures = pictures
        self._check = check
        assert isinstance(scene.plate, FlexiblePlate)  # the other has no motion to record
        by_kind = {kind: [s for s in scene.plate.sensors if s.kind == kind] for kind in SENSORS}
        self._mean = modes.mean_shape
        self._sensor = {kind: modes.shape_at(np.array([s.place_m for s in own]))
                        for kind, own in by_kind.items() if own}
        self._of_amplitude, self._of_rate = modes.rod_force, np.empty((0, len(self._mean)))
        rods = [rod_column(k) for k in range(1, len(modes.rod_force) + 1)]
        if len(modes.lateral):  # on rods alone
            damping = 4 * np.pi * modes.damping_ratio * modes.frequency_Hz * modes.momentum
            self._of_amplitude = np.vstack([modes.rod_force, damping])
            self._of_rate = (modes.momentum - modes.mass_kg * modes.mean_shape)[None]
            rods += [DAMPING_IMPULSE, RODS_MOMENTUM]
        self.columns = [*RESPONSES, *(sensor_column(s.name, kind) for kind, own in by_kind.items() for s in own), *rods]
        self.steps: list[int] = []
        self.view_amplitude: dict[int, np.ndarray] = {}  # by DEM step
        self.bending = StressPeak(modes, scene.plate.rods)
        self._blocks: list[np.ndarray] = []
        self._every = step.sample_steps // step.fast_steps
        self._samples: list[np.ndarray] = []
        self._evaluated = 0                                       # rows
        self._block = np.empty((3, self.BLOCK, len(self._mean)))  # amplitude, rate and modal force of rows that wait,
        self._waiting = 0                                         # and how many of them there are

    def __call__(self, dem_steps: range, states: np.ndarray, force: np.ndarray, last_force: np.ndarray) -> None:
        """Record rows at `dem_steps`: amplitude and rate of each, (rows, 2, modes), and the modal force on it, which is
        `last_force` at the last."""
        if self._pictures:
            for dem_step in self._pictures.possible(dem_steps):
                self.view_amplitude[dem_step] = states[dem_steps.index(dem_step), 0].copy()
        self.steps.extend(dem_steps)
        taken = 0
        while taken < len(states):
            here = states[taken:taken + self.BLOCK - self._waiting]
            first, taken, self._waiting = self._waiting, taken + len(here), self._waiting + len(here)
            self._block[:2, first:self._waiting] = here.swapaxes(0, 1)
            self._block[2, first:self._waiting] = force
            if taken == len(states):
                self._block[2, self._waiting - 1] = last_force
            if self._waiting == self.BLOCK:
                self._evaluate()

    def _evaluate(self) -> None:
        """Compute the signals of the rows that wait."""
        if not self._waiting:
            return
        t_s = np.array(self.steps[self._evaluated:self._evaluated + self._waiting]) * self._step.dt_s
        amplitude, rate, force = self._block[:, :self._waiting]
        acceleration = self._motion.acceleration_at(amplitude, rate, force)
        samples = self._block[:, :self._waiting][:, -self._evaluated % self._every::self._every]
        self._samples.append(samples.astype(np.float32))
        kinetic, internal = self._motion.energies_at(amplitude, rate)
        self._check(t_s, kinetic + internal)
        measured = {"acceleration": acceleration, "velocity": rate, "displacement": amplitude}  # by kind of sensor
        self._blocks.append(np.column_stack([
            amplitude @ self._mean, rate @ self._mean, acceleration @ self._mean, kinetic, internal, kinetic + internal,
            *(measured[kind] @ shape.T for kind, shape in self._sensor.items()),
            amplitude @ self._of_amplitude.T, rate @ self._of_rate.T]))
        self.bending.add(t_s, amplitude)
        self._evaluated, self._waiting = self._evaluated + self._waiting, 0

    def get_state(self) -> dict[str, np.ndarray]:
        """All that was recorded, for `set_state`. The rows that wait for their block still wait, so that a run that
        goes on from here computes the same blocks."""
        return {"rows": self._rows(), "samples": self._of_samples(), "steps": np.array(self.steps),
                "waiting": self._block[:, :self._waiting].swapaxes(0, 1),
                "view_steps": np.array(list(self.view_amplitude), dtype=int),
                "view_amplitude": np.array(list(self.view_amplitude.values())), **self.bending.get_state()}

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        self._blocks, self.steps, self._evaluated = [state["rows"]], state["steps"].tolist(), len(state["rows"])
        self._samples = [state["samples"]]
        self._waiting = len(state["waiting"])
        self._block[:, :self._waiting] = state["waiting"].swapaxes(0, 1)
        self.view_amplitude = dict(zip(state["view_steps"].tolist(), state["view_amplitude"], strict=True))
        self.bending.set_state(state)

    def _rows(self) -> np.ndarray:
        return np.concatenate([np.empty((0, len(self.columns))), *self._blocks])

    def _of_samples(self) -> np.ndarray:
        return np.concatenate([np.empty((3, 0, len(self._mean)), np.float32), *self._samples], axis=1)

    def signals(self) -> Columns:
        self._evaluate()
        return dict(zip(self.columns, self._rows().T, strict=True))

    def motion(self, modes: PlateModes) -> RecordedMotion:
        self._evaluate()
        t_s = np.array(self.steps[::self._every]) * self._step.dt_s
        return RecordedMotion(modes, t_s, *self._of_samples())


@dataclass(frozen=True)
class Pushes:
    """Rows of the push on the plate over an interval that ends at the DEM step `step` (k,): of the stone `stone` (k,),
    0-based, its mean `mean_N`, the largest mean over a co-step `largest_N`, and where, `place_m` (k, 2). `all_step`,
    `all_mean_N`, `all_largest_N` are those of all stones together."""

    step: np.ndarray
    stone: np.ndarray
    mean_N: np.ndarray
    largest_N: np.ndarray
    place_m: np.ndarray
    all_step: np.ndarray
    all_mean_N: np.ndarray
    all_largest_N: np.ndarray

    def of_stones(self, n_stones: int) -> np.ndarray:
        """(n_stones,) the largest push of each."""
        largest = np.zeros(n_stones)
        np.maximum.at(largest, self.stone, self.largest_N)
        return largest


def read_forces(file: Path) -> Pushes:
    """Read the forces that the engine wrote (contact_recorder.h)."""
    data = np.fromfile(file, dtype=[("step", "<i8"), ("agglomerate", "<i8"), ("number", "<f8", (4,))])
    of_all = data["agglomerate"] == 0
    one, all_ = data[~of_all], data[of_all]
    return Pushes(one["step"], one["agglomerate"] - 1, one["number"][:, 0], one["number"][:, 1], one["number"][:, 2:],
                  all_["step"], all_["number"][:, 0], all_["number"][:, 1])


def fast_stream(step: TimeStep, pushes: Pushes, plate_signals: Columns, columns_of: int) -> Columns:
    """All rows at the fast rate. A force is the mean over the row's interval; the plate's state is at its end.

    `plate_signals` has a row for each of the fast stream; the first `columns_of` stones have a column each. Raises
    RuntimeError if a signal holds a value that is no number.
    """
    n_rows = step.steps // step.fast_steps + 1
    total, mean = np.zeros(n_rows), np.zeros((n_rows, columns_of))
    total[pushes.all_step // step.fast_steps] = pushes.all_mean_N
    own = pushes.stone < columns_of
    mean[pushes.step[own] // step.fast_steps, pushes.stone[own]] = pushes.mean_N[own]
    table = {"t_s": np.arange(n_rows) * step.fast_steps * step.dt_s, **plate_signals, "force_N": total,
             **{force_column(k + 1): mean[:, k] for k in range(columns_of)}}
    if not all(np.isfinite(values).all() for values in table.values()):
        raise RuntimeError("a signal holds a value that is no number")
    return table


def samples_of(fast: Columns, every: int, anti_alias: bool) -> Columns:
    """Every so many rows of the fast stream, as they are or behind the filter of analysis.signals.resampling, which has
    linear phase and no delay. It stands here since scipy.signal takes as long to import as a short run."""
    if not anti_alias:
        return {name: values[::every] for name, values in fast.items()}
    ahead = np.arange(-10 * every, 10 * every + 1)
    taps = np.sinc(ahead / every) * np.kaiser(len(ahead), 5.0)
    taps /= taps.sum()

    def low(values: np.ndarray) -> np.ndarray:
        around = np.lib.stride_tricks.sliding_window_view(np.pad(values, 10 * every, mode="edge"), len(taps))
        return around[::every] @ taps
    return {name: values[::every] if name == "t_s" else low(values) for name, values in fast.items()}


def read_events(file: Path, step: TimeStep) -> Columns:
    """Read the broken bonds, one row each: t_s, bond (1-based), agglomerate (1-based), place, mode, stress, energy,
    area."""
    return read_text_columns(file, step, {"bond": int, "agglomerate": int, "x_m": float, "y_m": float, "z_m": float,
                                          "mode": str, "stress_Pa": float, "energy_J": float, "area_m2": float})


def read_text_columns(file: Path, step: TimeStep, kinds: dict[str, type]) -> Columns:
    """Read a file of the engine with values between commas under a line of names, "step" and those of `kinds`, with
    the time t_s in place of the step; no rows where there is no file. Raises ValueError for another file."""
    kinds = {"step": int} | kinds
    head, *lines = file.read_text().splitlines() if file.exists() else [",".join(kinds)]
    if head.split(",") != list(kinds):
        raise ValueError(f"{file}: its first line is not {','.join(kinds)}")
    rows = [line.split(",") for line in lines]
    if any(len(row) != len(kinds) for row in rows):
        raise ValueError(f"{file}: cut off or damaged")
    columns: Columns = {name: np.array([kinds[name](row[k]) for row in rows], kinds[name])
                        for k, name in enumerate(kinds)}
    return {"t_s": columns.pop("step") * step.dt_s, **columns}
