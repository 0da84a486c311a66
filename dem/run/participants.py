"""The plate of a run, rigid or flexible: what it answers the engine, what it records, and the energy that it holds.

Both kinds of plate have the same methods, so that a run need not ask which one it has.

The engine's wall aims at where the plate is predicted to be at the next message. The prediction extrapolates the modal
force linearly, 2 F0 - F1 from the last two. When the true mean force of that time is known, the plate moves under it,
exactly. The scheme is of second order in the time between messages, and conserves the impulse to round-off.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from common.channels import DAMPING_IMPULSE, RESPONSES, RODS_MOMENTUM, SENSORS, rod_column, sensor_column
from common.files.parquet import Columns
from common.scene.plate import FlexiblePlate
from common.scene.scene import Scene
from dem.coupling.pipes import CheckpointMessage, CouplingError, FinishedMessage, ForceMessage, PlatePipes
from dem.deck.pictures import PictureSchedule, picture_schedule
from dem.deck.time_step import TimeStep
from dem.run.directory import BY_HAND, State, half_of, read_plate_state, write_plate_state
from dem.run.energy_balance import PlateEnergy, PlateMonitor
from dem.run.paraview import Mesh, PlateMeshes
from dem.run.prepare import PreparedRun
from plate_fem.modes import PlateModes
from plate_fem.motion import ModalMotion, RecordedMotion
from plate_fem.stress import HertzContact, StressPeak

Recorder = Callable[[range, np.ndarray, np.ndarray, np.ndarray], None]


@dataclass
class PlateParticipant:
    """A plate in `motion` that answers the engine.

    How far the coupling is: the DEM step, the last modal force (modes,), which is None before the first row is
    recorded, the co-steps over which that force is the mean, and those that the engine then asked to extrapolate.

    `record(dem_steps, states, force, last_force)` is called with one or several rows of the fast stream: amplitude and
    rate (rows, 2, modes) at each, and the force then acting, (modes,), which is another one at the last row. There it
    is the mean over the time that ends there, extrapolated by half of that time to its end.
    """

    motion: ModalMotion
    step: TimeStep
    record: Recorder
    dem_step: int = 0
    last_force: np.ndarray | None = None
    co_steps: int = 0
    extrapolated_co_steps: int = 0

    def run(self, pipes: PlatePipes, keep: Callable[[int], None] = lambda dem_step: None) -> None:
        """Answer the engine until it has finished. `keep(dem_step)` is called when the engine has written its half of a
        checkpoint. Raises CouplingError."""
        none = np.zeros_like(self.motion.amplitude)
        if self.last_force is None:
            self.last_force = none
            self.record(range(1), self.motion.state[None], none, none)
        while not isinstance(message := pipes.receive(), FinishedMessage):
            if isinstance(message, CheckpointMessage):
                keep(message.step)
                pipes.confirm(message)
            else:
                amplitude, rate = self._move(message)
                pipes.answer(message.step, self.motion.reach_m(amplitude, rate), amplitude, rate)
        pipes.confirm(message)
        self._advance(none, none, (self.step.steps - self.dem_step) // self.step.co_step)

    def _move(self, message: ForceMessage) -> tuple[np.ndarray, np.ndarray]:
        """Move over the time that the message covers; return the state predicted for when the engine asked. Raises
        CouplingError if that time does not begin where the last message ended, or ends after the run."""
        force = message.modal_force
        due = self.dem_step + message.co_steps * self.step.co_step
        if message.step != due or due > self.step.steps:
            raise CouplingError(f"the engine sent step {message.step} after {message.co_steps} co-steps from step "
                                f"{self.dem_step}; allowed is {due}, up to the last one, {self.step.steps}")
        slope = self._trend(message) * (force - self.last_force)
        self._advance(force, force + slope * (message.co_steps / 2), message.co_steps)
        self.last_force, self.co_steps = force, message.co_steps
        self.extrapolated_co_steps = message.extrapolated_co_steps
        extrapolated = force + slope * ((message.co_steps + message.extrapolated_co_steps) / 2)
        amplitude, rate = self.motion.predict(extrapolated, message.extrapolated_co_steps)
        return amplitude, rate

    def _trend(self, message: ForceMessage) -> float:
        """One over the co-steps between the middles of the last two forces, which are means. It is 0 after free flight,
        when there is no trend to extrapolate."""
        gapless = 0 < message.co_steps == self.extrapolated_co_steps
        return 2 / (self.co_steps + message.co_steps) if gapless else 0.0

    def _advance(self, force: np.ndarray, force_at_end: np.ndarray, co_steps: int) -> None:
        """Move over `co_steps` under a constant force, and record each row of the fast stream."""
        motion, step, now = self.motion, self.step, self.dem_step
        end = now + co_steps * step.co_step
        while now < end:
            rows = min((end - now) // step.fast_steps, motion.ROWS)
            if rows > 1 and now % step.fast_steps == 0:
                states = motion.advance_rows(force, step.fast_steps // step.co_step, rows)
                steps = range(now + step.fast_steps, now + rows * step.fast_steps + 1, step.fast_steps)
            else:
                stop = min(end, (now // step.fast_steps + 1) * step.fast_steps)
                motion.advance(force, (stop - now) // step.co_step)
                states, steps = motion.state[None], range(stop, stop + 1)
            now = steps[-1]
            if now % step.fast_steps == 0:
                self.record(steps, states, force, force_at_end if now == end else force)
        self.dem_step = now


class PlateRecorder:
    """Collects the plate's state at each row of the fast stream, its modal state at the samples, and its modal
    amplitudes where there may be a picture. `motion`: that of the plate, at rest until it is advanced.

    The signals of the rows are computed in blocks, since a product of matrices costs little more than one of vectors.
    `check(t_s, total_J)` is called with the energy of each block, arrays (k,).
    """

    BLOCK = 128  # rows

    def __init__(self, scene: Scene, modes: PlateModes, step: TimeStep, pictures: PictureSchedule | None,
                 check: Callable[[np.ndarray, np.ndarray], None]):
        self.motion = ModalMotion(modes, step.co_step * step.dt_s)
        self._modes, self._step, self._pictures, self._check = modes, step, pictures, check
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
        acceleration = self.motion.acceleration_at(amplitude, rate, force)
        samples = self._block[:, :self._waiting][:, -self._evaluated % self._every::self._every]
        self._samples.append(samples.astype(np.float32))
        kinetic, internal = self.motion.energies_at(amplitude, rate)
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

    def recorded(self) -> RecordedMotion:
        self._evaluate()
        t_s = np.array(self.steps[::self._every]) * self._step.dt_s
        return RecordedMotion(self._modes, t_s, *self._of_samples())


class PlateOfRun:
    """The plate that takes part in a run. This one is rigid: the engine asks it nothing, it records nothing and holds
    no energy."""

    n_modes = 0  # residual ones included

    def restore(self, deck: Path, dem_step: int, identity: str) -> None:
        """Go on from the plate's half of the checkpoint of the run `identity` at `dem_step`. Raises InputError if it
        cannot be read."""

    @contextmanager
    def connected(self, deck: Path) -> Iterator[None]:
        """Within it, the pipes that the engine must find are in the directory `deck`."""
        yield

    def take_part(self, deck: Path, alive: Callable[[], bool], progress: Callable[[int], None],
                  identity: str = BY_HAND) -> None:
        """Answer the engine until it has finished. `alive` tells whether it still runs; `progress` is called with the
        DEM steps that were recorded; checkpoints carry the `identity` of the run. Raises CouplingError, or
        Unstable if the plate gets too much energy."""

    def signals(self, dem_steps: range) -> Columns:
        """The plate's signals, one row for each of `dem_steps`. Raises RuntimeError if others were recorded."""
        return {}

    def recorded_motion(self) -> RecordedMotion | None:
        """The modes and their state at the samples."""
        return None

    def energy(self) -> PlateEnergy:
        """Where the plate's energy is now."""
        return PlateEnergy()

    def bending(self) -> dict[str, dict[str, float]]:
        """The largest stress of bending, anywhere and at the rods, for the report on yield."""
        return {}

    def meshes(self, dem_step: int, contacts: list[HertzContact]) -> dict[str, Mesh]:
        """What the picture at `dem_step` shows of the plate and of the contacts on it."""
        return {}


class FlexiblePlateOfRun(PlateOfRun):
    """A plate that moves in its modes, answers the engine and is recorded."""

    def __init__(self, prepared: PreparedRun, modes: PlateModes):
        scene, step = prepared.scene, prepared.step
        assert isinstance(scene.plate, FlexiblePlate)
        self._meshes = PlateMeshes(modes, scene.plate)
        self._recorder = PlateRecorder(scene, modes, step, picture_schedule(scene, prepared.assembly, step),
                                       PlateMonitor(scene, prepared.assembly))
        self._motion = self._recorder.motion
        self._participant = PlateParticipant(self._motion, step, self._recorder)
        self.n_modes = len(modes.frequency_Hz)
        self._pipes: PlatePipes | None = None

    def restore(self, deck: Path, dem_step: int, identity: str) -> None:
        kept = read_plate_state(half_of(deck / "checkpoint", "plate", dem_step), identity)
        one = self._participant
        one.dem_step, one.co_steps, one.extrapolated_co_steps = (int(number) for number in kept["coupling"])
        one.last_force = kept["last_force"]
        self._motion.set_state(_part("motion_", kept))
        self._recorder.set_state(_part("plate_", kept))

    def _checkpoint(self) -> State:
        one = self._participant
        assert one.last_force is not None  # the first message was answered
        return {"coupling": np.array([one.dem_step, one.co_steps, one.extrapolated_co_steps]),
                "last_force": one.last_force,
                **{f"motion_{name}": value for name, value in self._motion.get_state().items()},
                **{f"plate_{name}": value for name, value in self._recorder.get_state().items()}}

    @contextmanager
    def connected(self, deck: Path) -> Iterator[None]:
        self._pipes = PlatePipes(deck, self.n_modes)
        try:
            yield
        finally:
            self._pipes.close()

    def take_part(self, deck: Path, alive: Callable[[], bool], progress: Callable[[int], None],
                  identity: str = BY_HAND) -> None:
        assert self._pipes is not None  # connected

        def record(dem_steps: range, states: np.ndarray, force: np.ndarray, last_force: np.ndarray) -> None:
            self._recorder(dem_steps, states, force, last_force)
            progress(dem_steps[-1])

        self._pipes.open(alive)
        self._participant.record = record
        self._participant.run(self._pipes, lambda dem_step: write_plate_state(deck / "checkpoint", dem_step,
                                                                              self._checkpoint(), identity))

    def signals(self, dem_steps: range) -> Columns:
        if self._recorder.steps != list(dem_steps):
            raise RuntimeError("the plate was not recorded at every row of the fast stream")
        return self._recorder.signals()

    def recorded_motion(self) -> RecordedMotion | None:
        return self._recorder.recorded()

    def energy(self) -> PlateEnergy:
        motion = self._motion
        return PlateEnergy(*motion.energies, motion.damped_J, motion.work_J)

    def bending(self) -> dict[str, dict[str, float]]:
        peak = self._recorder.bending
        return {"bending": peak.result(), "bending_at_rods": peak.result(at_rods=True)}

    def meshes(self, dem_step: int, contacts: list[HertzContact]) -> dict[str, Mesh]:
        return self._meshes.meshes(self._recorder.view_amplitude[dem_step], contacts)


def participant_of(prepared: PreparedRun) -> PlateOfRun:
    """The plate of a run, at rest."""
    return PlateOfRun() if prepared.modes is None else FlexiblePlateOfRun(prepared, prepared.modes)


def _part(prefix: str, state: State) -> State:
    return {name.removeprefix(prefix): value for name, value in state.items() if name.startswith(prefix)}
