"""Is a process that should be at work stuck? Told from its processor time, which a working process uses even on a
crowded machine; no time-out can tell, since set-up and free flight may take minutes without a word."""

from __future__ import annotations

import subprocess
import time
from pathlib import Path

from dem.coupling.pipes import ExchangeError

STUCK_s = 10.0  # without any processor time
LONGEST_POLL_s = 0.5  # what one look counts at most: time in which this process was itself stopped does not count


class EngineWatch:
    """Call it often while the engine is waited for: tells whether it is alive. Raises ExchangeError if it is stuck.

    A process that waits for a disk (state D) is not taken for stuck. The engine may be one of several processes below the
    one that was started (mpirun).
    """

    def __init__(self, engine: subprocess.Popen):
        self._engine = engine
        self._cpu, self._still_s, self._last = -1, 0.0, time.monotonic()

    def __call__(self) -> bool:
        if self._engine.poll() is not None:
            return False
        cpu, states = _usage(self._engine.pid)
        now = time.monotonic()
        if cpu != self._cpu or "D" in states:
            self._still_s = 0.0
        else:
            self._still_s += min(now - self._last, LONGEST_POLL_s)
        self._cpu, self._last = cpu, now
        if self._still_s > STUCK_s:
            what = "is stopped by a signal" if states & {"T", "t"} else "is stuck"
            raise ExchangeError(f"the engine (process {self._engine.pid}) {what}: no processor time in {STUCK_s:g} s")
        return True


def _usage(pid: int) -> tuple[int, set[str]]:
    """Processor time in ticks of the kernel and states of a process and all below it."""
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
