"""Serial runs side by side: `python -m benchmarks.side_by_side`. Efficiency is the wall time of one run alone over that
of as many at once as there are cores; the machine must have nothing else to do."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.stone import SCENES

ROUNDS = 3


def wall_s(number: int, here: Path) -> float:
    """Wall time of `number` runs of scenes/small.toml started together, s."""
    command = [sys.executable, "-m", "dem", "run", str(SCENES / "small.toml"), "--set", "output.view_interval_s=1.0", "--out"]
    start = time.perf_counter()
    runs = [subprocess.Popen([*command, str(here / f"{k}" / "run")], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            for k in range(number)]
    codes = [run.wait() for run in runs]  # of all, not up to the first that failed
    if any(codes):
        raise RuntimeError("a run failed")
    return time.perf_counter() - start


def main() -> None:
    cores = os.cpu_count() or 1
    with tempfile.TemporaryDirectory() as folder:
        wall_s(cores, Path(folder))  # the modes of the plate are then in the cache
        alone, together = (min(wall_s(n, Path(folder)) for _ in range(ROUNDS)) for n in (1, cores))
    print(f"{cores} cores: one run {alone:.2f} s, {cores} at once {together:.2f} s, efficiency {alone / together:.3f}")


if __name__ == "__main__":
    main()
