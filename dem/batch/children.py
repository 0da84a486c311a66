"""Runs in processes of their own, some at a time, which end with this one."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkProcess

import pyarrow.parquet  # noqa: F401 - every run writes tables, and its copy would import this by itself

from common.command import run_command
from common.processes import begin_copy
from dem.run.told import exit_code_of

Work = Callable[[], str]  # returns what there is to tell


@dataclass(frozen=True)
class _Child:
    number: int
    process: ForkProcess
    answer: Connection


def run_all(works: Sequence[Work], at_a_time: int, lock: int) -> Iterator[tuple[int, int, str]]:
    """Do each work in a copy of this process, which has imported already what it needs; yield its number, its exit code
    and what it tells as it ends. One that fails tells nothing here: why is said on standard error, in one line. If this
    ends early, as by Ctrl-C, so do all that still run; their checkpoints stay. The copies do not hold `lock`, a
    descriptor of this process."""
    fork = multiprocessing.get_context("fork")
    waiting, running = list(enumerate(works))[::-1], list[_Child]()
    try:
        while waiting or running:
            while waiting and len(running) < at_a_time:
                number, work = waiting.pop()
                ours, theirs = fork.Pipe(duplex=False)
                running.append(_Child(number, fork.Process(target=_do, args=(work, theirs, lock)), ours))
                running[-1].process.start()
                theirs.close()
            ended = wait([child.process.sentinel for child in running])
            for child in [child for child in running if child.process.sentinel in ended]:
                running.remove(child)
                child.process.join()
                yield child.number, *_answer_of(child)
    finally:
        for child in running:
            child.process.kill()
        for child in running:
            child.process.join()


def _do(work: Work, answer: Connection, lock: int) -> None:
    begin_copy()
    os.close(lock)
    line = ""

    def finish() -> int:
        nonlocal line
        line = work()
        return 0

    answer.send((run_command("dem", lambda: exit_code_of(finish)), line))


def _answer_of(child: _Child) -> tuple[int, str]:
    with child.answer:
        try:
            return child.answer.recv()
        except EOFError:  # it was killed
            return child.process.exitcode or 1, ""
