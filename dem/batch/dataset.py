"""A data set for recognition: many impacts, drawn at random by a plan; what is there and unchanged is not run again.

A plan (TOML) names a scene and families of runs. A family has groups; a group is one draw of everything that the
family varies, run at some mixing ratios: OUT/FAMILY/GROUP/ratio_050. A family of streams has its own scene, and one run
a group. Draws follow from the plan's seed, the family's name and the group's number
alone, so that more groups or other families leave the rest as it is.
"""

import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from common.files.output_directory import at_work_in, remove_written
from common.scene.distribution import Spread
from common.scene.scene import Scene, changed_scene, ratio_name
from common.scene.stones import MOST_STONES
from common.tables import InputError, NotNegative, Positive, Refused, Table, check, read_toml, refused_in
from dem.batch.sweep import run_missing
from dem.commands import BatchResult
from dem.coupling.launch import check_engine
from dem.run.directory import KIND
from dem.run.run import run_scene
from dem.stones.arrangement import stones_of

QUIET_s = 0.05  # before the first stone of a stream: noise and offsets are learnt of it
NOT_KEPT = ("deck/", "energy.parquet")  # 6 MB a run; the deck follows from the scene in run.json

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
Share = Annotated[float, Field(ge=0, le=1)]


class Family(Table):
    """What its groups vary; a key that is absent leaves the scene as it is."""

    scene: str | None = None  # file, beside the plan; absent: that of the plan
    groups: Annotated[int, Field(ge=1)]
    runs_per_group: Annotated[int, Field(ge=1)]  # ratios of a group, spread over 0..1
    changes: dict[str, Any] = Field(default_factory=dict)  # dotted keys of the scene, for all runs of the family
    arrangement: bool = False  # which stones turn into gangue first
    packing: bool = False  # sub-spheres of every stone
    speed_m_s: tuple[Positive, Positive] | None = None  # evenly between these
    damping_ratio: tuple[NotNegative, NotNegative] | None = None  # of the plate, evenly between these


class StreamFamily(Table):
    """What its groups vary; a key that is absent leaves the scene as it is. Every group has a seed of its own, so that
    sizes, places, times and packings differ."""

    runs_per_group: ClassVar[int] = 1
    scene: str  # file, beside the plan: one with a rate in stones.drawn
    groups: Annotated[int, Field(ge=1)]
    stones: Annotated[int, Field(ge=1, le=MOST_STONES)]  # of a run; the stream lasts as long as its rate makes it
    rate_1_s: tuple[Positive, Positive]  # evenly between these in its logarithm
    gangue_ratio: tuple[Share, Share] = (0.0, 1.0)  # by mass, evenly between these, in whole percent
    speed_m_s: tuple[Positive, Positive] | None = None  # of all stones of a run, evenly between these
    sizes_m: Annotated[tuple[Spread, ...] | None, Field(min_length=1)] = None  # a run has one of these distributions
    rings_s: Positive = 0.1  # that the record goes on after the stream
    # Dotted keys of the scene, for all runs of the family.
    changes: dict[str, Any] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _ascend(self) -> Self:
        for key in ("rate_1_s", "gangue_ratio", "speed_m_s"):
            value = getattr(self, key)
            if value is not None and value[1] < value[0]:
                raise Refused(key, value, "must ascend")
        return self


class DatasetPlan(Table):
    scene: str | None = None  # file, beside the plan, of all families but those with their own
    seed: Annotated[int, Field(ge=0)]
    changes: dict[str, Any] = Field(default_factory=dict)  # for all runs
    # Seeds that groups with `packing` share: to find a packing and its compliances takes longer than a run, and they
    # are kept. Without it every group has its own.
    packings: Annotated[int, Field(ge=1)] | None = None
    families: dict[Name, Family] = Field(default_factory=dict)
    streams: dict[Name, StreamFamily] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _has_families(self) -> Self:
        if not self.families and not self.streams:
            raise Refused("families", "{}", "one family must be given, or one of streams")
        if self.scene is None and any(family.scene is None for family in self.families.values()):
            raise Refused("scene", None, "must be given with families that have none")
        for name in self.families.keys() & self.streams.keys():
            raise Refused(f"streams.{name}", "...", "must have another name than a family")
        return self


@dataclass(frozen=True)
class DatasetRun:
    directory: Path  # FAMILY/GROUP/ratio_050
    scene: Scene
    source: str


def plan_dataset(path: Path, runs: int | None = None) -> list[DatasetRun]:
    """Return every run of a plan, in an order in which all families progress alike; `runs`: of a family the first
    groups that have so many. Raises InputError."""
    if runs is not None and runs < 1:
        raise InputError(f"--runs = {runs}: must be at least 1")
    plan = check(DatasetPlan, read_toml(path), path)
    families: dict[str, Family | StreamFamily] = {**plan.families, **plan.streams}
    count = {name: family.groups if runs is None else min(family.groups, -(-runs // family.runs_per_group))
             for name, family in families.items()}
    groups = [(group, name) for name in families for group in range(count[name])]
    planned = []
    for group, name in sorted(groups, key=lambda g: (g[0] + 0.5) / count[g[1]]):
        rng = np.random.default_rng([plan.seed, zlib.crc32(name.encode()), group])
        family = families[name]
        scenes = _of_stream(path, plan, name, family, rng) if isinstance(family, StreamFamily) else _of_volley(
            path, plan, name, family, group, rng)
        for scene in scenes:
            assert scene.stones.gangue_ratio is not None
            directory = Path(name) / f"{group:03d}" / ratio_name(scene.stones.gangue_ratio)
            stones_of(scene, f"{path}: {directory}")
            planned.append(DatasetRun(directory, scene, f"{path}: {directory}"))
    return planned


def _of_volley(path: Path, plan: DatasetPlan, name: str, family: Family, group: int,
               rng: np.random.Generator) -> list[Scene]:
    """The scenes of one group of a family, one a mixing ratio."""
    scene_file = Path(path).parent / (family.scene or plan.scene or "")
    changes = plan.changes | family.changes | {"name": name}
    base = changed_scene(scene_file, changes)
    with refused_in(scene_file, "stones"):
        count = _count(base)
    drawn = changes | draw(family, base, rng)
    if family.packing and plan.packings is not None:
        drawn["stones.seed"] = _shared_packing(plan.packings, plan.seed, name, group)
    return [changed_scene(scene_file, drawn | {"stones.gangue_ratio": ratio})
            for ratio in _ratios(name, family, count, group, plan.seed)]


def _count(scene: Scene) -> int:
    """Number of stones of a volley, or of drawn ones."""
    return scene.stones.count or scene.stones.volley[0]


def _shared_packing(packings: int, seed: int, name: str, group: int) -> int:
    """One of so many seeds; the groups of a family go through all of them in an order of the family's own."""
    seeds = np.random.default_rng([seed, zlib.crc32(b"packings")]).integers(100_000, 1_000_000_000, packings)
    turn = np.random.default_rng([seed, zlib.crc32(b"packings"), zlib.crc32(name.encode())]).permutation(packings)
    return int(seeds[turn[group % packings]])


def _of_stream(path: Path, plan: DatasetPlan, name: str, family: StreamFamily, rng: np.random.Generator) -> list[Scene]:
    """The scene of one group of a family of streams."""
    drawn = plan.changes | family.changes | {"name": name} | draw_stream(family, rng)
    return [changed_scene(Path(path).parent / family.scene, drawn)]


def draw(family: Family, scene: Scene, rng: np.random.Generator) -> dict[str, Any]:
    """Draw the changes of one group, by dotted key of the scene."""
    count = _count(scene)
    changes: dict[str, Any] = {}
    if family.arrangement:
        changes["stones.gangue_order"] = (rng.permutation(count) + 1).tolist()
    if family.packing:
        changes["stones.seed"] = int(rng.integers(100_000, 1_000_000_000))
    if family.speed_m_s:
        changes["stones.speed_m_s"] = float(rng.uniform(*family.speed_m_s))
    if family.damping_ratio:
        changes["plate.damping_ratio"] = float(rng.uniform(*family.damping_ratio))
    if scene.scatter.drawn:
        changes["scatter.seed"] = int(rng.integers(1_000_000_000))
    return changes


def _ratios(name: str, family: Family, count: int, group: int, seed: int) -> list[float]:
    """`runs_per_group` ratios k/count, evenly spaced from a start that runs through all of them from group to group."""
    size, wanted = count + 1, min(family.runs_per_group, count + 1)
    start = np.random.default_rng([seed, zlib.crc32(name.encode())]).permutation(size)[group % size]
    return sorted({int((start + j * size // wanted) % size) / count for j in range(wanted)})


def build(plan_file: Path, out: Path, jobs: int, overwrite: bool = False, runs: int | None = None) -> BatchResult:
    """Run what is missing, `jobs` at a time, of all or of the first `runs` of each family. Runs of another scene are
    replaced with `overwrite` only. Raises InputError for bad input, Busy where another process is at work."""
    check_engine()
    planned = plan_dataset(plan_file, runs)
    sources = {out / one.directory: one.source for one in planned}

    def run(scene: Scene, out: Path) -> dict[str, Any]:
        summary = run_scene(scene, sources[out], out, overwrite=overwrite)
        remove_written(out, KIND, below=NOT_KEPT)
        return summary

    with at_work_in(out, "dataset") as lock:
        scenes = {out / one.directory: one.scene for one in planned}
        failed = run_missing(str(plan_file), scenes, run, jobs, lock, overwrite)
    return BatchResult(out, len(planned), len(planned) - len(failed),
                       {str(place.relative_to(out)): why for place, why in failed.items()})


def draw_stream(family: StreamFamily, rng: np.random.Generator) -> dict[str, Any]:
    """The changes of one group, by dotted key of the scene."""
    rate = float(np.exp(rng.uniform(*np.log(family.rate_1_s))))
    begin, duration = QUIET_s, family.stones / rate
    low, high = (round(100 * share) for share in family.gangue_ratio)
    changes: dict[str, Any] = {
        "stones.seed": int(rng.integers(100_000, 1_000_000_000)),
        "stones.gangue_ratio": int(rng.integers(low, high + 1)) / 100,
        "stones.drawn.rate_1_s": rate, "stones.drawn.rate_kg_s": None,
        "stones.drawn.arrival_s": [begin, begin + duration],
        "time.duration_s": begin + duration + family.rings_s}
    if family.speed_m_s is not None:
        changes |= {"stones.drawn.speed_m_s": float(rng.uniform(*family.speed_m_s)),
                    "stones.drawn.drop_height_m": None}
    if family.sizes_m is not None:
        size = family.sizes_m[rng.integers(len(family.sizes_m))]
        changes["stones.drawn.size_m"] = size.model_dump(exclude_none=True)
    return changes
