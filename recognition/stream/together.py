"""Where stones that fell together were not found one by one, they are found jointly (volley.py)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.optimize import linear_sum_assignment

from recognition.estimation.arrays import Floats
from recognition.stream.bank import LAGS, PARAMETERS, TIME, X, Y
from recognition.stream.compressed import SAMPLES, SPREAD, Compressed
from recognition.stream.fit import Fit
from recognition.stream.listen import Heard, Listener
from recognition.stream.prior import TRIPLE
from recognition.stream.signatures import LEAD
from recognition.stream.volley import Option, Search, VolleyWindow

#: Shares of the energy after an onset that no stone explains, between which stones are sought jointly. Where the
#: listener explains less than half with a dozen stones, these are no stones on this plate.
CROWDED, HOPELESS = 0.03, 0.5
GIVEN_UP = 3  # windows in which no stones were found jointly, after which no more are tried
LOUDER = 0.3  # times the energy of the window before: what still rings of that is less
SEARCHED = 10  # samples about the onset in which the first force may be
FIRST = SEARCHED + LEAD + SPREAD  # samples before an onset that are looked at
CHAINS = 2
MOST_MISFIT = 2.0  # chi-square per degree of freedom: above it these are no stones on this plate
AGREE = 5.0  # log evidence by which the best of two chains may differ
WEIGHED = 7.0  # log evidence below the best, down to which an option counts
SAME_M = 0.04  # a stone of two options


@dataclass
class Volleys:
    """Goes through a record that a listener heard. silent: samples at its beginning in which nothing should have
    fallen, and none are sought; windows: those in which stones were sought jointly; unresolved: how
    many of them stay as the listener left them."""

    listener: Listener
    compress: Callable[[], Compressed]
    silent: int
    windows: list[VolleyWindow] = field(default_factory=list)
    unresolved: int = 0

    @cached_property
    def compressed(self) -> Compressed:
        return self.compress()

    def heard(self, heard: Sequence[Heard]) -> list[Heard]:
        """The stones of the listener, those of volleys replaced."""
        found = list(heard)
        for onset in self._crowded():
            if self.unresolved == GIVEN_UP:
                break
            window = self._window(onset, found)
            self.windows.append(window)
            stones = self._told_apart(window)
            if stones is None:
                self.unresolved += 1
                continue
            begin, end = window.first + LEAD - SEARCHED, window.first + SAMPLES - LEAD
            replaced = [h for h in found if begin <= h.stone[TIME] < end]
            found = [h for h in found if not begin <= h.stone[TIME] < end] + stones
            for h in replaced:
                self.listener.add(h.stone, 1.0)
            for h in stones:
                self.listener.add(h.stone, -1.0)
        return sorted(found, key=lambda h: float(h.stone[TIME]))

    def _crowded(self) -> Iterator[int]:
        """Onsets after which much is left."""
        whole, left, noise = self.listener.whole, self.listener.left, self.listener.bank.channels * SAMPLES
        at, before = max(self.silent, FIRST), 0.0
        while (onset := self.listener.onset(whole, at)) < self.listener.end - SAMPLES:
            inside = slice(onset - LEAD, onset - LEAD + SAMPLES)
            energy, unexplained = (float(np.sum(values[:, inside] ** 2)) - noise for values in (whole, left))
            before = before if onset < at + SAMPLES else 0.0
            if energy > LOUDER * before and CROWDED * energy < unexplained < HOPELESS * energy:
                yield onset
            at, before = onset + SAMPLES, max(energy, LOUDER * before)

    def _window(self, onset: int, heard: Sequence[Heard]) -> VolleyWindow:
        """The window that a stone about the onset explains best, without the stones that were heard before."""
        listener, first = self.listener, onset - FIRST
        values = listener.whole[:, first:first + 2 * SAMPLES].copy()
        for h in heard:
            if onset - LAGS - LEAD < h.stone[TIME] < onset - SEARCHED:
                subtract(values, first, listener, h.stone)
        starts = range(0, 3 * SEARCHED, 2)
        atoms = self.compressed.atoms
        gains = np.array([(atoms.signatures @ self.compressed.project(values[:, k:k + SAMPLES]).astype(np.float32)) ** 2
                          / atoms.energy for k in starts])
        k, atom = np.unravel_index(int(gains.argmax()), gains.shape)
        begin = max(starts[k] + round(float(atoms.stones[atom, TIME])) - SPREAD // 2, 0)
        return VolleyWindow(listener.bank, listener.prior, values[:, begin:begin + SAMPLES], first + begin,
                            compressed=self.compressed)

    def _told_apart(self, window: VolleyWindow) -> list[Heard] | None:
        """The stones of a window; None where chains of the search disagree or no stones explain it."""
        chains = []
        for seed in range(CHAINS):
            search = Search(window, np.random.default_rng(seed))
            chains.append(search.anneal(search.greedy()))
        tops = [chain[0].score for chain in chains]
        options = sorted((option for chain in chains for option in chain), key=lambda option: -option.score)
        best = options[0].fit
        freedom = len(window.weight) - PARAMETERS * len(best.stones)
        if max(tops) - min(tops) > AGREE or not len(best.stones) or best.chi_square > MOST_MISFIT * freedom:
            return None
        return _heard(window, [o for o in options if o.score > options[0].score - WEIGHED])


def _heard(window: VolleyWindow, options: Sequence[Option]) -> list[Heard]:
    """The stones of the best option; their materials are those of all options, by evidence."""
    best = options[0].fit
    gangue = _gangue(window, options)
    curvature = best.curvature + 1e-9 * np.eye(len(best.curvature))
    covariance = np.linalg.inv(curvature)
    found = []
    for i, stone in enumerate(best.stones):
        block = np.asarray(covariance[PARAMETERS * i:PARAMETERS * (i + 1), PARAMETERS * i:PARAMETERS * (i + 1)])
        log_evidence, weights = window.prior.evidence(stone[TRIPLE], block[np.ix_(TRIPLE, TRIPLE)])
        told = np.logaddexp.reduce(log_evidence) + np.log([1 - gangue[i], gangue[i]])
        absolute = stone + (window.first + LEAD) * np.eye(PARAMETERS)[TIME]
        gain = window.at(np.delete(best.stones, i, axis=0)).cost - best.cost
        found.append(Heard(absolute, block, told, weights, best.chi_square / len(window.weight), gain,
                           gain + float(told.max()), len(best.stones)))
    return found


def _gangue(window: VolleyWindow, options: Sequence[Option]) -> Floats:
    """Probability (k,) that a stone of the best option is gangue, over all options that have a stone about there."""
    best = options[0].fit
    total = weight_total = np.zeros(len(best.stones))
    for option in _distinct(options):
        log = window.materials(option.fit)
        gangue = 1 / (1 + np.exp(np.clip(log[:, 0] - log[:, 1], -30, 30)))
        mine, other = _pairs(best, option.fit)
        weight = np.zeros(len(best.stones))
        weight[mine] = np.exp(option.score - options[0].score)
        value = np.zeros(len(best.stones))
        value[mine] = gangue[other]
        total, weight_total = total + weight * value, weight_total + weight
    return np.clip(total / weight_total, 1e-6, 1 - 1e-6)


def _distinct(options: Sequence[Option]) -> list[Option]:
    """Options without those that are another's fit again: the same stones to a millimetre."""
    kept: list[Option] = []
    for option in options:
        if not any(abs(option.score - other.score) < 0.5 and len(option.fit.stones) == len(other.fit.stones)
                   for other in kept):
            kept.append(option)
    return kept


def _pairs(one: Fit, other: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Stones of two fits that are at the same place."""
    apart = np.hypot(*(one.stones[:, None, k] - other.stones[None, :, k] for k in (X, Y)))
    i, j = linear_sum_assignment(np.minimum(apart, SAME_M))
    same = apart[i, j] < SAME_M
    return i[same], j[same]


def subtract(values: Floats, first: int, listener: Listener, stone: Floats) -> None:
    """Take a stone's signature from values that begin at sample `first`."""
    start, flat = listener.bank.whole(stone)
    signature = flat.reshape(-1, listener.bank.channels).T
    low, high = max(start, first), min(start + LAGS, first + values.shape[1])
    if low < high:
        values[:, low - first:high - first] -= signature[:, low - start:high - start]
