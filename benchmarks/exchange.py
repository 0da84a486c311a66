"""What the exchange between engine and plate costs, as a share of one run of the default scene.

    python -m benchmarks.exchange [duration_s]

The plate's time counts from the arrival of a message until its answer is written; the engine waits meanwhile. Recording
the signals is apart from it. Shares of the wall time and of the processor time of one and the same run.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from pathlib import Path

import dem.run
from dem.exchange import PlatePipes
from dem.scene import changed_scene

SCENE = Path(__file__).resolve().parent.parent / "scenes" / "paper.toml"


class TimedPipes(PlatePipes):
    """Counts exchanges and the time from each message to its answer, on the clock and of the processor."""

    exchanges = 0
    wall_s = cpu_s = 0.0

    def receive(self):
        message = super().receive()
        self._arrived = time.perf_counter(), time.process_time()
        return message

    def answer(self, *values):
        super().answer(*values)
        TimedPipes.exchanges += 1
        TimedPipes.wall_s += time.perf_counter() - self._arrived[0]
        TimedPipes.cpu_s += time.process_time() - self._arrived[1]


def main(duration_s: float) -> None:
    scene = changed_scene(SCENE, {"time.duration_s": duration_s, "output": None})
    setattr(dem.run, "PlatePipes", TimedPipes)  # noqa: B010  (a type checker refuses the plain assignment)
    with tempfile.TemporaryDirectory() as directory:
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        summary = dem.run.run_scene(scene, str(SCENE), Path(directory) / "run")
        engine_s = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    wall_s = summary["wall_time_s"]["engine and plate"]
    print(f"{summary['steps']} steps, {TimedPipes.exchanges} exchanges of {summary['n_modes']} modes every "
          f"{summary['co_step']} steps, {1e6 * TimedPipes.wall_s / TimedPipes.exchanges:.0f} us each")
    print(f"share of the wall time {TimedPipes.wall_s / wall_s:.1%} (of {wall_s:.1f} s), "
          f"of the processor time {TimedPipes.cpu_s / (TimedPipes.cpu_s + engine_s):.1%} (engine {engine_s:.1f} s)")


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 0.04)
