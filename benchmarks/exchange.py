"""What the exchange between engine and plate costs, as a share of one run of the default scene.

    python -m benchmarks.exchange [duration_s]

The plate's time counts from the arrival of a message until its answer is written, while the engine waits, less that of
recording signals and stress, which is given apart. Shares of the wall time and of the processor time of one run.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from pathlib import Path

import dem.run
from dem.exchange import PlatePipes
from dem.output import PlateRecorder
from dem.scene import changed_scene

SCENE = Path(__file__).resolve().parent.parent / "scenes" / "paper.toml"


class Clock:
    """Time spent since `start`, on the wall and of the processor, added up."""

    def __init__(self):
        self.count, self.wall_s, self.cpu_s = 0, 0.0, 0.0

    def start(self):
        self._started = time.perf_counter(), time.process_time()

    def stop(self):
        self.count += 1
        self.wall_s += time.perf_counter() - self._started[0]
        self.cpu_s += time.process_time() - self._started[1]


answering, recording = Clock(), Clock()


class TimedPipes(PlatePipes):
    def receive(self):
        message = super().receive()
        answering.start()
        return message

    def answer(self, *values):
        super().answer(*values)
        answering.stop()


class TimedRecorder(PlateRecorder):
    def __call__(self, *values):
        recording.start()
        super().__call__(*values)
        recording.stop()


def main(duration_s: float) -> None:
    scene = changed_scene(SCENE, {"time.duration_s": duration_s, "output": None})
    for name, timed in (("PlatePipes", TimedPipes), ("PlateRecorder", TimedRecorder)):
        setattr(dem.run, name, timed)
    with tempfile.TemporaryDirectory() as directory:
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        summary = dem.run.run_scene(scene, str(SCENE), Path(directory) / "run")
        engine_s = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    run_s = summary["wall_time_s"]["engine and plate"]
    total_s = engine_s + answering.cpu_s
    wall_s, cpu_s = answering.wall_s - recording.wall_s, answering.cpu_s - recording.cpu_s
    print(f"{summary['steps']} steps, {answering.count} exchanges of {summary['n_modes']} modes every "
          f"{summary['co_step']} steps; engine {engine_s:.1f} s of processor time, run {run_s:.1f} s")
    print(f"exchange {1e6 * cpu_s / answering.count:.0f} us each, {cpu_s / total_s:.1%} of the processor time, "
          f"{wall_s / run_s:.1%} of the wall time; recording {recording.cpu_s / total_s:.1%}")


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 0.04)
