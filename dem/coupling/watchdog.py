"""Is the engine stuck? This is told from its processor time, which a working process uses even on a crowded machine.
A time-out cannot tell, since set-up and free flight may take minutes without a message.

Ticks of the kernel, of ten milliseconds, are too coarse for it: on a machine with many processes, ranks that leave the
processor to whom they wait for get some microseconds at a time. The kernel is asked by /proc for this process family
alone. psutil looks through every process of the machine to find children, which on a busy node costs more than a tenth
of a core at the pace of these looks.
"""

from __future__ import annotations

import os
import subprocess
import time
from pathlib import Path

from dem.coupling.messages import CouplingError

STUCK_s = 10.0  # without any processor time
TICK_ns = 10**9 // os.sysconf("SC_CLK_TCK")
HAS_SCHEDSTAT = Path("/proc/self/schedstat").exists()  # else ticks have to do
LONGEST_POLL_s = 0.5  # what one look counts at most: time in which this process was itself stopped does not count


class EngineWatchdog:
    """Call it often while the engine is waited for: it tells whether the engine is alive. Raises CouplingError if it is
    stuck.

    A process that waits for a disk is not taken for stuck. The engine may be one of several processes below the one
    that was started (mpirun).
    """

    def __init__(self, engine: subprocess.Popen[bytes]):
        self._engine = engine
        self._used_ns, self._still_s, self._last = -1, 0.0, time.monotonic()

    def __call__(self) -> bool:
        if self._engine.poll() is not None:
            return False
        used_ns, states = _usage(self._engine.pid)
        now = time.monotonic()
        if used_ns != self._used_ns or "D" in states:
            self._still_s = 0.0
        else:
            self._still_s += min(now - self._last, LONGEST_POLL_s)
        self._used_ns, self._last = used_ns, now
        if self._still_s > STUCK_s:
            what = "is stopped by a signal" if states & {"T", "t"} else "is stuck"
            raise CouplingError(f"the engine (process {self._engine.pid}) {what}: no processor time in {STUCK_s:g} s")
        return True


def _usage(pid: int) -> tuple[int, set[str]]:
    """Processor time in ns and the states (man 5 proc) of a process and all below it."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
        tasks = list(Path(f"/proc/{pid}/task").iterdir())
        children = [int(child) for task in tasks for child in (task / "children").read_text().split()]
        used_ns = sum(int((task / "schedstat").read_text().split()[0]) for task in tasks if HAS_SCHEDSTAT)
    except OSError:
        return 0, set()  # gone meanwhile
    used_ns, states = used_ns + (int(fields[11]) + int(fields[12])) * TICK_ns, {fields[0]}
    for child in children:
        more_ns, other = _usage(child)
        used_ns, states = used_ns + more_ns, states | other
    return used_ns, states
