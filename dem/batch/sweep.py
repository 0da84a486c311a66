"""Every mixing ratio of a scene, each in a run of its own; what is there and unchanged is not run again.

Runs are processes of their own, some at a time, which end with this one.
"""

import logging
import multiprocessing
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkProcess
from pathlib import Path
from typing import Any

import pyarrow.csv  # noqa: F401 - every run writes these, and its copy would import them by itself
import pyarrow.parquet  # noqa: F401

from common.files.output_directory import at_work_in
from common.process.command import end_of, say
from common.process.processes import begin_copy
from common.result import Result
from common.run_summary import read_summary
from common.scene.scene import Scene, changed_scene, ratio_name, scene_hash
from common.tables import InputError
from dem.commands import Changes, RunResult
from dem.coupling.launch import check_engine
from dem.deck.render import DECK, template
from dem.run.directory import RunDirectory
from dem.run.run import run_scene
from dem.stones.arrangement import stones_of

RATIO = "stones.gangue_ratio"
MOST_RATIOS = 100  # beside none
RATIOS_OF_DRAWN = 10  # steps from none to all where stones are drawn
_log = logging.getLogger(__name__)
Work = Callable[[], Any]  # returns what there is to tell


@dataclass(frozen=True)
class SweepResult(Result):
    """The finished runs of a sweep by rising ratio, and by its directory why a run failed."""

    directory: Path
    runs: tuple[RunResult, ...]
    failed: Mapping[str, str]

    def words(self) -> Iterator[str]:
        for run in self.runs:
            yield from run.words()
        yield f"{self.directory}: {len(self.runs)} of {len(self.runs) + len(self.failed)} ratios finished"


def sweep(scene_file: str | Path, out: str | Path, jobs: int = 1, changes: Changes = (),
          overwrite: bool = False) -> SweepResult:
    """Run the missing ratios, `jobs` at a time. `changes` are values of the scene by dotted key
    (`common.scene.changed_scene`). Runs of another scene are replaced with `overwrite` only. Raises InputError
    for bad input, Busy where another process is at work.

    >>> spheres = sweep(Path("scenes/hertz_coal.toml"), Path("runs/spheres"), jobs=1)
    >>> [one.gangue_ratio for one in spheres.runs], spheres.failed
    ([0.0, 1.0], {})
    """
    check_engine()
    out, keys = Path(out), dict(changes)
    if RATIO in keys:
        raise InputError(f"--set {RATIO}: a sweep runs every ratio; allowed are other keys of the scene")
    stones = changed_scene(scene_file, keys).stones
    if not stones.shares_gangue:
        raise InputError(f"{scene_file}: stones.each: a sweep shares out the gangue; needs stones.count, drawn "
                         "or stream")
    count = RATIOS_OF_DRAWN if stones.drawn else stones.volley[0]
    if count > MOST_RATIOS:
        raise InputError(f"{scene_file}: stones.count = {count}: a sweep names its runs by whole per cent of gangue; "
                         f"at most {MOST_RATIOS}")
    scenes = {out / ratio_name(k / count): changed_scene(scene_file, keys | {RATIO: k / count})
              for k in range(count + 1)}
    for scene in scenes.values():
        stones_of(scene, str(scene_file))
    template(DECK)  # compiled here, not in each copy
    with at_work_in(out, "sweep") as lock:
        run = partial(run_scene, source=str(scene_file), show_progress=True, overwrite=overwrite)
        failed = run_missing(str(scene_file), scenes, run, jobs, lock, overwrite)
    return SweepResult(out, tuple(_read(place) for place in scenes if place not in failed),
                       {place.name: why for place, why in failed.items()})


def _read(directory: Path) -> RunResult:
    """Of a run that is finished."""
    summary = read_summary(directory / "run.json")
    assert summary is not None
    return RunResult.of(directory, summary.as_json())


def is_finished(directory: Path, scene: Scene, overwrite: bool = False) -> bool:
    """Does a directory hold a finished run of this very scene? Raises InputError for a run.json that cannot be read;
    with `overwrite` such a run counts as not finished, since it will be replaced."""
    try:
        summary = read_summary(directory / "run.json")
    except InputError:
        if not overwrite:
            raise
        return False
    return summary is not None and summary.status == "finished" and summary.scene_hash == scene_hash(scene)


def run_missing(source: str, scenes: Mapping[Path, Scene], run: Callable[..., dict[str, Any]], jobs: int, lock: int,
                overwrite: bool) -> dict[Path, str]:
    """Run the scenes whose directories do not hold a finished run of them, `jobs` at a time, by `run(scene, out=...)`,
    which returns what run.json says, and tell of each. Returns by its directory why a run failed. Raises InputError,
    before the first begins, for a directory whose contents must not be replaced."""
    missing = [place for place, scene in scenes.items() if not is_finished(place, scene, overwrite)]
    for place in missing:
        RunDirectory(place).refuse(scene_hash(scenes[place]), overwrite)
    _log.info("%s: %d runs, %d to run", source, len(scenes), len(missing))
    start, failed = time.monotonic(), dict[Path, str]()
    works = [partial(run, scenes[place], out=place) for place in missing]
    for done, (number, code, told) in enumerate(run_all(works, jobs, lock), 1):
        if code:
            failed[missing[number]] = told
        left_min = (time.monotonic() - start) / done * (len(missing) - done) / 60
        _log.info("%d of %d, left %.0f min: %s: %s", done, len(missing), left_min, missing[number],
                  f"failed with code {code}" if code else _in_words(told))
    return failed


def _in_words(summary: dict[str, Any]) -> str:
    return (f"{summary['peak_force_N']:.0f} N, {summary['n_bonds_broken']} of {summary['n_bonds']} bonds broken, "
            f"{sum(summary['wall_time_s'].values()):.0f} s")


@dataclass(frozen=True)
class _Child:
    number: int
    process: ForkProcess
    answer: Connection


def run_all(works: Sequence[Work], at_a_time: int, lock: int) -> Iterator[tuple[int, int, Any]]:
    """Do each work in a copy of this process, which has imported already what it needs; yield its number, its exit code
    and what it returns as it ends, or why it failed, in one line that is said on standard error as well. If this
    ends early, as by Ctrl-C, so do all that still run; their checkpoints stay. The copies do not hold `lock`, a
    descriptor of this process."""
    fork = multiprocessing.get_context("fork")
    waiting, running = list(enumerate(works))[::-1], list[_Child]()
    try:
        while waiting or running:
            while waiting and len(running) < at_a_time:
                number, work = waiting.pop()
                ours, theirs = fork.Pipe(duplex=False)
                child = _Child(number, fork.Process(target=_do, args=(work, theirs, lock)), ours)
                child.process.start()
                running.append(child)
                theirs.close()
            ended = wait([child.process.sentinel for child in running])
            for child in [child for child in running if child.process.sentinel in ended]:
                running.remove(child)
                child.process.join()
                yield child.number, *_answer_of(child)
    finally:
        for child in running:
            child.process.kill()
        for child in running:
            child.process.join()


def _do(work: Work, answer: Connection, lock: int) -> None:
    begin_copy()
    os.close(lock)
    told: list[Any] = []

    def finish() -> int:
        told.append(work())
        return 0

    code, line = end_of("dem", finish)
    answer.send((code, line if code else told[0]))


def _answer_of(child: _Child) -> tuple[int, Any]:
    with child.answer:
        try:
            code, told = child.answer.recv()
        except EOFError:  # it was killed
            code = child.process.exitcode or 1
            told = f"process {child.process.pid}: ended from outside, with code {code}"
    if code:
        say(told)
    return code, told
