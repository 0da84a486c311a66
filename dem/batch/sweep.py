"""Every mixing ratio of a scene, each in a run of its own; what is there and unchanged is not run again."""

from __future__ import annotations

import logging
import subprocess
import sys
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from common.run_summary import read_summary
from common.scene import Scene, changed_scene, ratio_name, scene_hash
from common.tables import InputError, inline_toml
from dem.coupling.launch import check_engine, die_with_parent
from dem.stones.arrangement import arrange

RATIO = "stones.gangue_ratio"
_log = logging.getLogger(__name__)


def sweep(scene_file: Path, out: Path, jobs: int, changes: Mapping[str, Any] | None = None) -> int:
    """Run the missing ratios, `jobs` at a time; returns an exit code. `changes` are values of the scene by dotted key
    (`common.scene.changed_scene`). Raises InputError for bad input."""
    check_engine()
    changes = dict(changes or {})
    if RATIO in changes:
        raise InputError(f"--set {RATIO}: a sweep runs every ratio; allowed are other keys of the scene")
    count = changed_scene(scene_file, changes).stones.count
    ratios = [k / count for k in range(count + 1)]
    for ratio in ratios:
        arrange(changed_scene(scene_file, changes | {RATIO: ratio}), str(scene_file))
    missing = [ratio for ratio in ratios if not is_done(scene_file, out / ratio_name(ratio), ratio, changes)]
    _log.info("%s: %d ratios, %d to run", scene_file, len(ratios), len(missing))
    failed = 0
    with ThreadPoolExecutor(jobs) as pool:
        runs = {pool.submit(_run_ratio, scene_file, out / ratio_name(ratio), ratio, changes): ratio
                for ratio in missing}
        for finished in as_completed(runs):
            result = finished.result()
            if result.stdout:  # what went wrong is on stderr already
                _log.info(result.stdout.rstrip("\n"))
            failed += result.returncode != 0
    return 1 if failed else 0


def is_done(scene_file: Path, directory: Path, ratio: float, changes: Mapping[str, Any] | None = None) -> bool:
    """Does a directory hold a finished run of this very scene, with its changes, at this ratio?"""
    return is_finished(directory, changed_scene(scene_file, {**(changes or {}), RATIO: ratio}))


def is_finished(directory: Path, scene: Scene) -> bool:
    """Does a directory hold a finished run of this very scene? Raises InputError for a run.json that cannot be read."""
    summary = read_summary(directory / "run.json")
    return summary is not None and summary.status == "finished" and summary.scene_hash == scene_hash(scene)


def _run_ratio(scene_file: Path, directory: Path, ratio: float,
               changes: Mapping[str, Any]) -> subprocess.CompletedProcess[str]:
    """Run one ratio in a process of its own, which goes on from a checkpoint if there is one and shows its progress."""
    command = [sys.executable, "-m", "dem", "run", str(scene_file), "--gangue", repr(ratio), "--out", str(directory)]
    for key, value in changes.items():
        command += ["--set", f"{key}={inline_toml(value)}"]
    return subprocess.run(command, stdout=subprocess.PIPE, stderr=None, text=True, check=False,
                          preexec_fn=die_with_parent)
