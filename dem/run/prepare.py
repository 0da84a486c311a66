"""From a scene to everything that a run needs: packings, time step and the plate's modes."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from common.files.cache import BeingFound, not_waiting
from common.process.messages import told
from common.scene.plate import FlexiblePlate
from common.scene.scene import Scene, scene_hash
from common.tables import InputError, refused_in
from dem.deck.plausible import warnings_of, warnings_of_fragments
from dem.deck.time_step import TimeStep, contact_time_of_any_s, step_limits, time_step
from dem.stones.arrangement import stones_of
from dem.stones.assembly import Assembly, assemble
from dem.stones.stone import Stone, entry_of, places_m
from plate_fem.impact import struck_plate
from plate_fem.modes import PlateModes, modes_for_loads

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
    warnings: list[str] = field(default_factory=list)  # dem/deck/plausible.py, plate_fem/impact.py

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
    resolved = with_cut_off(scene, stones)
    plate = resolved.plate
    of_plate = partial(refused_in, source, "plate")

    def seek_modes() -> None:
        """Into the cache."""
        if isinstance(plate, FlexiblePlate):
            with suppress(BeingFound), not_waiting(), of_plate():
                modes_for_loads(plate, cache, places_m(stones))

    with stages("packing"), refused_in(source, "stones.agglomerate"):
        assembly = assemble(scene, stones, cache, seek_modes)
    warnings += warned(source, warnings_of_fragments(scene, assembly))
    limits = step_limits(scene, assembly, source)
    modes, mobility, left_out = None, None, None
    if isinstance(plate, FlexiblePlate):
        with stages("modes"), of_plate():
            arrival_s = np.array([stone.arrival_s for stone in stones])
            modes, mobility, left_out = struck_plate(plate, places_m(stones), arrival_s, limits.stone_contact_time_s,
                                                     cache, lambda lines: warnings.extend(warned(source, lines)))
    step = time_step(scene, limits, source, mobility)
    return PreparedRun(source, scene, resolved, assembly, step, modes, left_out, stages, warnings)


def with_cut_off(scene: Scene, stones: list[Stone]) -> Scene:
    """The scene with the `max_frequency_Hz` of its plate, where it leaves that to be found."""
    plate = scene.plate
    if not isinstance(plate, FlexiblePlate) or plate.max_frequency_Hz is not None:
        return scene
    _, _, of_modes = scene.settings
    highest_Hz = 1 / (of_modes * contact_time_of_any_s(scene, stones))
    return scene.model_copy(update={"plate": plate.model_copy(update={"max_frequency_Hz": highest_Hz})})
