"""Works in copies of a process: what each tells, and how each kind of failure ends."""

import errno
import os
import signal

from common.tables import InputError
from dem.batch.sweep import run_all


def refused():
    raise InputError("stone.toml: stones.count = -1: must be above 0")


def full_disk():
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "fast.parquet")


def killed():
    os.kill(os.getpid(), signal.SIGKILL)


def test_each_work_ends_by_itself_and_in_one_line(capfd):
    lock = os.open(os.devnull, os.O_RDONLY)
    works = [lambda: "done", refused, full_disk, killed, lambda: "done as well"]
    found = {number: (code, line) for number, code, line in run_all(works, 2, lock)}
    os.close(lock)
    ends = {number: (code, line) for number, (code, line) in found.items() if number != 3}
    why = {1: "stone.toml: stones.count = -1: must be above 0", 2: "dem: fast.parquet: No space left on device"}
    assert ends == {0: (0, "done"), 1: (2, why[1]), 2: (1, why[2]), 4: (0, "done as well")}
    code, ended = found[3]
    assert code == -signal.SIGKILL and ended.endswith("ended from outside, with code -9")
    assert sorted(capfd.readouterr().err.splitlines()) == sorted([*why.values(), ended])
