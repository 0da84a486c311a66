"""Processes that this one starts: they end with it, and may share its work."""

from __future__ import annotations

import ctypes
import gc
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor

Result = TypeVar("Result")
PR_SET_PDEATHSIG = 1  # of <sys/prctl.h>
_work: Callable[[int], Any]


def die_with_parent(by: int = getattr(signal, "SIGKILL", 0)) -> None:  # Windows has none
    """Called in a new process: the kernel sends it a signal when the one that started it is gone."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, by)


def run_group(command: Sequence[str]) -> int:
    """Return the exit code, as of a shell, of a command that starts others, in a process group of their own. Whatever
    ends this process ends all of them: another one waits for that, asks them to stop and then makes them. It holds the
    locks of this one until they are gone."""
    process = subprocess.Popen(command, process_group=0)
    reads, writes = os.pipe()
    if (guard := os.fork()) == 0:
        try:
            os.setsid()  # a signal to the terminal's processes is not for this one
            os.close(writes)
            if not os.read(reads, 1):  # all copies of the other end are closed
                _end_group(process.pid)
        finally:
            os._exit(0)
    os.close(reads)
    try:
        code = process.wait()
        if code >= 0:  # not killed, so that it ended what it started
            os.write(writes, b".")
        return code if code >= 0 else 128 - code
    finally:
        os.close(writes)
        process.wait()
        os.waitpid(guard, 0)


def _end_group(group: int) -> None:
    for number, patience_s in ((signal.SIGINT, 2.0), (signal.SIGKILL, 10.0)):
        deadline = time.monotonic() + patience_s
        with suppress(ProcessLookupError):
            os.killpg(group, number)
            while time.monotonic() < deadline:
                os.killpg(group, 0)
                time.sleep(0.05)


def side_by_side(work: Callable[[int], Result], count: int,
                 beside: Callable[[], object] = lambda: None) -> list[Result]:
    """Return work(0), ..., work(count - 1), done by as many processes as this one may use processors, while this one
    does `beside`.

    Each process is a copy of this one, so `work` finds all that is in memory here; its results must be picklable. What
    it raises is raised here. The processes end with that, and after Ctrl-C. Where a copy is not safe, outside Linux,
    this process does it all.
    """
    processes = min(count, len(os.sched_getaffinity(0))) if sys.platform == "linux" else 1
    if processes <= 1:
        beside()
        return [work(number) for number in range(count)]
    pool = _pool(processes, work)
    try:
        found = pool.map(_do, range(count))
        beside()
        return list(found)
    finally:
        pool.shutdown(cancel_futures=True)


class Crashed(RuntimeError):
    """The process that did a work was ended by a fault, such as one of a library in C."""


def apart(work: Callable[[], Result]) -> Result:
    """Return work(), done by a copy of this process as in `side_by_side`, which alone ends where the work crashes.
    Raises Crashed then, else what `work` raises."""
    if sys.platform != "linux":
        return work()
    from concurrent.futures.process import BrokenProcessPool  # late, as in `_pool`

    pool = _pool(1, lambda _: work())
    try:
        return pool.submit(_do, 0).result()
    except BrokenProcessPool:
        raise Crashed("the process that worked for this one crashed") from None
    finally:
        pool.shutdown(cancel_futures=True)


def _pool(processes: int, work: Callable[[int], Any]) -> ProcessPoolExecutor:
    import multiprocessing  # late: a tenth of the time that a command which only reads may take
    from concurrent.futures import ProcessPoolExecutor

    return ProcessPoolExecutor(processes, multiprocessing.get_context("fork"), _begin, (work,))


def begin_copy() -> None:
    """Called in a copy of a process, which leaves the answer to Ctrl-C to the one that it came from, dies with it, and
    skips in garbage collection what was there before: that takes long, and writes on the pages that both share."""
    gc.freeze()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    die_with_parent()


def _begin(work: Callable[[int], Any]) -> None:
    global _work  # noqa: PLW0603 - found again by name in the copy
    begin_copy()
    _work = work


def _do(number: int) -> Any:
    return _work(number)
