"""Joint fit of overlapping stones to the innovations, by damped Gauss-Newton steps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.stream.bank import DURATION, FIT_LAGS, IMPULSE, TIME, Bank, X, Y
from recognition.stream.prior import StonePrior

STEPS = 10  # Gauss-Newton steps at most
ENOUGH, ENOUGH_SHARE = 0.05, 3e-4  # they end when the cost falls by less, and less than this share of it
LARGEST_STEP = np.array([3.0, 0.4, 0.02, 0.02, 0.7])  # of the parameters at once
FARTHEST = 3.0  # of log duration and log impulse from those of a typical stone
FIRST_DAMPING, LAST_DAMPING = 1e-4, 1e2


@dataclass(frozen=True)
class Found:
    """A stone: its material (0 coal, 1 gangue) and its parameters (5,), see `recognition.stream.bank`."""

    material: int
    stone: Floats


@dataclass(frozen=True)
class Fit:
    """k stones of a window: minus the log posterior, its slope (5k,) and curvature (5k, 5k), and the chi-square."""

    stones: tuple[Found, ...]
    cost: float
    slope: Floats
    curvature: Floats
    chi_square: float


@dataclass(frozen=True)
class Window:
    """Innovations (c, samples) from sample `first` on, in which stones are fitted. temper: what the chi-square is
    divided by, for a plate that is known only so well."""

    bank: Bank
    prior: StonePrior
    values: Floats
    first: int
    temper: float = 1.0

    def fit(self, stones: tuple[Found, ...], steps: int = STEPS) -> Fit:
        """The most likely parameters of stones whose materials are given."""
        now, damping = self.at(stones), FIRST_DAMPING
        for _ in range(steps):
            trial = self.at(self._moved(now, damping))
            if trial.cost > now.cost:
                damping *= 20
                if damping > LAST_DAMPING:
                    break
                continue
            gained, now, damping = now.cost - trial.cost, trial, damping / 5
            if gained < ENOUGH + ENOUGH_SHARE * now.cost:
                break
        return now

    def residual(self, stones: tuple[Found, ...]) -> Floats:
        """What stones leave of the window, (c, samples)."""
        left = self._flat()
        for s in stones:
            where, rows = self._placed(s)
            left[where] -= rows[0]
        return left.reshape(-1, self.bank.channels).T

    def at(self, stones: tuple[Found, ...]) -> Fit:
        """The cost and its derivatives at given parameters."""
        n, left = len(stones), self._flat()
        placed = [self._placed(s) for s in stones]
        for where, rows in placed:
            left[where] -= rows[0]
        chi_square = float(left @ left)
        cost, slope, curvature = 0.5 * chi_square / self.temper, np.zeros(5 * n), np.zeros((5 * n, 5 * n))
        for i, (where, rows) in enumerate(placed):
            a = slice(5 * i, 5 * i + 5)
            slope[a] -= rows[1:] @ left[where] / self.temper
            for j in range(i + 1):
                block = _overlap(where, rows[1:], *placed[j]) / self.temper
                curvature[a, 5 * j:5 * j + 5] = block
                curvature[5 * j:5 * j + 5, a] = block.T
            value, by_pair, precision = self.prior.gaussian(stones[i].material, stones[i].stone)
            pair = slice(5 * i + DURATION, 5 * i + IMPULSE + 1, IMPULSE - DURATION)
            cost += value
            slope[pair] += by_pair
            curvature[pair, pair] += precision
        return Fit(stones, cost, slope, curvature, chi_square)

    def _moved(self, now: Fit, damping: float) -> tuple[Found, ...]:
        diagonal = np.diag(now.curvature)
        step = -np.linalg.solve(now.curvature + np.diag(damping * diagonal + 1e-9 * diagonal.max()), now.slope)
        half = self.bank.half_m
        moved = []
        for s, d in zip(now.stones, step.reshape(-1, 5), strict=True):
            stone = s.stone + np.clip(d, -LARGEST_STEP, LARGEST_STEP)
            stone[[X, Y]] = np.clip(stone[[X, Y]], -half, half)
            pair = self.prior.typical(s.material)
            stone[[DURATION, IMPULSE]] = np.clip(stone[[DURATION, IMPULSE]], pair - FARTHEST, pair + FARTHEST)
            moved.append(replace(s, stone=stone))
        return tuple(moved)

    def _flat(self) -> Floats:
        return np.ascontiguousarray(self.values.T).ravel()

    def _placed(self, found: Found) -> tuple[slice, Floats]:
        start, rows = self.bank.signature(found.material, found.stone)
        c = self.bank.channels
        a = (start - self.first) * c
        low = min(max(a, 0), self.values.size)
        high = min(max(a + FIT_LAGS * c, low), self.values.size)
        return slice(low, high), rows[:, low - a:high - a]


def _overlap(where: slice, rows: Floats, other: slice, placed: Floats) -> Floats:
    """Products (5, 5) of two stones' derivatives over the samples that both have."""
    low, high = max(where.start, other.start), min(where.stop, other.stop)
    if high <= low:
        return np.zeros((5, 5))
    return rows[:, low - where.start:high - where.start] @ placed[1:, low - other.start:high - other.start].T


def time_of(found: Found) -> float:
    """Centre of a stone's force, in samples."""
    return float(found.stone[TIME])
