"""Every mixing ratio of a scene, each in a run of its own; what is there and unchanged is not run again."""

from __future__ import annotations

from pathlib import Path

from common.output_directory import at_work_in
from common.run_summary import read_summary
from common.scene import Scene, ratio_name, read_scene, scene_hash
from dem.batch.children import run_all
from dem.coupling.launch import check_engine
from dem.run.directory import RunDirectory
from dem.stones.arrangement import arrange


def sweep(scene_file: Path, out: Path, jobs: int, overwrite: bool = False) -> int:
    """Run the missing ratios, `jobs` at a time; returns an exit code. Runs of another scene are replaced with
    `overwrite` only. Raises InputError for bad input, Busy where another process is at work."""
    check_engine()
    count = read_scene(scene_file).stones.count
    scenes = {k / count: read_scene(scene_file, k / count) for k in range(count + 1)}
    for scene in scenes.values():
        arrange(scene, str(scene_file))
    with at_work_in(out, "sweep"):
        missing = [ratio for ratio, scene in scenes.items() if not is_finished(out / ratio_name(ratio), scene)]
        for ratio in missing:
            RunDirectory(out / ratio_name(ratio)).refuse(scene_hash(scenes[ratio]), overwrite)
        print(f"{scene_file}: {len(scenes)} ratios, {len(missing)} to run", flush=True)
        failed = 0
        flags = ["--overwrite"] if overwrite else []
        for code, output in run_all([["run", str(scene_file), "--gangue", repr(ratio), "--out",
                                      str(out / ratio_name(ratio)), *flags] for ratio in missing], jobs):
            print(output, end="", flush=True)  # what went wrong is on stderr already
            failed += code != 0
    return 1 if failed else 0


def is_done(scene_file: Path, directory: Path, ratio: float) -> bool:
    """Does a directory hold a finished run of this very scene at this ratio?"""
    return is_finished(directory, read_scene(scene_file, ratio))


def is_finished(directory: Path, scene: Scene) -> bool:
    """Does a directory hold a finished run of this very scene? Raises InputError for a run.json that cannot be read."""
    summary = read_summary(directory / "run.json")
    return summary is not None and summary.status == "finished" and summary.scene_hash == scene_hash(scene)
