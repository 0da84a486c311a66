"""Stones one by one from the innovations, in the order of their arrival."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.innovations.bank import FIT_LAGS, IMPULSE, LAGS, PARAMETERS, TIME, Bank
from recognition.innovations.prior import StonePrior
from recognition.innovations.signatures import LEAD
from recognition.stream.fit import NO_STONES, Fit, Window, in_order
from recognition.stream.search import Dictionary

SCANNED = 1000  # samples at once
BLOCK = 8  # samples whose energy tells that something fell
LOOK_BACK = 4  # samples before that moment that belong to the window
MOST_AT_ONCE = 12  # stones of one window
LEAST_GAIN = 15.0  # of the log posterior, for a stone to be believed
BAD_MISFIT = 4.0  # of a window, from which its stones are sought anew one by one
LEAST_EVIDENCE = 20.0  # of the log, with the misfit as noise, for a stone to be believed
#: Of a window's chi-square, that a further stone must explain: a plate's model is never exact. One that explains less
#: than CLEAR_SHARE needs more evidence: in 8 streams what was no stone had at most 75, stones at least 110.
LEAST_SHARE, CLEAR_SHARE, CLEAR_EVIDENCE = 0.02, 0.05, 100.0
CHECKED, HOPELESS = 40, 0.4  # after so many windows each: the share unexplained with which a part is passed over
PART, PARTS = 10_000, 6  # samples of a part of a record, and how many of the last are looked at together
KEPT = 300  # samples before those that are listened to: no stone is sought there again
SURELY, TELLING = 3.0, 1e3  # standard deviations of noise; energy of stones in a channel by which its gain is told
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
class Sums:
    """Over samples, of innovations (c, samples): noise that is expected of them, their energy, that of what no stone
    explains, and of each channel the products with what stones explain, and the energy of that."""

    noise: float
    energy: float
    left: float
    product: Floats
    explained: Floats

    @classmethod
    def of(cls, whole: Floats, left: Floats) -> Sums:
        explained = whole - left
        return cls(whole.size, float(np.sum(whole**2)), float(np.sum(left**2)), np.sum(whole * explained, axis=1),
                   np.sum(explained**2, axis=1))

    def __add__(self, other: Sums) -> Sums:
        return Sums(*(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True)))

    @property
    def unexplained(self) -> float:
        """Share of the energy above that of noise that no stone explains."""
        chance = SURELY * np.sqrt(2 * self.noise)
        return max(self.left - self.noise - chance, 0.0) / max(self.energy - self.noise, 1.0)

    @property
    def gain(self) -> Floats:
        """(c,): of each channel, relative to what the stones make of all channels; 1 where that tells too little."""
        tells = self.explained > TELLING
        return np.where(tells, self.product / np.where(tells, self.explained, 1.0), 1.0)


class Listener:
    """Follows innovations as they come, from sample `begin` on.

    It keeps those of the last PART, counted from sample `first`: the innovations (`whole`), and what no stone explains
    of them (`left`), which is followed by what later ones are to be less. past: sums of all before; lately: of its
    last PARTS; unchecked: of what came since the last check. A stone is final WINDOW samples after its arrival.
    """

    def __init__(self, bank: Bank, prior: StonePrior, dictionary: Dictionary, begin: int = 0) -> None:
        self.bank, self.prior, self.dictionary = bank, prior, dictionary
        self.first = self.end = begin
        self.at = begin + LEAD + LOOK_BACK
        self.whole: Floats = np.zeros((bank.channels, 0))
        self.left: Floats = np.zeros((bank.channels, LAGS + FIT_LAGS))
        self.waiting, self.windows, self.checked = NO_STONES, 0, begin
        self.past = self.unchecked = self.sums(begin, begin)
        self.lately: deque[Sums] = deque(maxlen=PARTS)

    def hear(self, innovations: Floats, ended: bool = False) -> list[Heard]:
        """The stones that are final with further innovations (c, samples), in the order of arrival; all of them where
        the record has ended. Where windows are hopeless, since this is not the plate, PART is passed over."""
        n = innovations.shape[1]
        self.whole = np.hstack([self.whole, innovations])
        self.left = np.hstack([self.left, np.zeros((self.bank.channels, n))])
        self.left[:, self.end - self.first:self.end - self.first + n] += innovations
        self.end += n
        heard: list[Heard] = []
        while self._one_window(heard, ended):
            pass
        return heard

    def _one_window(self, heard: list[Heard], ended: bool) -> bool:
        """Whether there was one; a stone in it is added to those that were heard."""
        trigger = max(self.at, self._trigger(self.at))
        if len(self.waiting):  # never back to what was rejected
            trigger = max(self.at, min(trigger, int(self.waiting[0, TIME]) - LEAD // 2))
        else:
            self.at = trigger  # nothing is before it
        self._forget()
        first = trigger - LEAD - LOOK_BACK
        if trigger >= self.end - BLOCK or not ended and first + WINDOW > self.end:
            return False
        self.windows += 1
        if self.windows % CHECKED == 0 and self._hopeless(trigger):
            return True
        fit, window = self._window(first, self.waiting)
        searched = first + SURE - LEAD  # a stone that begins later may not be in the window as a whole
        if not len(fit.stones):
            self.at, self.waiting = searched, NO_STONES
        elif fit.stones[0, TIME] >= first + SURE:
            self.at = max(trigger + BLOCK // 2, int(fit.stones[0, TIME]) - LEAD - BLOCK)
            self.waiting = NO_STONES
        else:
            fit, window = _before_late(fit, window)
            fit, stone = self._judged(window, fit)
            centre, self.waiting = int(fit.stones[0, TIME]), fit.stones[1:]
            if self._believed(window, stone):
                heard.append(stone)
                self._subtract(stone.stone)
                self.at = max(self.at, centre - LOOK_BACK, 0 if len(self.waiting) else searched)
            else:
                self.at = max(self.at, centre) + LOOK_BACK
        return True

    def _hopeless(self, at: int) -> bool:
        """Whether stones explain too little since this was asked last; the next PART is then passed over."""
        since, self.checked = self.unchecked + self.sums(self.checked, at), at
        self.unchecked = self.sums(at, at)
        if since.unexplained <= HOPELESS:
            return False
        self.at = self.checked = at + PART
        self.waiting = NO_STONES
        return True

    def _forget(self) -> None:
        """What is older than PART becomes sums."""
        while min(self.at, self.end) - KEPT > self.first + PART:
            self.lately.append(self.sums(self.first, self.first + PART))
            self.unchecked += self.sums(self.checked, self.first + PART)
            self.past += self.lately[-1]
            self.whole, self.left, self.first = self.whole[:, PART:], self.left[:, PART:], self.first + PART

    @property
    def recent(self) -> Sums:
        """Of what was listened to, the last PARTS."""
        return sum(self.lately, self.sums(self.first, self.at - LEAD - LOOK_BACK))

    @property
    def total(self) -> Sums:
        """Of all."""
        return self.past + self.sums(self.first, self.end)

    def sums(self, since: int, until: int) -> Sums:
        """From a sample to another, of those that are kept."""
        part = slice(max(since - self.first, 0), max(until - self.first, 0))
        return Sums.of(self.whole[:, part], self.left[:, :self.whole.shape[1]][:, part])

    @cached_property
    def least_impulse(self) -> float:
        """Logarithm of the impulse that a stone has at least."""
        return float(self.prior.means[..., 2].min() + np.log(LEAST_IMPULSE))

    @cached_property
    def _begins(self) -> Floats:
        """Energy of the first block of unit impulses on each place of the dictionary."""
        c, d = self.bank.channels, self.dictionary
        begins = d.signatures @ d.basis[(LEAD - 2) * c:(LEAD - 2 + BLOCK) * c].T
        return np.asarray(np.sum(begins**2, axis=1) * d.length**2)

    @cached_property
    def limit(self) -> float:
        """Energy of a block that is worth a search: more than noise gives, and what a weak stone gives at least."""
        values = self.bank.channels * BLOCK
        weak = HEARD_SHARE * np.quantile(self._begins, 0.1) * np.exp(2 * self.least_impulse)
        return float(max(values + 6 * np.sqrt(2 * values), weak))

    def unheard(self, prior: StonePrior) -> float:
        """Share of the stones on any place that are too weak to be heard even alone."""
        noise = self.bank.channels * BLOCK
        needed = np.maximum(2 * LEAST_EVIDENCE / self.dictionary.length**2, (self.limit - noise) / self._begins)
        energy = np.exp(2 * prior.means[..., 2]).ravel()
        return float(np.searchsorted(np.sort(energy), needed).mean() / len(energy))

    def _trigger(self, at: int) -> int:
        """First sample from `at` on where the energy of a block passes the limit; the last block if it does nowhere."""
        last = self.end - BLOCK
        while at < last:
            now, until = at - self.first, min(at + SCANNED, last) - self.first
            energy = np.convolve((self.left[:, now:until + BLOCK - 1] ** 2).sum(axis=0), np.ones(BLOCK), "valid")
            before = (self.whole[:, max(now - FIT_LAGS + 1, 0):until] ** 2).sum(axis=0)
            around = np.convolve(before, np.ones(FIT_LAGS))[:len(before)][-len(energy):]
            over = np.flatnonzero(energy > np.maximum(self.limit, LEAST_SHARE / 2 * around))
            if len(over):
                return at + int(over[0])
            at += SCANNED
        return last

    def _window(self, first: int, waiting: Floats) -> tuple[Fit, Window]:
        """The stones of the window that begins at `first`, by adding one after the other."""
        values = self.left[:, first - self.first:first - self.first + WINDOW]
        window = Window(self.bank, self.prior, values, first)
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
        left, needed = window.residual(fit.stones), max(LEAST_GAIN, LEAST_SHARE * self._half_energy(window))
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

    def _half_energy(self, window: Window) -> float:
        """What a stone's gain is a share of: also of what was taken away before."""
        first = window.first - self.first
        return float(np.sum(self.whole[:, first:first + window.values.shape[1]] ** 2)) / 2

    def _believed(self, window: Window, stone: Heard) -> bool:
        energy = self._half_energy(window)
        evidence = LEAST_EVIDENCE if stone.gain > CLEAR_SHARE * energy else CLEAR_EVIDENCE
        return stone.gain > max(LEAST_GAIN, LEAST_SHARE * energy) and stone.evidence > evidence

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
        low = max(start, self.first)
        self.left[:, low - self.first:start + LAGS - self.first] -= signature[:, low - start:]


def _before_late(fit: Fit, window: Window) -> tuple[Fit, Window]:
    """The same up to where the first stone begins that may not be in the window as a whole."""
    late = fit.stones[:, TIME] >= window.first + SURE
    if not late.any():
        return fit, window
    first_late = int(fit.stones[late, TIME].min())
    shorter = replace(window, values=window.values[:, :first_late - LEAD - window.first])
    return shorter.fit(fit.stones[~late]), shorter
