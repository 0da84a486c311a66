"""Error against time of the EMD stopping rules, on a mode of 900 Hz, modulated in amplitude and frequency, with a tone.

The error is the RMS of (first IMF - first mode) over the RMS of that mode, away from the ends.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from analysis import Record, decompose
from analysis.signals.emd import STOPPING_RULES
from lab.study import Row

RATE_Hz = 6667.0


def known_modes(samples: int) -> tuple[np.ndarray, np.ndarray]:
    """The mode, and the tone of 110 Hz, each (samples,)."""
    t = np.arange(samples) / RATE_Hz
    fast = (1 + 0.4 * np.cos(2 * np.pi * 15 * t)) * np.cos(2 * np.pi * 900 * t + 3 * np.sin(2 * np.pi * 10 * t))
    return fast, 0.7 * np.sin(2 * np.pi * 110 * t)


def cost(rule: str, samples: int, repeats: int = 3) -> dict[str, float]:
    """The least processor time of some repeats, and the error."""
    fast, slow = known_modes(samples)
    inner, seconds = slice(samples // 10, -(samples // 10)), []
    for _ in range(repeats):
        start = time.process_time()
        found = decompose(Record(fast + slow, RATE_Hz), rule)
        seconds.append(time.process_time() - start)
    error = np.std(found.imfs[0][inner] - fast[inner]) / np.std(fast[inner])
    return {"imfs": len(found.imfs), "time_ms": 1e3 * min(seconds), "error_percent": 100 * float(error)}


def emd_rules(out: Path, samples: tuple[int, ...] = (267, 4000, 20000)) -> Iterator[Row]:
    """Each rule on records of each length."""
    for count in samples:
        for rule in STOPPING_RULES:
            yield Row({"rule": rule, "samples": count}, partial(cost, rule, count))
