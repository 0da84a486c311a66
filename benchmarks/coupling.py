"""What the coupling of engine and plate costs, as a share of one run of the default scene.

    python -m benchmarks.coupling [duration_s] [--brute]

Three parts of the time from the arrival of a message until its answer is written, while the engine waits: the messages
(pipes, copies, waking the other side), the motion of the modes, and recording. Shares of the wall time and of the
processor time of one run; and what is left of the wall time when neither works: start-up, and the time until a process
that slept runs. The wall time of the messages includes what the engine, once woken, does on the same processor before
the clock is stopped. `--brute` keeps bodies in the air in the force loops.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from pathlib import Path

import dem.run.participants
from common.scene import changed_scene
from dem.coupling.pipes import PlatePipes
from dem.run.recorder import PlateRecorder
from dem.run.run import run_scene
from plate_fem.motion import ModalMotion

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


answering, moving, recording = Clock(), Clock(), Clock()


def timed(base, clock: Clock, *names: str):
    """A class like `base` with the calls of the methods `names` on the clock."""
    def on_the_clock(name):
        def call(self, *values):
            clock.start()
            result = getattr(base, name)(self, *values)
            clock.stop()
            return result
        return call
    return type(f"Timed{base.__name__}", (base,), {name: on_the_clock(name) for name in names})


class TimedPipes(PlatePipes):
    def receive(self):
        message = super().receive()
        answering.start()
        return message

    def answer(self, *values):
        super().answer(*values)
        answering.stop()


def children_s() -> float:
    """Processor time of processes that were started and have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("duration_s", type=float, nargs="?", default=0.04)
    parser.add_argument("--brute", action="store_true")
    options = parser.parse_args()
    brute = {"time.free_flight_tolerance": 0.0} if options.brute else {}
    changes = {"time.duration_s": options.duration_s, "output": None} | brute
    scene = changed_scene(SCENE, changes)
    classes = {"PlatePipes": TimedPipes, "PlateRecorder": timed(PlateRecorder, recording, "__call__"),
               "ModalMotion": timed(ModalMotion, moving, "advance", "predict", "reach_m", "advance_rows")}
    for name, of_time in classes.items():
        setattr(dem.run.participants, name, of_time)
    with tempfile.TemporaryDirectory() as directory:
        before_s = children_s()
        summary = run_scene(scene, str(SCENE), Path(directory) / "run")
        engine_s = children_s() - before_s
    run_s = summary["wall_time_s"]["engine and plate"]
    total_s = engine_s + answering.cpu_s
    print(f"{summary['steps']} steps, {answering.count} messages for {summary['n_modes']} modes every "
          f"{summary['co_step']} steps; engine {engine_s:.1f} s of processor time, run {run_s:.1f} s")
    parts = {"messages": (answering.wall_s - moving.wall_s - recording.wall_s,
                          answering.cpu_s - moving.cpu_s - recording.cpu_s),
             "motion of the modes": (moving.wall_s, moving.cpu_s), "recording": (recording.wall_s, recording.cpu_s)}
    for name, (wall_s, cpu_s) in parts.items():
        print(f"{name:20} {1e6 * cpu_s / answering.count:4.0f} us a message, {cpu_s / total_s:.1%} of the processor time, "
              f"{wall_s / run_s:.1%} of the wall time")
    print(f"neither at work      {1 - (engine_s + answering.wall_s) / run_s:.1%} of the wall time")


if __name__ == "__main__":
    main()
