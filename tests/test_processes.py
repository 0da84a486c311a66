"""Work shared by processes: the same results in order, errors raised, nobody left behind."""

import os
import signal
import subprocess
import sys
import time

import pytest

from common.process.processes import Crashed, apart, side_by_side
from tests.robustness.small import ROOT, is_alive


def test_results_come_in_order_and_from_other_processes():
    scale = 3.0  # found in the copies without being sent
    found = side_by_side(lambda k: (scale * k, os.getpid()), 7)
    assert [value for value, _ in found] == [0, 3, 6, 9, 12, 15, 18]
    assert len(os.sched_getaffinity(0)) == 1 or os.getpid() not in {pid for _, pid in found}


def test_this_process_works_beside_the_others():
    did = []
    assert side_by_side(lambda k: (k, len(did)), 3, lambda: did.append(os.getpid())) == [
        (k, 0 if len(os.sched_getaffinity(0)) > 1 else 1) for k in range(3)]
    assert did == [os.getpid()]


def test_what_the_work_raises_is_raised_here():
    with pytest.raises(ZeroDivisionError):
        side_by_side(lambda k: 1 / (k - 3), 5)


def test_work_apart_may_crash():
    assert apart(os.getpid) != os.getpid()
    with pytest.raises(ZeroDivisionError):
        apart(lambda: 1 / 0)
    with pytest.raises(Crashed):
        apart(lambda: os.kill(os.getpid(), signal.SIGKILL))


def test_no_process_outlives_the_one_that_was_killed(tmp_path):
    program = ("import os, time\nfrom pathlib import Path\nfrom common.process.processes import side_by_side\n"
               f"side_by_side(lambda k: (Path({str(tmp_path)!r}, str(os.getpid())).touch(), time.sleep(600)), 2)")
    process = subprocess.Popen([sys.executable, "-c", program], cwd=ROOT)
    while not (workers := [int(file.name) for file in tmp_path.iterdir()]):
        time.sleep(0.01)
    process.kill()
    process.wait()
    deadline = time.monotonic() + 60
    while any(map(is_alive, workers)):
        assert time.monotonic() < deadline, "a worker outlived the program"
        time.sleep(0.01)
