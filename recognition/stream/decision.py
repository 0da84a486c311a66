"""When to stop drawing: a sequential test (CUSUM) on the stones as they are heard.

A stone's odds of gangue give the likelihood of two shares of gangue, one on the way to that above which drawing shall
stop, and one at which it must not. The logarithm of their ratio is summed up over the stones, from zero, and never
below zero; past a threshold it is an alarm, and the sum begins anew. What a threshold costs is known beforehand: the
sum is a Markov chain (Brook and Evans, Biometrika 59, 539) whose mean time to an alarm is that of a linear system. What
stones add to the sum is told by the known ones, as they are, since no law is quite right; of a material of which few
are known, by stones drawn from the laws that were learnt (a Dirichlet process about each law). As both are uncertain,
so are delay and false alarms.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError
from recognition.innovations.prior import StonePrior
from recognition.stream.stone_law import UNKNOWN, LearntLaw, Told

CALM = 0.5  # of the share above which drawing shall stop: where alarms are false ones
#: Of it, at which likelihoods are compared with those at CALM. A share that rises passes it first: an alarm comes
#: sooner than by the likelihood of the share itself, and hardly later if the share jumps there.
RISING = 0.8
LIKELY, SLOWEST = 0.8, 0.9  # of the laws have no more false alarms than are allowed; are no slower than is said
DRAWN, LAWS = 150, 12  # stones of a material of each law, and laws, by which an alarm is foreseen
AS_KNOWN = 25  # all that are drawn of a law count as so many known ones
STATES, HIGHEST, HALVINGS = 160, 24.0, 8  # of the sum; thresholds are sought up to HIGHEST
FIRST, LONGER, LAST = 25, 2.0, 800  # stones heard at which the law is learnt, how many times as many again, the last
LATER_S = 2.0  # after the stones that taught it a law judges others; it is learnt meanwhile
NEVER = 1e12  # stones: the linear system has no digits left for a mean time beyond
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
        high, low = (p * gangue + (1 - p) * (1 - gangue) for p in (RISING * self.above, CALM * self.above))
        return np.asarray(np.log(high / low))


@dataclass(frozen=True)
class Foreseen:
    """Threshold, and by the median law the delay of an alarm at the share asked for, in stones, with that of nine laws
    in ten; false alarms an hour at half of that share, of four laws in five. tried: thresholds with their false alarms
    and delays, a row each."""

    threshold: float
    delay: float
    longest_delay: float
    false_alarms_1_h: float
    tried: Sequence[tuple[float, float, float]] = ()

    @property
    def unsafe(self) -> bool:
        """Whether the laws differ so much that the alarm cannot be relied on."""
        return self.threshold >= HIGHEST or self.longest_delay > SLOW * self.delay


@dataclass(frozen=True)
class Learnt:
    """A law, what it foresees of the test at a rate of stones, and that rate."""

    law: LearntLaw
    foreseen: Foreseen | None
    rate_1_s: float


@dataclass(frozen=True)
class Judged:
    """Stones by what was learnt: probabilities of gangue by each draw of the law (n, laws), and of none (n,); the sum
    of the test after each, and at which of them there was an alarm."""

    by: Learnt
    told: Told
    by_law: Floats
    none: Floats
    sum: Floats
    alarm: NDArray[np.bool_]


class Judge:
    """Judges stones in their order, each by the law that known stones and those before it teach. A law is learnt while
    stones are judged by the one before, and is that of stones that arrive LATER_S later."""

    def __init__(self, known: Told, prior: StonePrior, stop: Stop | None, least_doubt: float) -> None:
        self.known = self.taught = known
        self.prior, self.stop, self.least_doubt = prior, stop, least_doubt
        self.waiting, self.t_s = known.only(np.zeros(0, dtype=int)), np.zeros(0)
        self.count, self.due, self.total = 0, FIRST, 0.0
        self.began_s = self.latest_s = self.from_s = 0.0
        self.learnt: Learnt | None = None
        self.coming: Future[Learnt] | None = None
        self.beside = ThreadPoolExecutor(1)

    def judge(self, told: Told, t_s: Floats, ended: bool = False) -> Iterator[Judged]:
        """Further unknown stones, which arrived at t_s (n,); the first FIRST wait for each other, unless all ended."""
        self.waiting, self.t_s = self.waiting.and_(told), np.append(self.t_s, t_s)
        while len(self.t_s) and (self.learnt is not None or ended or len(self.t_s) >= FIRST):
            if self.learnt is None:
                first = np.arange(min(FIRST, len(self.t_s)))
                self.began_s, self.latest_s = float(self.t_s[0]), float(self.t_s[first[-1]])
                heard = self.taught if len(self.taught.x) else self.waiting.only(first)
                self.learnt = self._learnt(heard, self._rate_1_s(len(first)))
            if self.coming is not None and self.t_s[0] >= self.from_s:
                self.learnt, self.coming = self.coming.result(), None
            if self.coming is None and self.due <= min(self.count, LAST):
                self.coming = self.beside.submit(self._learnt, self.taught, self._rate_1_s(self.count))
                self.due, self.from_s = round(LONGER * self.count), self.latest_s + LATER_S
            now, later = np.split(np.arange(len(self.t_s)), [self._alike()])
            if not len(now):  # after a pause, in which a law that was due just now would have been learnt: it is theirs
                continue
            found = self._judged(self.waiting.only(now), self.learnt)
            if self.count < LAST:
                self.taught = self.taught.and_(found.told)
            self.count, self.latest_s = self.count + len(now), float(self.t_s[now[-1]])
            self.waiting, self.t_s = self.waiting.only(later), self.t_s[later]
            yield found

    def _rate_1_s(self, count: int) -> float:
        return max(count, 2) / max(self.latest_s - self.began_s, 1e-3)

    def _learnt(self, heard: Told, rate_1_s: float) -> Learnt:
        law = LearntLaw.of(heard, self.prior, rate_1_s)
        seen = None if self.stop is None else foreseen(law, heard, self.stop, rate_1_s, self.least_doubt)
        return Learnt(law, seen, rate_1_s)

    def _alike(self) -> int:
        """How many of those that wait are judged by one law, and teach one."""
        if self.coming is None:
            return max(self.due - self.count, 0) or len(self.t_s)
        late = np.flatnonzero(self.t_s >= self.from_s)
        return int(late[0]) if len(late) else len(self.t_s)

    def _judged(self, told: Told, learnt: Learnt) -> Judged:
        by_law, none = learnt.law.probabilities(told, self.least_doubt)
        sums, alarms = np.zeros(len(none)), np.zeros(len(none), dtype=bool)
        if self.stop is not None and learnt.foreseen is not None:
            for k, gain in enumerate(self.stop.gain(_any_stone(by_law, none))):
                self.total = max(0.0, self.total + gain)
                sums[k], alarms[k] = self.total, self.total > learnt.foreseen.threshold and not learnt.foreseen.unsafe
                self.total = 0.0 if alarms[k] else self.total
        return Judged(learnt, told, by_law, none, sums, alarms)


@dataclass(frozen=True)
class Followed:
    """The sum after each stone that is not known, at which of them there was an alarm, and what was foreseen last."""

    sum: Floats
    alarm: NDArray[np.bool_]
    foreseen: Foreseen


def follow(told: Told, t_s: Floats, prior: StonePrior, stop: Stop, least_doubt: float) -> Followed:
    """The test on stones that arrived at t_s (n,), of known ones anything."""
    known = told.known != UNKNOWN
    judge = Judge(told.only(np.flatnonzero(known)), prior, stop, least_doubt)
    found = list(judge.judge(told.only(np.flatnonzero(~known)), t_s[~known], ended=True))
    assert judge.learnt is not None and judge.learnt.foreseen is not None
    return Followed(np.concatenate([one.sum for one in found]), np.concatenate([one.alarm for one in found]),
                    judge.learnt.foreseen)


def foreseen(law: LearntLaw, told: Told, stop: Stop, rate_1_s: float, least_doubt: float) -> Foreseen:
    """The least threshold with no more false alarms than are allowed by LIKELY of the laws, and its delay.

    Unknown coal that looks like gangue draws the gangue of a law nearer to coal, and true gangue would alarm more: no
    more false alarms are allowed either if gangue is as far from coal as was believed."""
    def gains(stones: Told) -> Floats:
        return stop.gain(_any_stone(*law.probabilities(stones, least_doubt)))

    rng, nobody_knows = np.random.default_rng(3), replace(told, known=np.full_like(told.known, UNKNOWN))
    known = [gains(nobody_knows.only(np.flatnonzero(told.known == m))) for m in (0, 1)]
    learnt, believed = ([[gains(one.drawn(k, m, DRAWN, told)) for m in (0, 1)]
                         for k in np.linspace(0, len(law.laws) - 1, LAWS).astype(int)]
                        for one in (law, law.apart_as_believed()))
    weights = [[rng.dirichlet(np.r_[np.ones(len(known[m])), np.full(DRAWN, AS_KNOWN / DRAWN)]) for m in (0, 1)]
               for _ in learnt]

    def stones(threshold: float, share: float, drawn: list[list[Floats]] = learnt) -> Floats:
        return np.array([mean_stones(np.r_[known[0], a, known[1], b], np.r_[(1 - share) * v, share * w], threshold)
                         for (a, b), (v, w) in zip(drawn, weights, strict=True)])

    def false_1_h(threshold: float) -> float:
        return max(3600 * rate_1_s / float(np.quantile(stones(threshold, CALM * stop.above, drawn), 1 - LIKELY))
                   for drawn in (learnt, believed))

    low, high, tried = 0.0, HIGHEST, []
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        false = false_1_h(middle)
        tried.append((middle, false, float(np.median(stones(middle, stop.above)))))
        low, high = (low, middle) if false <= stop.false_alarms_1_h else (middle, high)
    delay = stones(high, stop.above)
    return Foreseen(high, float(np.median(delay)), float(np.quantile(delay, SLOWEST)), false_1_h(high), sorted(tried))


def mean_stones(gains: Floats, weight: Floats, threshold: float) -> float:
    """Mean number of stones to an alarm, at most NEVER: gains (n,) of stones, with probabilities (n,)."""
    at, step = threshold * np.arange(STATES) / STATES, threshold / STATES
    to = np.clip((at[:, None] + gains) / step, 0, STATES)
    low = np.floor(to).astype(int).clip(max=STATES - 1)
    part = to - low  # shared between neighbours: the mean is kept
    state = low + (STATES + 1) * np.arange(STATES)[:, None]
    moves = np.bincount(np.r_[state, state + 1].ravel(), np.r_[weight * (1 - part), weight * part].ravel(),
                        STATES * (STATES + 1)).reshape(STATES, -1)
    try:
        mean = float(np.linalg.solve(np.eye(STATES) - moves[:, :STATES], np.ones(STATES))[0])
    except np.linalg.LinAlgError:  # none gets there, in all digits
        return NEVER
    return 1 / max(1 / mean, 1 / NEVER)  # rounding may make it negative


def _any_stone(by_law: Floats, none: Floats) -> Floats:
    """(n,): of gangue, the mean of all laws; of what is no stone one half, which changes no sum by much."""
    return np.asarray(none / 2 + (1 - none) * by_law.mean(axis=1))
