"""Runs in processes of their own, some at a time, which end with this one."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence

from common.processes import die_with_parent

POLL_s = 0.05


def ignore_interrupt() -> None:
    """A terminal sends Ctrl-C to every process that it started; the one that started the others tells of it and ends
    them. Called in a new process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    die_with_parent()


def run_all(commands: Sequence[Sequence[str]], at_a_time: int) -> Iterator[tuple[int, str]]:
    """Run `python -m dem` with each of the argument lists; yield exit code and output of each as it ends. If this ends
    early, as by Ctrl-C, so do all that still run; their checkpoints stay."""
    waiting, running = list(commands)[::-1], list[subprocess.Popen[str]]()
    try:
        while waiting or running:
            while waiting and len(running) < at_a_time:
                running.append(_start(waiting.pop()))
            ended = next((child for child in running if child.poll() is not None), None)
            if ended is None:
                time.sleep(POLL_s)
                continue
            running.remove(ended)
            yield ended.returncode, ended.communicate()[0]
    finally:
        for child in running:
            child.kill()
        for child in running:
            child.communicate()


def _start(arguments: Sequence[str]) -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, "-m", "dem", *arguments], stdout=subprocess.PIPE, text=True,
                            preexec_fn=ignore_interrupt)  # noqa: PLW1509 - takes no lock
