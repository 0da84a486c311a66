"""Runs in processes of their own, some at a time, which end with this one."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkProcess
from typing import Any

import pyarrow.parquet  # noqa: F401 - every run writes tables, and its copy would import this by itself

from common.process.command import end_of, say
from common.process.processes import begin_copy

Work = Callable[[], Any]  # returns what there is to tell


@dataclass(frozen=True)
class _Child:
    number: int
    process: ForkProcess
    answer: Connection


def run_all(works: Sequence[Work], at_a_time: int, lock: int) -> Iterator[tuple[int, int, Any]]:
    """Do each work in a copy of this process, which has imported already what it needs; yield its number, its exit code
    and what it returns as it ends, or why it failed, in one line that is said on standard error as well. If this
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
    told: list[Any] = []

    def finish() -> int:
        told.append(work())
        return 0

    code, line = end_of("dem", finish)
    answer.send((code, line if code else told[0]))


def _answer_of(child: _Child) -> tuple[int, Any]:
    with child.answer:
        try:
            code, told = child.answer.recv()
        except EOFError:  # it was killed
            code = child.process.exitcode or 1
            told = f"process {child.process.pid}: ended from outside, with code {code}"
    if code:
        say(told)
    return code, told
