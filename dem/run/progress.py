"""Progress of long work on the terminal: the stage, simulated time, time left."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from common.process.messages import told

_log = logging.getLogger(__name__)
INTERVAL_s = 0.5  # between two lines on a terminal; a log gets one a tenth


@dataclass
class Stages:
    """Wall time by stage, s. Stages of the work `shown` are told; "": none is."""

    wall_time_s: dict[str, float] = field(default_factory=dict)
    shown: str = ""

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Add the time spent within to the stage `name`."""
        start = time.perf_counter()
        with told(f"{self.shown}: {name}" if self.shown else ""):
            yield
        self.wall_time_s[name] = self.wall_time_s.get(name, 0.0) + time.perf_counter() - start

    def copy(self) -> Stages:
        """The times so far, to which each of several runs adds its own."""
        return Stages(dict(self.wall_time_s), self.shown)


class Progress:
    """Says how far the run `name` of `duration_s` simulated seconds is, if `shown`."""

    def __init__(self, name: str, duration_s: float, shown: bool):
        self._name, self._duration_s = name, duration_s
        self._shown = shown and _log.isEnabledFor(logging.INFO)
        self._start = self._last = time.monotonic()
        self._tenth, self._on_terminal = 0, sys.stderr.isatty()
        self._first_share: float | None = None  # above zero for a run that was taken up again

    def __call__(self, t_s: float) -> None:
        """Take note of the simulated time; called often, it writes seldom."""
        if not self._shown:
            return
        share = t_s / self._duration_s
        if self._first_share is None:
            self._first_share, self._tenth = share, int(10 * share)
        if not self._on_terminal and int(10 * share) <= self._tenth:
            return
        now = time.monotonic()
        if self._on_terminal and now - self._last < INTERVAL_s:
            return
        self._last, self._tenth = now, int(10 * share)
        done = share - self._first_share
        left = (now - self._start) * max(0.0, 1 - share) / done if done > 0 else float("inf")
        start, end = ("\r", "") if self._on_terminal else ("", "\n")
        self._write(f"{start}{self._name}  {t_s:.4f} of {self._duration_s:g} s  left {left:4.0f} s{end}")

    def end(self) -> None:
        """Clear the line on a terminal."""
        if self._shown and self._on_terminal:
            self._write("\r\033[K")

    @staticmethod
    def _write(text: str) -> None:
        """To the terminal itself: a line that is written over is no message."""
        sys.stderr.write(text)
        sys.stderr.flush()
