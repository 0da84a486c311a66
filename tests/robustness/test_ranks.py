"""A rank that waits leaves the processor to whom it waits for."""

import os
import resource
import socket
import subprocess

import pytest

from dem.__main__ import main
from dem.coupling.launch import engine_running, mpirun
from tests.robustness.small import HERTZ


def processor_time_s(deck, ranks):
    """Of the engine, all of it on one core."""
    core = {min(os.sched_getaffinity(0))}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([*mpirun(ranks), "-in", "deck.liggghts"], cwd=deck, stdin=subprocess.DEVNULL, capture_output=True,
                   check=True, timeout=3000, preexec_fn=lambda: os.sched_setaffinity(0, core))
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def test_two_ranks_share_one_core(tmp_path):
    """Ranks that spin while they wait use up a time slice at every exchange, and took thirty times as long as one."""
    short = ["--set", "time.duration_s=1e-4", "--set", "time.sample_interval_s=1e-5", "--set", "ranks=2"]
    assert main(["deck", str(HERTZ), "--out", str(tmp_path / "out"), *short]) == 0
    deck = tmp_path / "out" / "deck"
    assert processor_time_s(deck, 2) < 10 * processor_time_s(deck, 1)


@pytest.mark.parametrize("ranks", [1, 2])
def test_the_engine_asks_no_screen_for_graphics_cards(tmp_path, ranks):
    """MPI does so at its start, unless told otherwise: at "localhost", for which it asks a name server where no file
    names it, and that may take half a minute each of ten times."""
    (tmp_path / "deck.liggghts").write_text("units si\n")
    with socket.create_server(("localhost", 6000)) as screen:
        screen.setblocking(False)
        with engine_running(tmp_path, ranks) as engine:
            assert engine.wait(timeout=300) == 0
        with pytest.raises(BlockingIOError):
            screen.accept()
