"""The function space of Section V-B-3: at each moment a fitted function QQ(beta).

The paper offers polynomials, exponentials, logarithms and powers. Here each is a polynomial a0 + a1 beta + ..., of a
given degree, or of the lowest that reaches R^2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recognition.estimation.arrays import Booleans, Floats, Integers
from recognition.estimation.errors import RecognitionError

FLAT = 1e-9  # QQ runs from 0 to 1; moments at which the training runs differ by less carry nothing


def fit_polynomials(degree: int, ratios: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Coefficients (k, degree + 1), lowest power first, of a polynomial for every column of values (n, k), by least
    squares, and R^2 (k,)."""
    coefficients = np.polynomial.polynomial.polyfit(ratios, values, degree).astype(float)
    left = values - np.polynomial.polynomial.polyval(ratios, coefficients).T
    return coefficients.T, 1.0 - np.sum(left**2, axis=0) / np.sum((values - values.mean(axis=0)) ** 2, axis=0)


@dataclass(frozen=True)
class FunctionSpace:
    """Functions of k moments of curves that have n_moments. moments (k,): index of each in a curve; parameters (k, p):
    coefficients, lowest power first, padded with 0. ValueError for arrays that do not fit together."""

    n_moments: int
    moments: Integers
    parameters: Floats

    def __post_init__(self) -> None:
        if not (self.parameters.ndim == 2 and self.moments.shape == self.parameters.shape[:1]):
            raise ValueError("moments and parameters are not of one length")
        if self.moments.size == 0 or self.moments.min() < 0 or self.moments.max() >= self.n_moments:
            raise ValueError(f"moments lie outside 0..{self.n_moments - 1}")

    def __call__(self, k: Integers, beta: Floats) -> Floats:
        """Value of function number k at beta, elementwise after broadcasting."""
        p = self.parameters
        value = p[k, -1]
        for power in range(p.shape[1] - 2, -1, -1):
            value = value * beta + p[k, power]
        return np.broadcast_to(value, np.broadcast_shapes(k.shape, beta.shape))


@dataclass(frozen=True)
class Rule:
    """How each moment gets its function.

    degree: of the polynomial, or None for the paper's rule: the lowest degree with R^2 >= min_r2, at most
    max_degree. A moment whose best R^2 is below min_r2, or at which all runs agree, has no function.

    >>> ratios = np.linspace(0, 1, 6)
    >>> space = Rule(degree=2).fit(np.column_stack([ratios, ratios**2]), ratios)
    >>> space(np.array([0, 1]), np.array([0.5, 0.5])).round(6).tolist()
    [0.5, 0.25]
    """

    degree: int | None = None
    min_r2: float = 0.99
    max_degree: int = 4

    def fit(self, curves: Floats, ratios: Floats) -> FunctionSpace:
        """curves: shape (n, K); ratios: shape (n,). RecognitionError if no moment has a function."""
        low, high = self._degrees(np.unique(ratios).size)
        moments = np.flatnonzero(np.ptp(curves, axis=0) >= FLAT)
        parameters, found = np.zeros((moments.size, high + 1)), np.zeros(moments.size, dtype=bool)
        for degree in range(low, high + 1):
            coefficients, r2 = fit_polynomials(degree, ratios, curves[:, moments])
            now: Booleans = ~found & ((r2 >= self.min_r2) | (self.degree is not None))
            parameters[now, :degree + 1] = coefficients[now]
            found |= now
        if not found.any():
            raise RecognitionError(f"no moment has a polynomial fit with R^2 >= {self.min_r2:g}")
        used = np.flatnonzero(parameters[found].any(axis=0)).max() + 1
        return FunctionSpace(curves.shape[1], moments[found], parameters[found, :used])

    def _degrees(self, ratios: int) -> tuple[int, int]:
        """The lowest and the highest that are tried. One ratio more than coefficients, else R^2 = 1 says nothing."""
        low, wanted = (1, self.max_degree) if self.degree is None else (self.degree, self.degree)
        high = min(wanted, ratios - 2)
        if high < low:
            raise RecognitionError(f"{ratios} mixing ratios; this rule needs at least {low + 2}")
        return low, high
