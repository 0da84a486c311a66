"""Error against time of the EMD stopping rules, on a signal whose modes are known."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from analysis.signals.emd import STOPPING_RULES, decompose
from analysis.signals.records import Record


@dataclass(frozen=True)
class RuleCost:
    """What a rule takes and how well it finds the modes.

    seconds: of processor time, since the report keeps them, and other programs may have run then. The error is the RMS
    of (first IMF - first mode) over the RMS of that mode, away from the ends.
    """

    rule: str
    samples: int
    imfs: int
    seconds: float
    error: float


def known_modes(samples: int, rate_Hz: float = 6667.0) -> tuple[np.ndarray, np.ndarray]:
    """Return a mode about 900 Hz, modulated in amplitude and frequency, and a tone of 110 Hz, each (samples,)."""
    t = np.arange(samples) / rate_Hz
    fast = (1 + 0.4 * np.cos(2 * np.pi * 15 * t)) * np.cos(2 * np.pi * 900 * t + 3 * np.sin(2 * np.pi * 10 * t))
    return fast, 0.7 * np.sin(2 * np.pi * 110 * t)


def compare_rules(samples: int, repeats: int = 3) -> list[RuleCost]:
    """Return for each rule on the known signal the least processor time of some repeats, and the error."""
    fast, slow = known_modes(samples)
    record = Record(fast + slow, 6667.0)
    inner = slice(samples // 10, -(samples // 10))
    costs = []
    for rule in STOPPING_RULES:
        seconds = []
        for _ in range(repeats):
            start = time.process_time()
            found = decompose(record, rule)
            seconds.append(time.process_time() - start)
        error = np.std(found.imfs[0][inner] - fast[inner]) / np.std(fast[inner])
        costs.append(RuleCost(rule, samples, len(found.imfs), min(seconds), float(error)))
    return costs
