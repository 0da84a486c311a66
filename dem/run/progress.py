"""Progress of long work on the terminal: the stage, simulated time, time left."""

from __future__ import annotations

import logging
import sys
import time
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from common.process.messages import told

_log = logging.getLogger(__name__)
INTERVAL_s = 0.5  # between two lines on a terminal; a log gets one a tenth
IMPACT_s = 2e-3  # from the arrival of a stone to flights of what is left of it
FLIGHTS, GUESS = 0.7, 0.02  # guess of the wall time of all flights over that of all impacts, and its weight


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
    """Says how far the run `name` of `duration_s` simulated seconds is, if `shown`. Stones arrive at `arrivals_s`.

    While a stone strikes and breaks the engine is many times slower than while all fly, so the time left is that of the
    impacts to come and that of the flights, each by its own speed so far, that of the flights first guessed."""

    def __init__(self, name: str, duration_s: float, shown: bool, arrivals_s: Iterable[float] = (0.0,),
                 clock: Callable[[], float] = time.monotonic):
        self._name, self._duration_s, self._clock = name, duration_s, clock
        self._shown = shown and _log.isEnabledFor(logging.INFO)
        self._edges_s = _impacts(arrivals_s, duration_s)
        self._last, self._tenth, self._on_terminal = 0.0, 0, sys.stderr.isatty()
        self._first_s = -1.0  # above zero for a run that was taken up again, below until it is known
        self._at, self._wall_s = 0.0, [0.0, 0.0]  # of the clock; spent in flights and in impacts

    def __call__(self, t_s: float) -> None:
        """Take note of the simulated time; called often, it writes seldom."""
        if not self._shown:
            return
        now = self._clock()
        if self._first_s < 0:
            self._first_s, self._tenth, self._at = t_s, int(10 * t_s / self._duration_s), now
        self._wall_s[bisect_right(self._edges_s, t_s) % 2] += now - self._at
        self._at, tenth = now, int(10 * t_s / self._duration_s)
        if now - self._last < INTERVAL_s if self._on_terminal else tenth <= self._tenth:
            return
        self._last, self._tenth = now, tenth
        start, end = ("\r", "") if self._on_terminal else ("", "\n")
        self._write(f"{start}{self._name}  {t_s:.4f} of {self._duration_s:g} s  left {self.left_s(t_s):4.0f} s{end}")

    def left_s(self, t_s: float) -> float:
        """The time that the rest will take, at the simulated time t_s."""
        flown_s, struck_s = self._split_s(self._first_s, t_s)
        to_fly_s, to_strike_s = self._split_s(t_s, self._duration_s)
        of_flights, of_impacts = self._wall_s
        of_impact = of_impacts / struck_s if struck_s > 0 else 0.0  # wall time over simulated time
        all_flights_s = flown_s + to_fly_s
        guess = FLIGHTS * of_impact * (struck_s + to_strike_s)  # for all flights, which counts as GUESS of them
        weight = GUESS * all_flights_s if guess > 0 else 0.0
        of_flight = (of_flights + weight * guess / all_flights_s) / (flown_s + weight) if flown_s + weight > 0 else 0.0
        return (of_impact if struck_s > 0 else of_flight) * to_strike_s + of_flight * to_fly_s

    def _split_s(self, begin_s: float, end_s: float) -> tuple[float, float]:
        """How much of an interval of simulated time is flights and impacts."""
        edges = self._edges_s
        struck_s = sum(max(0.0, min(b, end_s) - max(a, begin_s)) for a, b in zip(edges[::2], edges[1::2], strict=True))
        return end_s - begin_s - struck_s, struck_s

    def end(self) -> None:
        """Clear the line on a terminal."""
        if self._shown and self._on_terminal:
            self._write("\r\033[K")

    @staticmethod
    def _write(text: str) -> None:
        """To the terminal itself: a line that is written over is no message."""
        sys.stderr.write(text)
        sys.stderr.flush()


def _impacts(arrivals_s: Iterable[float], duration_s: float) -> list[float]:
    """Begin and end of the times within which a stone has just arrived, in order."""
    edges: list[float] = []
    for arrival_s in sorted(arrivals_s):
        end_s = min(arrival_s + IMPACT_s, duration_s)
        if edges and arrival_s <= edges[-1]:
            edges[-1] = max(edges[-1], end_s)
        elif arrival_s < duration_s:
            edges += [arrival_s, end_s]
    return edges
