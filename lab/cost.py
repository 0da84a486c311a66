"""Processor time of a piece of work, and the machine it was measured on."""

from __future__ import annotations

import os
import platform
import resource
from collections.abc import Callable


def cpu_s(work: Callable[[], object]) -> float:
    """Processor time (user and system, s) of this process and of the children that end while `work` runs. It feels the
    load of the other cores far less than the clock on the wall does."""
    before = used_s()
    work()
    return used_s() - before


def used_s() -> float:
    """Processor time (user and system, s) so far of this process and of its children that have ended."""
    return sum(r.ru_utime + r.ru_stime for r in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)))


def machine() -> str:
    """Kind of processor and number of cores."""
    with open("/proc/cpuinfo") as file:
        names = (line.split(":", 1)[1].strip() for line in file if line.startswith("model name"))
        return f"{next(names, platform.machine())}, {os.cpu_count()} cores"
