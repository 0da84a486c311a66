"""Every mixing ratio of a scene, each in a run of its own; what is there and unchanged is not run again."""

from __future__ import annotations

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from dem.arrangement import arrange
from dem.engine import check_engine
from dem.scene import Scene, ratio_name, read_scene, scene_hash


def sweep(scene_file: Path, out: Path, jobs: int) -> int:
    """Run the missing ratios, `jobs` at a time; returns an exit code. Raises InputError for bad input."""
    check_engine()
    count = read_scene(scene_file).stones.count
    ratios = [k / count for k in range(count + 1)]
    for ratio in ratios:
        arrange(read_scene(scene_file, ratio), str(scene_file))
    missing = [ratio for ratio in ratios if not is_done(scene_file, out / ratio_name(ratio), ratio)]
    print(f"{scene_file}: {len(ratios)} ratios, {len(missing)} to run", flush=True)
    failed = 0
    with ThreadPoolExecutor(jobs) as pool:
        runs = {pool.submit(_run_ratio, scene_file, out / ratio_name(ratio), ratio): ratio for ratio in missing}
        for finished in as_completed(runs):
            result = finished.result()
            print((result.stdout or result.stderr).strip().splitlines()[-1], flush=True)
            failed += result.returncode != 0
    return 1 if failed else 0


def is_done(scene_file: Path, directory: Path, ratio: float) -> bool:
    """Is there a finished run of this very scene at this ratio?"""
    return is_finished(directory, read_scene(scene_file, ratio))


def is_finished(directory: Path, scene: Scene) -> bool:
    """Does a directory hold a finished run of this very scene?"""
    file = directory / "run.json"
    if not file.exists():
        return False
    summary = json.loads(file.read_text())
    return summary["status"] == "finished" and summary["scene_hash"] == scene_hash(scene)


def _run_ratio(scene_file: Path, directory: Path, ratio: float) -> subprocess.CompletedProcess:
    """One ratio in a process of its own, progress passed through to this terminal."""
    command = [sys.executable, "-m", "dem", "run", str(scene_file), "--gangue", repr(ratio), "--out", str(directory)]
    return subprocess.run(command, stdout=subprocess.PIPE, stderr=None, text=True, check=False)
