"""Stones that arrive almost at once, found together.

One by one, each stone is put where it explains most of what is left. Of ten stones within a sample or two the first
places so found are wrong, and steps from there do not lead to the right ones. Here a new stone is put where the
posterior is highest *with all other stones free to move*: their signatures' slopes span what they can still explain,
and only what lies beside that counts. Stones are put, taken away, and put elsewhere at random, ever more seldom to the
worse (simulated annealing); the joint fit is that of a window (fit.py). How many stones there are follows from the
evidence, by Laplace's approximation.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.special import gammaln

from recognition.estimation.arrays import Floats
from recognition.stream.bank import IMPULSE, PARAMETERS, TIME, X, Y
from recognition.stream.compressed import SPREAD, Compressed
from recognition.stream.fit import NO_STONES, Fit, Window
from recognition.stream.forces import MATERIALS
from recognition.stream.prior import TRIPLE
from recognition.stream.signatures import Floats32

MOST = 14  # stones of a volley
GREEDY_STEPS, MOVE_STEPS, LAST_STEPS = 3, 8, 30
MOVES, FIRST_TEMPERATURE, LAST_TEMPERATURE = 60, 30.0, 1.5  # of an annealing; the temperatures in units of log evidence
SIZE, SIZE_SD, SMALLEST, LARGEST = 0.65, 0.3, 0.2, 1.5  # N s, of a stone that is tried
#: Stones taken away and put by a change, and how often it is tried.
CHANGES, CHANCES = ((1, 1), (2, 2), (0, 1), (1, 0), (1, 2), (2, 1)), (0.5, 0.2, 0.1, 0.1, 0.05, 0.05)
NEAR = 3  # of its next stones one is taken away with a stone


@dataclass(frozen=True)
class VolleyWindow(Window):
    """A window (c, SAMPLES) in which a volley is fitted, in the axes of `compressed`, each divided by the noise and the
    model's error there. Times of stones count from the window's first possible centre."""

    compressed: Compressed = field(kw_only=True)

    @cached_property
    def weight(self) -> Floats:
        """(r,): one over the standard deviation on each axis. The sum of the squared impulses is that of the energy."""
        projected = self.compressed.project(self.values)
        return np.asarray((1 + self.compressed.error * float(projected @ projected) / self.compressed.energy) ** -0.5)

    @cached_property
    def tried(self) -> Floats32:
        """Weighted signatures of the stones that are tried."""
        return self.compressed.atoms.signatures * self.weight.astype(np.float32)

    @cached_property
    def _flat(self) -> Floats:
        return self.compressed.project(self.values) * self.weight

    def _placed(self, stones: Floats) -> Floats:
        out = np.zeros((len(stones), PARAMETERS + 1, len(self.weight)))
        for rows, stone in zip(out, stones, strict=True):
            rows[:] = self.compressed.signature(stone) * self.weight
        return out

    def log_evidence(self, fit: Fit) -> float:
        """Of the number and about the places of a fit's stones, by Laplace: their prior is uniform on the plate and in
        time. Stones have no order, so that k of them have k! equal modes. Each is of one of the materials, sizes and
        speeds that there are."""
        k = len(fit.stones)
        volume = 4 * float(self.bank.half_m.prod()) * SPREAD
        curvature = fit.curvature + 1e-9 * np.eye(len(fit.curvature))
        by_material = np.logaddexp.reduce(self.materials(fit), axis=1) - np.log(len(MATERIALS))
        each = 1.5 * np.log(2 * np.pi) - np.log(volume)
        return float(-fit.cost - 0.5 * np.linalg.slogdet(curvature)[1] + k * each + gammaln(k + 1) + by_material.sum())

    def materials(self, fit: Fit) -> Floats:
        """Log evidence (k, materials) of each stone, whatever the others are."""
        covariance = np.linalg.inv(fit.curvature + 1e-9 * np.eye(len(fit.curvature)))
        triples = [PARAMETERS * i + np.array(TRIPLE) for i in range(len(fit.stones))]
        found = [self.prior.evidence(stone[TRIPLE], covariance[np.ix_(at, at)])[0]
                 for stone, at in zip(fit.stones, triples, strict=True)]
        return np.array(found).reshape(-1, len(MATERIALS))

    def _moved(self, now: Fit, damping: float) -> Floats:
        stones = super()._moved(now, damping)
        stones[:, TIME] = stones[:, TIME].clip(0, SPREAD)
        return stones


@dataclass(frozen=True)
class Option:
    """A fit, and the logarithm of its evidence."""

    fit: Fit
    score: float


@dataclass(frozen=True)
class Search:
    """Looks for the stones of a window."""

    window: VolleyWindow
    rng: np.random.Generator

    def anneal(self, start: Option, moves: int = MOVES) -> list[Option]:
        """All that was tried on the way from a start, best first."""
        now, tried = start, [start]
        for temperature in np.geomspace(FIRST_TEMPERATURE, LAST_TEMPERATURE, moves):
            new = self._changed(now.fit.stones, float(temperature))
            tried.append(new)
            if new.score > now.score or self.rng.random() < np.exp((new.score - now.score) / temperature):
                now = new
        return sorted(tried, key=lambda option: -option.score)

    def greedy(self, temperature: float = LAST_TEMPERATURE) -> Option:
        """Stones added as long as the evidence rises."""
        best = self._fitted(NO_STONES)
        for _ in range(MOST):
            new = self._fitted(self._with_one_more(best.fit, temperature))
            if new.score <= best.score:
                break
            best = new
        return best

    def _fitted(self, stones: Floats, steps: int = MOVE_STEPS) -> Option:
        fit = self.window.fit(stones, steps) if len(stones) else self.window.at(stones)
        return Option(fit, self.window.log_evidence(fit))

    def _changed(self, stones: Floats, temperature: float) -> Option:
        """The fit after some stones were taken away and some were put."""
        away, put = CHANGES[self.rng.choice(len(CHANGES), p=CHANCES)]
        away = min(away, len(stones))
        put = min(put, MOST - len(stones) + away)
        fit = self._fitted(np.delete(stones, self._neighbours(stones, away), axis=0), GREEDY_STEPS).fit
        for k in range(put):
            stones = self._with_one_more(fit, temperature)
            fit = self._fitted(stones, GREEDY_STEPS).fit if k < put - 1 else fit
        return self._fitted(stones if put else fit.stones)

    def _neighbours(self, stones: Floats, count: int) -> list[int]:
        """A stone at random, and near it as many others as are wanted."""
        if count == 0:
            return []
        first = int(self.rng.integers(len(stones)))
        near = np.argsort(np.hypot(*(stones[:, [X, Y]] - stones[first, [X, Y]]).T))[1:NEAR + 1]
        return [first, *self.rng.choice(near, min(count - 1, len(near)), replace=False)]

    def _with_one_more(self, fit: Fit, temperature: float) -> Floats:
        """The stones of a fit and one that is drawn by its gain, divided by the temperature, when those may move."""
        window, signatures = self.window, self.window.tried
        atoms = window.compressed.atoms
        placed = window._placed(fit.stones)
        left = (window._flat - placed[:, 0].sum(axis=0)).astype(np.float32)
        energy, product = np.einsum("ij,ij->i", signatures, signatures), signatures @ left
        if len(fit.stones):
            slopes = placed[:, 1:].reshape(-1, len(left))
            curvature = fit.curvature + 1e-9 * fit.curvature.diagonal().max() * np.eye(len(fit.curvature))
            spanned = np.linalg.solve(np.linalg.cholesky(curvature), slopes).astype(np.float32)
            within = signatures @ spanned.T
            energy -= np.einsum("ij,ij->i", within, within) / window.temper
            product -= within @ (spanned @ left) / window.temper
        precision = np.maximum(energy, 0.0) / window.temper + SIZE_SD**-2
        impulse = (product / window.temper + SIZE * SIZE_SD**-2) / precision
        gain = 0.5 * (precision * impulse**2 - np.log(precision))
        gain[impulse < SMALLEST / 2] = -np.inf
        if not np.isfinite(gain.max()):
            return fit.stones
        gain -= gain.max()
        chance = np.exp(gain / temperature)
        k = self.rng.choice(len(chance), p=chance / chance.sum())
        new = atoms.stones[k].copy()
        new[IMPULSE] = np.log(np.clip(impulse[k], SMALLEST, LARGEST))
        return np.vstack([fit.stones, new])
