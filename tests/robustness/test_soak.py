"""Many runs in one process: memory and open files do not grow."""

import os
import resource
from pathlib import Path

import pytest

from common.scene import changed_scene
from dem.run.run import run_scene
from tests.robustness.small import small_stone

RUNS = 24


def memory_MB():
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6


@pytest.mark.validate
def test_twenty_four_runs_in_one_process(tmp_path):
    scene = changed_scene(small_stone(tmp_path), {"time.duration_s": 0.02})
    seen = []
    for k in range(RUNS):
        run_scene(scene, "stone.toml", tmp_path / f"run_{k}")
        seen.append((memory_MB(), len(os.listdir("/proc/self/fd"))))
        print(f"run {k + 1}: {seen[-1][0]:.1f} MB, {seen[-1][1]} open files", flush=True)
    third = RUNS // 3
    early, late = (max(mb for mb, _ in part) for part in (seen[third:2 * third], seen[2 * third:]))
    assert late < 1.02 * early, seen  # the first third fills caches
    assert len({files for _, files in seen}) == 1, seen
    assert not list(tmp_path.glob("*.partial"))
