"""Runs in processes of their own, some at a time, which end with this one."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkProcess

import pyarrow.parquet  # noqa: F401 - every run writes tables, and its copy would import this by itself

from common.processes import die_with_parent

Work = Callable[[], tuple[int, str]]  # returns an exit code and what there is to tell


@dataclass(frozen=True)
class _Child:
    number: int
    process: ForkProcess
    answer: Connection


def run_all(works: Sequence[Work], at_a_time: int, lock: int) -> Iterator[tuple[int, int, str]]:
    """Do each work in a copy of this process, which has imported already what it needs; yield its number, its exit code
    and what it tells as it ends, nothing where it was killed. If this ends early, as by Ctrl-C, so do all that still
    run; their checkpoints stay. The copies do not hold `lock`, a descriptor of this process."""
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
    """A terminal sends Ctrl-C to every process that it started; the one that started the others tells of it and ends
    them."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    die_with_parent()
    os.close(lock)
    answer.send(work())


def _answer_of(child: _Child) -> tuple[int, str]:
    with child.answer:
        try:
            return child.answer.recv()
        except EOFError:  # it was killed, or ended by an error
            return child.process.exitcode or 1, ""
