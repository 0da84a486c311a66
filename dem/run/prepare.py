"""From a scene to everything that a run needs: packings, time step and the plate's modes."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from common.files.cache import BeingFound, not_waiting
from common.process.messages import told
from common.scene.error_laws import with_cut_off
from common.scene.plate import FlexiblePlate
from common.scene.scene import Scene, scene_hash
from common.tables import InputError, refused_in
from dem.deck.plausible import warnings_of, warnings_of_fragments
from dem.deck.time_step import TimeStep, contact_time_of_any_s, mobility_of_stones_1_kg, step_limits, time_step
from dem.stones.arrangement import stones_of
from dem.stones.assembly import Assembly, assemble
from dem.stones.stone import Stone, entry_of, places_m
from plate_fem.elements.mesh import highest_frequency_Hz
from plate_fem.modes import PlateModes, modes_for_loads
from plate_fem.plausible import energy_left_out, warnings_of_plate

LATEST_ARRIVAL_s = 1e6  # up to which a number of DEM steps is exact


@dataclass
class Stages:
    """Wall time by stage, s. Stages of the work `shown` are told; "": none is."""

    wall_time_s: dict[str, float] = field(default_factory=dict)
    shown: str = ""

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Add the time spent within to the stage `name`."""
        start = time.perf_counter()
        with told(f"{self.shown}: {name}" if self.shown else ""):
            yield
        self.wall_time_s[name] = self.wall_time_s.get(name, 0.0) + time.perf_counter() - start

    def copy(self) -> "Stages":
        """The times so far, to which each of several runs adds its own."""
        return Stages(dict(self.wall_time_s), self.shown)


@dataclass
class PreparedRun:
    """A scene made ready to run. `modes` is None for a rigid plate; another plate's modes may take their place."""

    source: str  # the scene's file, for messages
    given: Scene  # as the file gives it
    scene: Scene  # with what the file left to be found filled in
    assembly: Assembly
    step: TimeStep
    modes: PlateModes | None
    plate_energy_left_out: float | None  # share that would belong to modes above those kept
    stages: Stages
    warnings: list[str] = field(default_factory=list)  # dem/deck/plausible.py

    @property
    def scene_hash(self) -> str:
        """Of the scene as the file gives it."""
        return scene_hash(self.given)

    @property
    def flexible(self) -> bool:
        """Does the plate move?"""
        return self.modes is not None


def warned(source: str, warnings: list[str]) -> list[str]:
    """The warnings, told on the error output too."""
    for line in warnings:
        print(f"warning: {source}: {line}", file=sys.stderr)
    return warnings


def _refuse_late(stones: list[Stone], scene: Scene, file: str) -> None:
    """Stones that enter later need bodies in free flight, who say what has left, and those are known to one rank."""
    for k, stone in enumerate(stones):
        if stone.arrival_s > LATEST_ARRIVAL_s:
            raise InputError(f"{file}: stones: stone {k + 1} arrives at {stone.arrival_s:g} s: must be at most "
                             f"{LATEST_ARRIVAL_s:g} s")
    late = [k for k, stone in enumerate(stones)
            if scene.stones.is_stream or entry_of(stone, scene.gravity_vector_m_s2).is_late]
    for key, value, allowed, refused in (
            ("ranks", scene.ranks, "1", scene.ranks > 1),
            ("time.free_flight_tolerance", scene.time.free_flight_tolerance, "above 0",
             scene.time.free_flight_tolerance == 0)):
        if late and refused:
            raise InputError(f"{file}: {key} = {value:g}: must be {allowed} where a stone enters later than at once, "
                             f"as stone {late[0] + 1} does, since it takes bodies in free flight to let stones go")


def prepare(scene: Scene, source: str, cache: Path | None, show_progress: bool = False) -> PreparedRun:
    """Check, pack, find the modes and choose the time step.

    `source` is the scene's file, for messages; `cache` a directory that keeps packings and the plate's modes. What
    can be refused without the plate is refused before its modes are sought, but where another process packs the same
    stones: the two share the work, and this one seeks the modes while the other packs. Raises InputError before
    anything is written.
    """
    stages, stones = Stages(shown=scene.name if show_progress else ""), stones_of(scene, source)
    _refuse_late(stones, scene, source)
    warnings = warned(source, warnings_of(scene, stones))

    resolved = scene
    if isinstance(scene.plate, FlexiblePlate):
        contact_s = contact_time_of_any_s(scene, stones)
        plate = with_cut_off(scene.plate, scene.tolerance, contact_s, scene.stones.agglomerate is not None)
        resolved = scene.model_copy(update={"plate": plate})

    def seek_modes() -> None:
        """Into the cache."""
        if isinstance(resolved.plate, FlexiblePlate):
            with suppress(BeingFound), not_waiting(), refused_in(source, "plate"):
                modes_for_loads(resolved.plate, cache, places_m(stones))

    with stages("packing"):
        with refused_in(source, "stones.agglomerate"):
            assembly = assemble(scene, stones, cache, seek_modes)
    warnings += warned(source, warnings_of_fragments(scene, assembly))
    limits = step_limits(scene, assembly, source)
    modes, mobility, left_out = None, None, None
    if isinstance(resolved.plate, FlexiblePlate):
        with stages("modes"):
            left_out = energy_left_out(highest_frequency_Hz(resolved.plate), limits.stone_contact_time_s)
            warnings += warned(source, warnings_of_plate(resolved.plate, left_out))
            with refused_in(source, "plate"):
                modes = modes_for_loads(resolved.plate, cache, places_m(stones))
        mobility = mobility_of_stones_1_kg(modes, stones)
    step = time_step(scene, limits, source, mobility)
    return PreparedRun(source, scene, resolved, assembly, step, modes, left_out, stages, warnings)
