"""When to stop drawing: a sequential test (CUSUM) on the stones as they are heard.

A stone's odds of gangue give the likelihood of two shares of gangue, the one above which drawing shall stop and half of
it. The logarithm of their ratio is summed up over the stones, from zero, and never below zero; past a threshold it is
an alarm, and the sum begins anew. What a threshold costs is known beforehand: stones are drawn from the laws that known
stones and those heard so far teach, and the sum is a Markov chain (Brook and Evans, Biometrika 59, 539) whose mean time
to an alarm is that of a linear system. As laws are uncertain, so are delay and false alarms.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError
from recognition.stream.prior import StonePrior
from recognition.stream.stone_law import UNKNOWN, LearntLaw, Told, doubted

CALM = 0.5  # of the share from which drawing shall stop: at it alarms are false ones
LIKELY = 0.9  # of the laws have no more false alarms than are allowed
DRAWN, LAWS = 150, 12  # stones of a material of each law, and laws, by which an alarm is foreseen
STATES, HIGHEST, HALVINGS = 80, 16.0, 7  # of the sum; thresholds are sought up to HIGHEST
FIRST, LONGER, LAST = 25, 2.0, 800  # stones heard at which the law is learnt, how many times as many again, the last
SLOW = 4.0  # times the delay by the median law: where one law in ten is slower, references are too few


@dataclass(frozen=True)
class Stop:
    """What is asked: an alarm above a share of gangue, and so many false ones an hour."""

    above: float
    false_alarms_1_h: float

    def __post_init__(self) -> None:
        if not 0.02 <= self.above <= 0.98:
            raise RecognitionError(f"--stop-above {100 * self.above:g}: must be from 2 to 98 %")
        if not 1e-3 <= self.false_alarms_1_h <= 1e3:
            raise RecognitionError(f"--false-alarms-per-hour {self.false_alarms_1_h:g}: must be from 0.001 to 1000")

    def gain(self, gangue: Floats) -> Floats:
        """Log likelihood ratio of stones of a probability of gangue."""
        high, low = (p * gangue + (1 - p) * (1 - gangue) for p in (self.above, CALM * self.above))
        return np.asarray(np.log(high / low))


@dataclass(frozen=True)
class Foreseen:
    """Threshold, and by the median law the delay of an alarm at the share asked for, in stones, with that of nine laws
    in ten; false alarms an hour at half of that share, of nine laws in ten."""

    threshold: float
    delay: float
    longest_delay: float
    false_alarms_1_h: float

    @property
    def unsafe(self) -> bool:
        """Whether the laws differ so much that the alarm cannot be relied on."""
        return self.threshold >= HIGHEST or self.longest_delay > SLOW * self.delay


@dataclass(frozen=True)
class Followed:
    """The sum after each stone that is not known, at which of them there was an alarm, and what was foreseen last."""

    sum: Floats
    alarm: np.ndarray
    foreseen: Foreseen


def follow(told: Told, prior: StonePrior, stop: Stop, rate_1_s: float, least_doubt: float) -> Followed:
    """The test on stones in their order, each by the law that known stones and those before it teach."""
    known, unknown = np.flatnonzero(told.known != UNKNOWN), np.flatnonzero(told.known == UNKNOWN)
    total, sums, alarms, last = 0.0, [], [], None
    for begin, end in _stretches(len(unknown)):
        heard = np.r_[known, unknown[:begin]] if len(known) or begin else unknown[:FIRST]
        law = LearntLaw.of(told.only(heard), prior)
        last = foreseen(law, told.only(heard), stop, rate_1_s, least_doubt)
        for gain in stop.gain(_probability(law, told.only(unknown[begin:end]), least_doubt)):
            total = max(0.0, total + gain)
            alarms.append(total > last.threshold and not last.unsafe)
            sums.append(total)
            total = 0.0 if alarms[-1] else total
    assert last is not None
    return Followed(np.array(sums), np.array(alarms, dtype=bool), last)


def _stretches(count: int) -> Iterator[tuple[int, int]]:
    begin, end = 0, FIRST
    while begin < max(count, 1):
        end = count if end > LAST else min(end, count)
        yield begin, end
        begin, end = max(end, 1), round(LONGER * max(end, 1))


def foreseen(law: LearntLaw, told: Told, stop: Stop, rate_1_s: float, least_doubt: float) -> Foreseen:
    """The least threshold with no more false alarms than are allowed by LIKELY of the laws, and its delay."""
    gains = [[stop.gain(_probability(law, law.drawn(k, m, DRAWN, told), least_doubt)) for m in (0, 1)]
             for k in np.linspace(0, len(law.laws) - 1, LAWS).astype(int)]

    def stones(threshold: float, share: float) -> Floats:
        return np.array([mean_stones(coal, gangue, share, threshold) for coal, gangue in gains])

    def false_1_h(threshold: float) -> float:
        return 3600 * rate_1_s / float(np.quantile(stones(threshold, CALM * stop.above), 1 - LIKELY))

    low, high = 0.0, HIGHEST
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if false_1_h(middle) <= stop.false_alarms_1_h else (middle, high)
    delay = stones(high, stop.above)
    return Foreseen(high, float(np.median(delay)), float(np.quantile(delay, LIKELY)), false_1_h(high))


def mean_stones(coal: Floats, gangue: Floats, share: float, threshold: float) -> float:
    """Mean number of stones to an alarm, where a share of them is gangue: gains (n,) of coal and of gangue are as
    frequent as each other."""
    at = threshold * np.arange(STATES) / STATES
    step = threshold / STATES
    total = np.zeros((STATES, STATES + 1))
    for gains, weight in ((coal, 1 - share), (gangue, share)):
        to = np.clip((at[:, None] + gains) / step, 0, STATES)
        low = np.floor(to).astype(int).clip(max=STATES - 1)
        part = np.where(to >= STATES, 1.0, to - low)  # shared between neighbours: the mean is kept
        row = np.repeat(np.arange(STATES), len(gains)).reshape(low.shape)
        np.add.at(total, (row, low), weight / len(gains) * (1 - part))
        np.add.at(total, (row, low + 1), weight / len(gains) * part)
    return float(np.linalg.solve(np.eye(STATES) - total[:, :STATES], np.ones(STATES))[0])


def _probability(law: LearntLaw, told: Told, least_doubt: float) -> Floats:
    """(n,): of gangue, the mean of all laws; of what is no stone one half, which changes no sum by much."""
    odds, none = law.materials(told)
    return np.asarray(none / 2 + (1 - none) * doubted(odds, least_doubt).mean(axis=1))
