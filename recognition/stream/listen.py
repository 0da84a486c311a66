"""Stones one by one from the innovations, in the order of their arrival."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.innovations.bank import FIT_LAGS, IMPULSE, LAGS, PARAMETERS, TIME, Bank
from recognition.innovations.signatures import LEAD
from recognition.stream.fit import NO_STONES, Fit, Window, in_order
from recognition.stream.prior import StonePrior
from recognition.stream.search import Dictionary

SCANNED = 1000  # samples at once
BLOCK = 8  # samples whose energy tells that something fell
LOOK_BACK = 4  # samples before that moment that belong to the window
MOST_AT_ONCE = 12  # stones of one window
LEAST_GAIN = 15.0  # of the log posterior, for a stone to be believed
BAD_MISFIT = 4.0  # of a window, from which its stones are sought anew one by one
LEAST_EVIDENCE = 20.0  # of the log, with the misfit as noise, for a stone to be believed
LEAST_SHARE = 0.05  # of a window's chi-square that a further stone must explain: a plate's model is never exact
CHECKED, HOPELESS = 40, 0.4  # after so many windows each: the share unexplained with which it is given up
WINDOW = LEAD + LOOK_BACK + FIT_LAGS + 30  # samples in which stones are fitted together
SURE = WINDOW - 50  # a stone that is found later in a window may be the beginning of another, which is not yet in it
LEAST_IMPULSE = 0.8  # of the smallest that a stone is expected to have
HEARD_SHARE = 0.1  # of the energy of that impulse on a place where it is hardly heard: less is not searched for


@dataclass(frozen=True)
class Heard:
    """A stone.

    stone (6,): its parameters, with covariance (6, 6), as the wide prior of the fit has them; misfit: chi-square of its
    window per sample; gain: of the log likelihood of the window by this stone; evidence: the same with the misfit as
    noise.
    """

    stone: Floats
    covariance: Floats
    misfit: float
    gain: float
    evidence: float


@dataclass
class Listener:
    """Follows innovations (c, samples) from their beginning; `hear` gives all stones of a record.

    `hear` leaves behind the innovations (`whole`), what no stone explains of them (`left`), both with `end` samples and
    more of zeros.
    """

    bank: Bank
    prior: StonePrior
    dictionary: Dictionary

    def hear(self, innovations: Floats, begin: int = 0) -> list[Heard]:
        """All stones from a sample on, in the order of arrival, or those up to where it is hopeless: this is not the
        plate.

        A stone is final WINDOW samples after its arrival.
        """
        self.left = np.pad(innovations, ((0, 0), (0, LAGS + FIT_LAGS)))
        self.whole, self.begin, self.end = self.left.copy(), begin, innovations.shape[1]
        before = np.cumsum(np.pad(np.sum(self.whole**2, axis=0), (FIT_LAGS, 0)))
        self.around = LEAST_SHARE / 2 * (before[FIT_LAGS:] - before[:-FIT_LAGS])
        heard: list[Heard] = []
        waiting = NO_STONES
        at = max(LEAD + LOOK_BACK, begin)
        for window_number in count(1):
            if window_number % CHECKED == 0 and self.unexplained(at) > HOPELESS:
                break
            trigger = self._trigger(at)
            if len(waiting):
                trigger = max(at, min(trigger, int(waiting[0, TIME]) - LEAD // 2))  # never back to what was rejected
            if trigger >= self.end - BLOCK:
                break
            first = max(trigger - LEAD - LOOK_BACK, 0)
            fit, window = self._window(first, waiting)
            if not len(fit.stones):
                at, waiting = trigger + BLOCK, NO_STONES
                continue
            if fit.stones[0, TIME] >= first + SURE:
                at, waiting = max(trigger + BLOCK // 2, int(fit.stones[0, TIME]) - LEAD - BLOCK), NO_STONES
                continue
            fit, window = _before_late(fit, window)
            fit, stone = self._judged(window, fit)
            centre = int(fit.stones[0, TIME])
            waiting = fit.stones[1:]
            if stone.evidence > LEAST_EVIDENCE and stone.gain > self._needed(window):
                heard.append(stone)
                self._subtract(stone.stone)
                at = max(at, centre - LOOK_BACK)
            else:
                at = max(at, centre) + LOOK_BACK
        return heard

    def unexplained(self, until: int) -> float:
        """Share of the innovations' energy before a sample, above that of noise, that no stone explains."""
        noise = self.bank.channels * (until - self.begin)
        energy, left = (float(np.sum(values[:, self.begin:until] ** 2)) - noise for values in (self.whole, self.left))
        return max(left, 0.0) / max(energy, 1.0)

    @cached_property
    def least_impulse(self) -> float:
        """Logarithm of the impulse that a stone has at least."""
        return float(self.prior.means[..., 2].min() + np.log(LEAST_IMPULSE))

    @cached_property
    def limit(self) -> float:
        """Energy of a block that is worth a search: more than noise gives, and what a weak stone gives at least."""
        c, d = self.bank.channels, self.dictionary
        noise = c * BLOCK + 6 * np.sqrt(2 * c * BLOCK)
        begins = d.signatures @ d.basis[(LEAD - 2) * c:(LEAD - 2 + BLOCK) * c].T
        block = np.sum(begins**2, axis=1) * d.length**2
        return float(max(noise, HEARD_SHARE * np.quantile(block, 0.1) * np.exp(2 * self.least_impulse)))

    def _trigger(self, at: int) -> int:
        """First sample from `at` on where the energy of a block passes the limit; the end if it does nowhere."""
        while at < self.end:
            part = (self.left[:, at:at + SCANNED + BLOCK] ** 2).sum(axis=0)
            energy = np.convolve(part, np.ones(BLOCK), "valid")
            over = np.flatnonzero(energy > np.maximum(self.limit, self.around[at:at + len(energy)]))
            if len(over):
                return at + int(over[0])
            at += SCANNED
        return self.end

    def _window(self, first: int, waiting: Floats) -> tuple[Fit, Window]:
        """The stones of the window that begins at `first`, by adding one after the other."""
        window = Window(self.bank, self.prior, self.left[:, first:first + WINDOW], first)
        fit = window.fit(waiting) if len(waiting) else window.at(NO_STONES)
        tried = first + LEAD
        while len(fit.stones) < MOST_AT_ONCE:
            better = self._one_more(window, fit, tried)
            if better is None:
                break
            fit = better
        if len(fit.stones) > 1 and fit.chi_square > BAD_MISFIT * window.values.size:
            fit = self._sought_anew(window, fit, tried)
        return fit, window

    def _sought_anew(self, window: Window, fit: Fit, after: int) -> Fit:
        """The fit with each stone in turn taken out and found again where that is better: the first places of stones
        that overlap are between them."""
        for i in range(len(fit.stones)):
            others = window.at(np.delete(fit.stones, i, axis=0))
            again = self._one_more(window, others, after)
            if again is not None and again.cost < fit.cost - LEAST_GAIN:
                fit = again
        return fit

    def _one_more(self, window: Window, fit: Fit, after: int) -> Fit | None:
        """The fit with the stone that explains most of what is left; None where none is worth it."""
        left, needed = window.residual(fit.stones), self._needed(window)
        until = window.first + window.values.shape[1] - 24
        if 0.5 * float(np.sum(left[:, after - LEAD - window.first:] ** 2)) < needed:  # no stone can explain more
            return None
        padded = np.pad(left, ((0, 0), (0, FIT_LAGS)))
        starts = self.dictionary.starts(padded, window.first, range(after, until), needed)
        if not starts:
            return None
        alone = replace(window, values=left)
        new = min((alone.fit(s[None], 2) for s in starts), key=lambda f: f.cost)
        best = window.fit(in_order(np.vstack([fit.stones, new.stones])))
        if fit.cost - best.cost < needed or best.stones[:, IMPULSE].min() < self.least_impulse:
            return None
        return best if np.all(np.diff(best.stones[:, TIME]) >= 0) else window.at(in_order(best.stones))

    def _needed(self, window: Window) -> float:
        """Gain that a stone must bring: some of the energy about it, also of what was heard and taken away before."""
        energy = np.sum(self.whole[:, window.first:window.first + window.values.shape[1]] ** 2)
        return max(LEAST_GAIN, LEAST_SHARE * float(energy) / 2)

    def _judged(self, window: Window, fit: Fit) -> tuple[Fit, Heard]:
        """The fit with the misfit as noise, and what it says of the first stone."""
        misfit = fit.chi_square / window.values.size
        window = replace(window, temper=max(1.0, misfit))
        fit = window.fit(fit.stones)
        gain = window.at(fit.stones[1:]).cost - fit.cost
        inverse = np.linalg.inv(fit.curvature + 1e-9 * np.eye(len(fit.curvature)))
        covariance = np.asarray(inverse[:PARAMETERS, :PARAMETERS], dtype=float)
        return fit, Heard(fit.stones[0], covariance, misfit, gain * window.temper, gain)

    def _subtract(self, stone: Floats) -> None:
        start, signature = self.bank.whole(stone)
        low = max(start, 0)
        self.left[:, low:start + LAGS] -= signature[:, low - start:]


def _before_late(fit: Fit, window: Window) -> tuple[Fit, Window]:
    """The same up to where the first stone begins that may not be in the window as a whole."""
    late = fit.stones[:, TIME] >= window.first + SURE
    if not late.any():
        return fit, window
    first_late = int(fit.stones[late, TIME].min())
    shorter = replace(window, values=window.values[:, :first_late - LEAD - window.first])
    return shorter.fit(fit.stones[~late]), shorter

