"""The engine by itself, on a deck: its time and its memory."""

from __future__ import annotations

import os
import re
import subprocess
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from dem.coupling.launch import ENGINE


@dataclass(frozen=True)
class Used:
    """Processor time of the process, LIGGGHTS' own time of its steps, and peak memory."""

    cpu_s: float
    loop_s: float
    memory_MB: float


def engine_run(deck: Path, steps: int | None = None, command: tuple[str, ...] = (str(ENGINE),)) -> Used:
    """Run the deck in a directory, or so many of its steps. RuntimeError where the engine fails."""
    file = deck / "deck.liggghts"
    if steps is not None:
        file.write_text(re.sub(r"(?m)^run .*$", f"run {steps}", file.read_text()))
    for name in ("ledger.bin", "forces.bin", "events.csv"):
        (deck / name).unlink(missing_ok=True)
    with open(deck / "engine.out", "wb") as out:
        process = subprocess.Popen([*command, "-in", file.name], cwd=deck, stdout=out,
                                   stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL)
        peak_kB = 0  # asked while it runs: what the kernel counts at the end includes Python, from which it was forked
        while True:
            with suppress(FileNotFoundError):
                high = re.search(r"VmHWM:\s+(\d+)", Path(f"/proc/{process.pid}/status").read_text())
                peak_kB = max(peak_kB, int(high[1]) if high else 0)
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                break
            time.sleep(0.02)
    said = (deck / "engine.out").read_text(errors="replace")
    if status:
        raise RuntimeError(said[-500:])
    loop = re.findall(r"Loop time of (\S+) on", said)
    return Used(usage.ru_utime + usage.ru_stime, float(loop[-1]), peak_kB / 1024)
