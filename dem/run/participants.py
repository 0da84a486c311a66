"""The plate of a run, rigid or flexible: what it answers the engine, what it records, and the energy that it holds.

Both kinds of plate have the same methods, so that a run need not ask which one it has.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from common.files.parquet import Columns
from common.scene.plate import FlexiblePlate
from dem.coupling.checkpoint import BY_HAND, State, plate_file, read_plate_state, write_plate_state
from dem.coupling.monitor import PlateMonitor
from dem.coupling.participant import CouplingState, PlateParticipant
from dem.coupling.pipes import PlatePipes
from dem.deck.pictures import picture_schedule
from dem.record.energy_balance import PlateEnergy
from dem.record.recorder import PlateRecorder
from dem.record.vtk_file import Mesh
from dem.run.paraview import PlateMeshes
from dem.run.prepare import PreparedRun
from plate_fem.contact_stress import HertzContact
from plate_fem.modes import PlateModes
from plate_fem.motion import ModalMotion
from plate_fem.recorded import FILE


class RigidPlateParticipant:
    """A plate that does not move: it answers nothing, records nothing and holds no energy."""

    n_modes = 0

    def restore(self, deck: Path, dem_step: int, identity: str) -> None:
        """A rigid plate has no state to go on from."""

    @contextmanager
    def connected(self, deck: Path) -> Iterator[None]:
        """The engine does not look for a rigid plate."""
        yield

    def take_part(self, deck: Path, alive: Callable[[], bool], progress: Callable[[int], None],
                  identity: str = BY_HAND) -> None:
        """The engine asks a rigid plate nothing."""

    def signals(self, dem_steps: range) -> Columns:
        """No columns."""
        return {}

    def write_motion(self, file: Callable[[str], Path]) -> None:
        """No motion."""

    def energy(self) -> PlateEnergy:
        """No energy."""
        return PlateEnergy()

    def bending(self) -> dict[str, dict[str, float]]:
        """A rigid plate does not bend."""
        return {}

    def meshes(self, dem_step: int, contacts: list[HertzContact]) -> dict[str, Mesh]:
        """A rigid plate is not shown."""
        return {}


class FlexiblePlateParticipant:
    """A plate that moves in its modes, answers the engine and is recorded."""

    def __init__(self, prepared: PreparedRun, modes: PlateModes):
        scene, step = prepared.scene, prepared.step
        self._modes, self._step = modes, step
        assert isinstance(scene.plate, FlexiblePlate)
        self._meshes = PlateMeshes(modes, scene.plate)
        self._motion = ModalMotion(modes, step.co_step * step.dt_s)
        self._recorder = PlateRecorder(scene, modes, self._motion, step,
                                       picture_schedule(scene, prepared.assembly, step),
                                       PlateMonitor(scene, prepared.assembly))
        self._state = CouplingState()
        self._pipes: PlatePipes | None = None

    @property
    def n_modes(self) -> int:
        """Number of modes, residual ones included."""
        return len(self._motion.amplitude)

    def restore(self, deck: Path, dem_step: int, identity: str) -> None:
        """Go on from the plate's half of the checkpoint of the run `identity` at `dem_step`. Raises InputError if it
        cannot be read."""
        kept = read_plate_state(plate_file(deck / "checkpoint", dem_step), identity)
        state = self._state
        state.dem_step, state.co_steps, state.extrapolated_co_steps = (int(number) for number in kept["coupling"])
        state.last_force = kept["last_force"]
        self._motion.set_state(_part("motion_", kept))
        self._recorder.set_state(_part("plate_", kept))

    def _checkpoint(self) -> State:
        state = self._state
        assert state.last_force is not None  # the first message was answered
        return {"coupling": np.array([state.dem_step, state.co_steps, state.extrapolated_co_steps]),
                "last_force": state.last_force,
                **{f"motion_{name}": value for name, value in self._motion.get_state().items()},
                **{f"plate_{name}": value for name, value in self._recorder.get_state().items()}}

    @contextmanager
    def connected(self, deck: Path) -> Iterator[None]:
        """Within it, the pipes that the engine must find are in the directory `deck`."""
        self._pipes = PlatePipes(deck, self.n_modes)
        try:
            yield
        finally:
            self._pipes.close()

    def take_part(self, deck: Path, alive: Callable[[], bool], progress: Callable[[int], None],
                  identity: str = BY_HAND) -> None:
        """Answer the engine until it has finished. `alive` tells whether it still runs; `progress` is called with the
        DEM steps that were recorded; checkpoints carry the `identity` of the run. Raises CouplingError, or
        Unstable if the plate gets too much energy."""
        assert self._pipes is not None  # connected

        def record(dem_steps: range, states: np.ndarray, force: np.ndarray, last_force: np.ndarray) -> None:
            self._recorder(dem_steps, states, force, last_force)
            progress(dem_steps[-1])

        self._pipes.open(alive)
        participant = PlateParticipant(self._motion, self._step, record, self._state)
        participant.run(self._pipes, lambda dem_step: write_plate_state(deck / "checkpoint", dem_step,
                                                                        self._checkpoint(), identity))

    def signals(self, dem_steps: range) -> Columns:
        """The plate's signals, one row for each of `dem_steps`. Raises RuntimeError if others were recorded."""
        if self._recorder.steps != list(dem_steps):
            raise RuntimeError("the plate was not recorded at every row of the fast stream")
        return self._recorder.signals()

    def write_motion(self, file: Callable[[str], Path]) -> None:
        """Write the modes and their state at the samples, to the path that `file` gives."""
        self._recorder.motion(self._modes).write(file(FILE))

    def energy(self) -> PlateEnergy:
        """Where the plate's energy is now."""
        motion = self._motion
        return PlateEnergy(*motion.energies, motion.damped_J, motion.work_J)

    def bending(self) -> dict[str, dict[str, float]]:
        """The largest stress of bending, anywhere and at the rods, for the report on yield."""
        peak = self._recorder.bending
        return {"bending": peak.result(), "bending_at_rods": peak.result(at_rods=True)}

    def meshes(self, dem_step: int, contacts: list[HertzContact]) -> dict[str, Mesh]:
        """What the picture at `dem_step` shows of the plate and of the contacts on it."""
        return self._meshes.meshes(self._recorder.view_amplitude[dem_step], contacts)


PlateOfRun = RigidPlateParticipant | FlexiblePlateParticipant


def participant_of(prepared: PreparedRun) -> PlateOfRun:
    """The plate of a run, at rest."""
    return RigidPlateParticipant() if prepared.modes is None else FlexiblePlateParticipant(prepared, prepared.modes)


def _part(prefix: str, state: State) -> State:
    return {name.removeprefix(prefix): value for name, value in state.items() if name.startswith(prefix)}
