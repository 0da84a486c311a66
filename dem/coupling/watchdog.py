"""Is the engine stuck? This is told from its processor time, which a working process uses even on a crowded machine.
A time-out cannot tell, since set-up and free flight may take minutes without a message.

The kernel is asked by /proc for this process family alone. psutil looks through every process of the machine to find
children, which on a busy node costs more than a tenth of a core at the pace of these looks.
"""

from __future__ import annotations

import subprocess
import time
from pathlib import Path

from dem.coupling.messages import CouplingError

STUCK_s = 10.0  # without any processor time
LONGEST_POLL_s = 0.5  # what one look counts at most: time in which this process was itself stopped does not count


class EngineWatchdog:
    """Call it often while the engine is waited for: it tells whether the engine is alive. Raises CouplingError if it is
    stuck.

    A process that waits for a disk is not taken for stuck. The engine may be one of several processes below the one
    that was started (mpirun).
    """

    def __init__(self, engine: subprocess.Popen[bytes]):
        self._engine = engine
        self._ticks, self._still_s, self._last = -1, 0.0, time.monotonic()

    def __call__(self) -> bool:
        if self._engine.poll() is not None:
            return False
        ticks, states = _usage(self._engine.pid)
        now = time.monotonic()
        if ticks != self._ticks or "D" in states:
            self._still_s = 0.0
        else:
            self._still_s += min(now - self._last, LONGEST_POLL_s)
        self._ticks, self._last = ticks, now
        if self._still_s > STUCK_s:
            what = "is stopped by a signal" if states & {"T", "t"} else "is stuck"
            raise CouplingError(f"the engine (process {self._engine.pid}) {what}: no processor time in {STUCK_s:g} s")
        return True


def _usage(pid: int) -> tuple[int, set[str]]:
    """Processor time in ticks of the kernel and the states (man 5 proc) of a process and all below it."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
        children = [int(child) for task in Path(f"/proc/{pid}/task").iterdir()
                    for child in (task / "children").read_text().split()]
    except OSError:
        return 0, set()  # gone meanwhile
    ticks, states = int(fields[11]) + int(fields[12]), {fields[0]}
    for child in children:
        more, other = _usage(child)
        ticks, states = ticks + more, states | other
    return ticks, states
