"""Recognition by the fused parameter Q of the acceleration (Section V-A, Eq. 40): the weighted sum of eight
standardised parameters; a quadratic Q(beta) is fitted to the training runs and inverted for a new record.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Self

import numpy as np
import pandas as pd

from analysis import as_record, base_parameters
from analysis.signals.records import sample_rate_Hz
from analysis.sweep.runs import Run
from common.input_error import raised_as
from recognition.estimation.arrays import Floats, Integers
from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.estimation.method import RecordEstimator
from recognition.estimation.noise import noisy_copies
from recognition.paper.fusion import MinMaxByTrend, trend

DEGREE = 2  # of Q(beta)
#: A root counts from -margin to 1 + margin: noise puts a record of pure coal a little below 0 as often as above, and
#: cutting there would bias the ends. Nothing is clipped.
ROOT_MARGIN = 0.05
_GRID = np.linspace(-ROOT_MARGIN, 1 + ROOT_MARGIN, 111)
_BISECTIONS = 40  # 0.01 of ratio halved 40 times: 1e-14


@dataclass(eq=False)
class FusionQ(RecordEstimator):
    """Q-polynomial recognition with equal weights, as in the paper. X: (runs, copies, p), `prepare` of each run.

    >>> sweep, method = read_sweep("runs/paper"), FusionQ()
    >>> X = np.stack([method.prepare(run.signals) for run in sweep.runs])
    >>> abs(float(method.fit(X, sweep.ratios).predict(X[3:4])[0]) - 0.3) < 0.1
    True
    """

    scaler_: MinMaxByTrend = field(init=False, repr=False)
    fit_: "PolynomialFit" = field(init=False, repr=False)

    def prepare(self, signals: pd.DataFrame, run: Run | None = None) -> Floats:
        """The eight base parameters of `a_m_s2` in a record and in its `noisy_copies`, shape (copies, 8). Raises
        RecognitionError where one of them has none."""
        for name in ("a_m_s2", "t_s"):
            if name not in signals.columns:
                raise RecognitionError(f"no column {name!r} in the record; needs it for Q")
        rate_Hz = sample_rate_Hz(signals["t_s"].to_numpy(dtype=float), "t_s")
        every = [one["a_m_s2"].to_numpy(dtype=float) for one in noisy_copies(signals[["t_s", "a_m_s2"]])]
        records = [as_record(one, rate_Hz, unit="m/s^2", name="a_m_s2") for one in every]
        with raised_as(RecognitionError):
            return np.stack([base_parameters(record) for record in records])

    def learn(self, features: Floats, ratios: Floats) -> Self:
        """Scale with its directions (Eq. 39), and Q(beta), from parameters (n, p)."""
        self.scaler_ = MinMaxByTrend().fit(features, trend(features, ratios))
        self.fit_ = fit_polynomial(ratios, self.q_of(features), DEGREE)
        return self

    def q_of(self, parameters: Floats) -> Floats:
        """Q of each record, shape (n,)."""
        standardised = self.scaler_.transform(parameters)
        count = standardised.shape[-1]
        return standardised @ np.full(count, 1.0 / count)

    def ratio_of(self, features: Floats) -> float:
        """By the parameters (p,) of a record. Raises NotRecognised."""
        return self.invert(self.q_of(features[None])[0])

    def invert(self, q: float) -> float:
        """The ratio beta with Q(beta) = q.

        The real root in [-margin, 1 + margin]; of two such roots the one where Q rises with
        beta, as it was built to do (Eq. 39). It is not clipped to [0, 1]. Raises NotRecognised where there is none.
        """
        _, roots = real_roots(lambda k, beta: self.fit_(beta) + 0.0 * k, np.array([q]))
        if roots.size > 1:
            slope = np.polynomial.polynomial.polyder(self.fit_.coefficients)
            roots = roots[np.polynomial.polynomial.polyval(roots, slope) > 0]
        if roots.size == 0:
            low, high = -ROOT_MARGIN, 1 + ROOT_MARGIN
            raise NotRecognised(f"Q = {q:.4g} has no rising root between {low:g} and {high:g} of mixing ratio")
        return float(roots[0])

    def summary(self) -> str:
        return f"R^2 {self.fit_.r2:.5f}, adjusted {self.fit_.r2_adjusted:.5f}"


def real_roots(function: Callable[[Integers, Floats], Floats], values: Floats) -> tuple[Integers, Floats]:
    """All real roots of f_k(beta) = values[k] in [-margin, 1 + margin], for every k at once.

    function(k, beta): elementwise value of function number k at beta. Returns (k, beta) of every root, both shape (r,),
    in order of k, then beta: none, one or several for each k. Roots are bracketed on a grid of 0.01 of ratio and
    bisected, so that any continuous form of fit will do; pairs closer than the grid are passed over.
    """
    values = np.asarray(values, dtype=float)
    above = function(np.arange(values.size)[:, None], _GRID[None, :]) - values[:, None] >= 0
    k, cell = np.nonzero(above[:, 1:] != above[:, :-1])
    low, high, rising = _GRID[cell], _GRID[cell + 1], above[k, cell + 1]
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        root_is_below = (function(k, middle) - values[k] >= 0) == rising
        low, high = np.where(root_is_below, low, middle), np.where(root_is_below, middle, high)
    return k, 0.5 * (low + high)


def fit_polynomials(degree: int, ratios: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Coefficients (k, degree + 1), lowest power first, of a polynomial for every column of values (n, k), by least
    squares, and R^2 = 1 - sum (y - f)^2 / sum (y - mean y)^2 (k,)."""
    coefficients = np.polynomial.polynomial.polyfit(ratios, values, degree).astype(float)
    left = values - np.polynomial.polynomial.polyval(ratios, coefficients).T
    return coefficients.T, 1.0 - np.sum(left**2, axis=0) / np.sum((values - values.mean(axis=0)) ** 2, axis=0)


@dataclass(frozen=True)
class PolynomialFit:
    """Least-squares polynomial, lowest power first.

    The paper's "R^2 = 0.99079" of Q is the adjusted one, 1 - (1 - R^2)(n - 1)/(n - parameters), NaN with no point to
    spare; the plain one of its Table 3 is 0.99263.
    """

    coefficients: Floats
    r2: float
    r2_adjusted: float

    def __call__(self, ratio: Floats) -> Floats:
        """Value at each ratio, of any shape."""
        return np.asarray(np.polynomial.polynomial.polyval(ratio, self.coefficients))


def fit_polynomial(ratios: Floats, values: Floats, degree: int) -> PolynomialFit:
    """Polynomial of a given degree by least squares; needs more different ratios than the degree."""
    ratios, values = np.asarray(ratios, dtype=float), np.asarray(values, dtype=float)
    if np.unique(ratios).size <= degree:
        raise RecognitionError(f"degree {degree} needs at least {degree + 1} ratios; has {np.unique(ratios).size}")
    coefficients, (r2,) = fit_polynomials(degree, ratios, values[:, None])
    spare = values.size - degree - 1
    adjusted = 1.0 - (1.0 - r2) * (values.size - 1) / spare if spare > 0 else float("nan")
    return PolynomialFit(coefficients[0], float(r2), float(adjusted))
