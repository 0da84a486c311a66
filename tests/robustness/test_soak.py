"""Many runs in one process: memory, open files and children do not grow."""

import os
import resource
import time
from pathlib import Path

import pytest

from common.scene.scene import changed_scene
from dem.run.run import run_scene
from tests.robustness.small import SCENES, below

RUNS = 24
DURATION_s = 0.1  # all impacts and rebounds; what follows to 0.6 s is mostly free flight


def memory_MB():
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6


def processor_time_s():
    return sum(os.times()[:4])


@pytest.mark.validate
def test_twenty_four_runs_of_the_default_scene_in_one_process(tmp_path):
    seen, begun_s, children = [], time.monotonic(), below(os.getpid())
    for k in range(RUNS):
        ratio = k % 11 / 10
        scene = changed_scene(SCENES / "paper.toml", {"time.duration_s": DURATION_s, "stones.gangue_ratio": ratio})
        run_scene(scene, "paper.toml", tmp_path / f"run_{k}")
        seen.append((memory_MB(), len(os.listdir("/proc/self/fd"))))
        assert below(os.getpid()) == children
        print(f"run {k + 1} of {ratio:.0%}: {seen[-1][0]:.1f} MB, {seen[-1][1]} open files, {processor_time_s():.0f} s "
              f"of the processor, {time.monotonic() - begun_s:.0f} s", flush=True)
    third = RUNS // 3
    early, late = (max(mb for mb, _ in part) for part in (seen[third:2 * third], seen[2 * third:]))
    assert late < 1.02 * early, seen  # the first third fills caches
    assert len({files for _, files in seen}) == 1, seen
    assert not list(tmp_path.glob("*.partial"))
