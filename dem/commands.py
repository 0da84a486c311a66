"""What the commands on one scene answer: `run`, `resume`, `deck`, `plate`, `calibrate` and `build-engine`."""

import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import nan
from pathlib import Path
from typing import Any, Self

from common.files.cache import user_cache
from common.files.output_directory import files_in, is_stamped, refuse_below_a_file, refuse_foreign_file, refuse_place
from common.resources import resource
from common.result import Result
from common.scene.scene import Scene, changed_scene
from common.tables import InputError
from dem.coupling.launch import build_engine as make_engine
from dem.deck.render import write_deck
from dem.run import run as runs
from dem.run.directory import SUFFIX
from dem.run.energy_balance import PlateEnergy
from dem.run.participants import participant_of
from dem.run.prepare import prepare

Changes = Sequence[tuple[str, Any]]  # values of the scene by dotted key


@dataclass(frozen=True)
class RunResult(Result):
    """What a finished run found; None for what a run of another version does not say."""

    directory: Path
    scene: str | None
    gangue_ratio: float
    status: str
    peak_force_N: float | None
    impulse_N_s: float | None
    n_bonds: int | None
    n_bonds_broken: int | None
    energy_closure: float | None  # of the balance in run.json
    wall_time_s: Mapping[str, float]  # by stage
    scene_hash: str | None

    @classmethod
    def of(cls, directory: Path, summary: Mapping[str, Any]) -> Self:
        """From what run.json says (common/run_summary.py)."""
        same = ("peak_force_N", "impulse_N_s", "n_bonds", "n_bonds_broken", "scene_hash")
        return cls(directory=directory, gangue_ratio=summary["gangue_ratio"], status=summary["status"],
                   scene=summary.get("scene", {}).get("name"), energy_closure=summary.get("energy", {}).get("closure"),
                   wall_time_s=summary.get("wall_time_s", {}), **{key: summary.get(key) for key in same})

    def words(self) -> Iterator[str]:
        peak_N, closure = (nan if value is None else value for value in (self.peak_force_N, self.energy_closure))
        yield (f"{self.scene} {self.gangue_ratio:4.0%}: peak force {peak_N:9.1f} N, "
               f"{self.n_bonds_broken} of {self.n_bonds} bonds broken, energy closes to {closure:.1e}, "
               f"{sum(self.wall_time_s.values()):.0f} s")


def run(scene_file: Path, out: Path, gangue_ratio: float | None = None, changes: Changes = (),
        walltime_s: float | None = None, overwrite: bool = False) -> RunResult:
    """Run a scene into the directory `out`, see `dem.run.run.run_scene`."""
    scene = _scene(scene_file, gangue_ratio, changes)
    return RunResult.of(out, runs.run_scene(scene, str(scene_file), out, True, walltime_s, overwrite))


def resume(out: Path, walltime_s: float | None = None) -> RunResult:
    """Go on with a run that was stopped or killed, see `dem.run.run.resume`."""
    summary = runs.resume(out, walltime_s=walltime_s)
    return RunResult.of(out.with_name(out.name.removesuffix(SUFFIX)), summary)


def _scene(scene_file: Path, gangue_ratio: float | None, changes: Changes) -> Scene:
    ratio = {} if gangue_ratio is None else {"stones.gangue_ratio": gangue_ratio}
    return changed_scene(scene_file, dict(changes) | ratio)


@dataclass(frozen=True)
class BatchResult(Result):
    """How many of many runs are finished, and by its directory why a run is not."""

    line = "{directory}: {finished} of {planned} runs finished"
    directory: Path
    planned: int
    finished: int
    failed: Mapping[str, str]


@dataclass(frozen=True)
class DeckResult(Result):
    line = "{deck}"
    deck: Path


def deck(scene_file: Path, out: Path, gangue_ratio: float | None = None, changes: Changes = ()) -> DeckResult:
    """Write the deck of a scene into `out`/deck, whole or not at all, and run nothing."""
    refuse_place(out)
    if out.exists():
        raise InputError(f"--out = {out}: must not exist yet")
    prepared = prepare(_scene(scene_file, gangue_ratio, changes), str(scene_file), user_cache(), True)
    try:
        with prepared.stages("deck"):
            write_deck(out / "deck", prepared.scene, prepared.assembly, prepared.step, prepared.modes)
    except BaseException:
        shutil.rmtree(out, ignore_errors=True)
        raise
    return DeckResult(out / "deck" / "deck.liggghts")


def plate(scene_file: Path, out: Path, gangue_ratio: float | None = None, changes: Changes = ()) -> PlateEnergy:
    """Be the plate of the deck in `out`, whose engine somebody starts, stops and debugs by hand."""
    prepared = prepare(_scene(scene_file, gangue_ratio, changes), str(scene_file), user_cache(), True)
    if not prepared.flexible:
        raise InputError(f"{scene_file}: plate.thickness_m is missing: only a plate that bends takes part in a run")
    participant, directory = participant_of(prepared), out / "deck"
    with participant.connected(directory):
        participant.take_part(directory, lambda: True, lambda dem_step: None)
    return participant.energy()


@dataclass(frozen=True)
class CalibrationResult(Result):
    """The file of a calibrated rock, the table of its virtual tests, what was fitted of its bonds, and the line by
    which the scene takes it, "" where it does."""

    file: Path
    tests: Path
    bond: Mapping[str, float]
    scene_line: str = ""

    def words(self) -> Iterator[str]:
        yield str(self.file)
        if self.scene_line:
            yield f"the scene takes it by {self.scene_line}"


def calibrate(material: str, scene_file: Path, out: Path | None = None, rock: str | None = None,
              targets: Path | None = None) -> CalibrationResult:
    """Fit the bonds of a material, see `dem.calibration.calibrate`, into `materials/` beside the scene where `out` is
    not given. What it replaces must be of an earlier calibration."""
    from dem.calibration.calibrate import AT_WORK, FITTED, calibrate as fit
    from dem.calibration.lab_sheet import find_sheet, named_in

    if out is None and scene_file.resolve().parent == resource("scenes").resolve():
        raise InputError(f"--out is missing: must be given where the scene, {scene_file}, is a shipped one")
    beside = scene_file.parent / "materials"
    out, name = out or beside, find_sheet(material, scene_file, rock, targets).rock
    file, tests, work = (out / f"{name}{ending}" for ending in (".toml", "_tests.csv", ".partial"))
    refuse_below_a_file(out / name)
    if "/" not in name:  # no material has such a name, as `fit` says
        refuse_foreign_file(file, is_stamped)
        refuse_foreign_file(tests, is_stamped)
        if not all(map(AT_WORK.fullmatch, files_in(work))):
            raise InputError(f"{work}: is there, and this program did not write it; move it away")
    found = fit(material, scene_file, out, rock=rock, targets=targets).rock
    taken = out.resolve() == beside.resolve() and named_in(scene_file, material) == name
    return CalibrationResult(file, tests, {key.removeprefix("bond_"): getattr(found, key) for key in FITTED},
                             "" if taken else f'materials.{material} = "{name}"')


@dataclass(frozen=True)
class EngineResult(Result):
    line = "{engine}"
    engine: Path


def build_engine() -> EngineResult:
    """Build the engine, where Debian's libliggghts-dev is installed, see `dem.coupling.launch`."""
    return EngineResult(make_engine())
