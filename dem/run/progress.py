"""How far a run is, and how long the rest will take."""

import logging
import sys
import time
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable
from math import exp, inf

_log = logging.getLogger(__name__)
INTERVAL_s = 0.5  # between two lines on a terminal; a log gets one a tenth
IMPACT_s = 1.2e-3  # from the arrival of a stone until it has left the plate and rings no more
FLIGHT_s = 1e-4  # so long nothing touches the plate: the engine asks only then again where it is
FLIGHT, FLOWN_s = 0.3, 1e-3  # until flights tell: their speed over that of impacts at most, as if for FLOWN_s


class Progress:
    """Says how far the run `name` of `duration_s` simulated seconds is, if `shown`. Stones arrive at `arrivals_s`.

    While a stone strikes and breaks the engine is a thousand times slower than while all fly. So the time left is that
    of the impacts to come, each as long as those so far, and that of all else, by its own speed so far. What breaks may
    fly off or lie on the plate, which nobody knows: it is told from its least to its most."""

    def __init__(self, name: str, duration_s: float, shown: bool, arrivals_s: Iterable[float] = (0.0,),
                 clock: Callable[[], float] = time.monotonic):
        self._name, self._duration_s, self._clock = name, duration_s, clock
        self._shown = shown and _log.isEnabledFor(logging.INFO)
        self._arrivals_s = sorted(one for one in arrivals_s if one < duration_s)
        self._last, self._tenth, self._on_terminal = 0.0, 0, sys.stderr.isatty()
        self._at, self._t_s, self._impact_end_s = -1.0, 0.0, -1.0  # of the clock; simulated
        self._before, self._arrived = 0, 0  # stones that were there as this process began, and now
        self._spent_s = {True: 0.0, False: 0.0}  # wall time in impacts, and in all else
        self._passed_s = {True: 0.0, False: 0.0}  # simulated
        self._lately = [0.0, 0.0]  # wall and simulated time of all else, of which older counts less

    def __call__(self, t_s: float) -> None:
        """Take note of the simulated time; called often, it writes seldom."""
        if not self._shown:
            return
        now, arrived, tenth = self._clock(), bisect_right(self._arrivals_s, t_s), int(10 * t_s / self._duration_s)
        if self._at < 0:
            self._t_s, self._tenth = t_s, tenth
            self._before = self._arrived = bisect_left(self._arrivals_s, t_s)
        if self._at < 0 or self._t_s == 0:  # the engine has read its deck when its first row is there
            self._at = now
        if arrived > self._arrived:
            self._arrived, self._impact_end_s = arrived, t_s + IMPACT_s
        strikes = self._t_s < self._impact_end_s
        if t_s - self._t_s > FLIGHT_s:  # what rings still belonged to the impact
            self._impact_end_s = -1.0
        self._spent_s[strikes] += now - self._at
        self._passed_s[strikes] += t_s - self._t_s
        if not strikes and self._t_s:  # what fell bounces, breaks and lies still: the last eighth tells what comes
            fade = exp(-8 * (t_s - self._t_s) / self._duration_s)
            self._lately = [fade * self._lately[0] + now - self._at, fade * self._lately[1] + t_s - self._t_s]
        self._at, self._t_s = now, t_s
        if now - self._last < INTERVAL_s if self._on_terminal else tenth <= self._tenth:
            return
        self._last, self._tenth = now, tenth
        start, end = ("\r", "  ") if self._on_terminal else ("", "\n")
        least_s, most_s = self.left_s()
        left = f"{least_s:.0f} to {most_s:.0f} s" if most_s < inf else f"over {least_s:.0f} s"
        self._write(f"{start}{self._name}  {t_s:.4f} of {self._duration_s:g} s  left {left}{end}")

    def left_s(self) -> tuple[float, float]:
        """The least and the most that the rest will take; the most is infinite until a stone has told of the others."""
        seen, to_come = self._arrived - self._before, len(self._arrivals_s) - self._arrived
        spent_s, struck_s = self._spent_s[True], self._passed_s[True]
        speed = spent_s / struck_s if struck_s else 0.0
        under_way_s = max(0.0, min(self._impact_end_s, self._duration_s) - self._t_s)
        impacts_s = speed * under_way_s + (to_come * spent_s / seen if seen else 0.0)
        wall_s, lately_s = self._lately
        rest_s = max(0.0, self._duration_s - self._t_s - under_way_s - (to_come * struck_s / seen if seen else 0.0))
        flights_s = rest_s * (wall_s + FLIGHT * speed * FLOWN_s) / (lately_s + FLOWN_s)
        known = self._passed_s[False] / (self._passed_s[False] + rest_s) if rest_s else 1.0
        unknown = to_come > 0 and not seen or not sum(self._spent_s.values())
        return (impacts_s / 2 + flights_s * known / 2,
                inf if unknown else 2 * impacts_s + flights_s * (1 + 3 * known))

    def end(self) -> None:
        if self._shown and self._on_terminal:
            self._write("\r\033[K")

    @staticmethod
    def _write(text: str) -> None:
        """To the terminal itself: a line that is written over is no message."""
        sys.stderr.write(text)
        sys.stderr.flush()
