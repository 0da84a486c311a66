"""The streams of a run: what the plate did, what the stones pushed, which bonds broke."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

from common.parquet import write_parquet
from common.plate import FlexiblePlate
from common.scene import Scene
from dem.coupling.participant import PlateStates
from dem.deck.time_step import TimeStep
from plate_fem.modes import PlateModes
from plate_fem.motion import ModalMotion
from plate_fem.stress import StressPeak


class PlateRecorder:
    """Collects the plate's state at each row of the fast stream, and its modal amplitudes at each picture.

    The signals of the rows are computed in blocks, since a product of matrices costs little more than one of vectors.
    `check(t_s, total_J)` is called with the energy of each block, arrays (k,).
    """

    BLOCK = 128  # rows

    def __init__(self, scene: Scene, modes: PlateModes, motion: ModalMotion, step: TimeStep, view_steps: int | None,
                 check: Callable[[np.ndarray, np.ndarray], None]):
        self._motion = motion
        self._step = step
        self._view_steps = view_steps
        self._check = check
        assert isinstance(scene.plate, FlexiblePlate)  # the other has no motion to record
        sensors = scene.plate.sensors
        self._mean = modes.mean_shape
        self._sensor = modes.shape_at(np.array([[s.x_m, s.y_m] for s in sensors]).reshape(-1, 2))
        self._rod = modes.rod_force
        rods = [f"rod_{k + 1}_N" for k in range(len(self._rod))]
        self.columns = ["u_m", "v_m_s", "a_m_s2", "kinetic_J", "internal_J", "total_J",
                        *(f"acc_{s.name}_m_s2" for s in sensors), *rods]
        self.steps: list[int] = []
        self.view_amplitude: list[np.ndarray] = []
        self.bending = StressPeak(modes, scene.plate.rods)
        self._blocks: list[np.ndarray] = []
        self._waiting: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []  # amplitude, rate, modal force

    def __call__(self, dem_steps: range, states: PlateStates, modal_forces: list[np.ndarray]) -> None:
        """Record rows at `dem_steps`: amplitude and rate of each, and the force on it, arrays (modes,) that are not
        changed later."""
        if self._view_steps:
            for dem_step in range(-(-dem_steps[0] // self._view_steps) * self._view_steps, dem_steps[-1] + 1,
                                  self._view_steps):
                self.view_amplitude.append(states[dem_steps.index(dem_step)][0].copy())
        self.steps.extend(dem_steps)
        self._waiting.extend((amplitude, rate, force)
                             for (amplitude, rate), force in zip(states, modal_forces, strict=True))
        while len(self._waiting) >= self.BLOCK:
            self._evaluate()

    def _evaluate(self) -> None:
        """Compute the signals of the rows that wait, of one block at most."""
        if not self._waiting:
            return
        first = len(self.steps) - len(self._waiting)
        amplitude, rate, force = (np.array(values) for values in zip(*self._waiting[:self.BLOCK], strict=True))
        t_s = np.array(self.steps[first:first + len(amplitude)]) * self._step.dt_s
        acceleration = self._motion.acceleration_at(amplitude, rate, force)
        kinetic, internal = self._motion.energies_at(amplitude, rate)
        self._check(t_s, kinetic + internal)
        self._blocks.append(np.column_stack([
            amplitude @ self._mean, rate @ self._mean, acceleration @ self._mean, kinetic, internal, kinetic + internal,
            acceleration @ self._sensor.T, amplitude @ self._rod.T]))
        self.bending.add(t_s, amplitude)
        del self._waiting[:self.BLOCK]

    def get_state(self) -> dict[str, np.ndarray]:
        """All that was recorded, for `set_state`. The rows that wait for their block still wait, so that a run that
        goes on from here computes the same blocks."""
        return {"rows": self._rows(), "steps": np.array(self.steps), "waiting": np.array(self._waiting),
                "view_amplitude": np.array(self.view_amplitude), **self.bending.get_state()}

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Go on from what `get_state` gave."""
        self._blocks, self.steps = [state["rows"]], state["steps"].tolist()
        self._waiting = [(amplitude, rate, force) for amplitude, rate, force in state["waiting"]]
        self.view_amplitude = list(state["view_amplitude"])
        self.bending.set_state(state)

    def _rows(self) -> np.ndarray:
        return np.concatenate([np.empty((0, len(self.columns))), *self._blocks])

    def frame(self) -> pd.DataFrame:
        """The signals of all rows."""
        self._evaluate()
        return pd.DataFrame(self._rows(), columns=self.columns)


def read_forces(file: Path, n_agglomerates: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the DEM step (k,) at the end of each co-step with contact, and the mean push on the plate (k, n) over it
    in N."""
    record = np.dtype([("step", "<i8"), ("force_N", "<f8", (n_agglomerates,))])
    data = np.fromfile(file, dtype=record)
    return data["step"], data["force_N"]


def fast_stream(step: TimeStep, forces: tuple[np.ndarray, np.ndarray], plate_signals: pd.DataFrame) -> pd.DataFrame:
    """All rows at the fast rate. A force is the mean over the row's interval; the plate's state is at its end.

    `forces` is what `read_forces` gives, `plate_signals` has a row for each of the fast stream. Raises RuntimeError if
    a signal holds a value that is no number.
    """
    n_rows = step.steps // step.fast_steps + 1
    time = np.arange(n_rows) * step.fast_steps * step.dt_s
    table = pd.concat([pd.DataFrame({"t_s": time}), plate_signals], axis=1)
    steps, force = forces
    row = -(-steps // step.fast_steps)
    mean = np.zeros((n_rows, force.shape[1]))
    np.add.at(mean, row, force * (step.co_step / step.fast_steps))
    table["force_N"] = mean.sum(axis=1)
    for k in range(force.shape[1]):
        table[f"force_{k + 1:02d}_N"] = mean[:, k]
    if not np.all(np.isfinite(table.to_numpy())):
        raise RuntimeError("a signal holds a value that is no number")
    return table


def write_streams(directory: Path, fast: pd.DataFrame, step: TimeStep) -> pd.DataFrame:
    """Write fast.parquet and its rows at the samples, signals.parquet. Returns the latter."""
    write_parquet(fast, directory / "fast.parquet")
    signals = fast.iloc[:: step.sample_steps // step.fast_steps].reset_index(drop=True)
    write_parquet(signals, directory / "signals.parquet")
    return signals


def read_events(file: Path, step: TimeStep) -> pd.DataFrame:
    """Read the broken bonds, one row each: t_s, bond (1-based), agglomerate (1-based), place, mode, stress, energy,
    area."""
    columns = ["t_s", "bond", "agglomerate", "x_m", "y_m", "z_m", "mode", "stress_Pa", "energy_J", "area_m2"]
    if not file.exists():
        return pd.DataFrame({c: pd.Series(dtype=str if c == "mode" else int if c in columns[1:3] else float)
                             for c in columns})
    events = pd.read_csv(file, dtype={"mode": str})
    events.insert(0, "t_s", events.pop("step") * step.dt_s)
    return events[columns]
