"""Joint fit of overlapping stones to the innovations, by damped Gauss-Newton steps.

Stones are rows (k, 6) of parameters, see `recognition.innovations.bank`.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.innovations.bank import FIT_LAGS, PARAMETERS, TIME, Bank, X, Y
from recognition.innovations.prior import TRIPLE, StonePrior

STEPS = 10  # Gauss-Newton steps at most
ENOUGH, ENOUGH_SHARE = 0.05, 3e-4  # they end when the cost falls by less, and less than this share of it
LARGEST_STEP = np.array([3.0, 0.4, 0.02, 0.02, 1.0, 0.7])  # of the parameters at once
FARTHEST = np.array([3.0, 5.0, 3.0])  # of log duration, breaking and log impulse from those of a typical stone
FIRST_DAMPING, LAST_DAMPING = 1e-4, 1e2


@dataclass(frozen=True)
class Fit:
    """Stones (k, 6) of a window: minus the log posterior, its slope (6k,) and curvature (6k, 6k), the chi-square."""

    stones: Floats
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

    def fit(self, stones: Floats, steps: int = STEPS) -> Fit:
        """The most likely parameters, from given ones on."""
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

    def residual(self, stones: Floats) -> Floats:
        """What stones leave of the window, (c, samples)."""
        left = self._flat - self._placed(stones)[:, 0].sum(axis=0)
        return left.reshape(-1, self.bank.channels).T

    def at(self, stones: Floats) -> Fit:
        """The cost and its derivatives at given parameters."""
        k, placed = len(stones), self._placed(stones)
        left = self._flat - placed[:, 0].sum(axis=0)
        slopes = placed[:, 1:].reshape(PARAMETERS * k, left.size)
        chi_square = float(left @ left)
        slope, curvature = slopes @ (left / -self.temper), slopes @ slopes.T / self.temper
        cost, by_triple = self.prior.gaussian(stones)
        for i in range(k):
            at = PARAMETERS * i + _TRIPLE
            slope[at] += by_triple[i]
            curvature[at[:, None], at] += self.prior.precision
        return Fit(stones, 0.5 * chi_square / self.temper + cost, slope, curvature, chi_square)

    def _moved(self, now: Fit, damping: float) -> Floats:
        diagonal = now.curvature.diagonal()
        step = -np.linalg.solve(now.curvature + np.diag(damping * diagonal + 1e-9 * diagonal.max()), now.slope)
        stones: Floats = now.stones + step.reshape(-1, PARAMETERS).clip(-LARGEST_STEP, LARGEST_STEP)
        half, typical = self.bank.half_m, self.prior.typical
        stones[:, X:Y + 1] = stones[:, X:Y + 1].clip(-half, half)
        stones[:, _TRIPLE] = stones[:, _TRIPLE].clip(typical - FARTHEST, typical + FARTHEST)
        return stones

    @cached_property
    def _flat(self) -> Floats:
        return np.ascontiguousarray(self.values.T).ravel()

    def _placed(self, stones: Floats) -> Floats:
        """(k, 7, c samples): what each stone adds to the window, with its derivatives."""
        c, size = self.bank.channels, self.values.size
        out = np.zeros((len(stones), PARAMETERS + 1, size))
        for rows, stone in zip(out, stones, strict=True):
            start, signature = self.bank.signature(stone)
            a = (start - self.first) * c
            low = min(max(a, 0), size)
            high = min(max(a + FIT_LAGS * c, low), size)
            rows[:, low:high] = signature[:, low - a:high - a]
        return out


_TRIPLE = np.array(TRIPLE)
NO_STONES: Floats = np.zeros((0, PARAMETERS))


def in_order(stones: Floats) -> Floats:
    """Stones by the centre of their force."""
    return np.asarray(stones[np.argsort(stones[:, TIME])])
