"""The recognition strategy on fusion curves (Section V-B-3, Figures 37 and 38).

A fusion curve QQ has one value at each of K moments (267 in 0.04 s). At every moment a function QQ_k(beta) is fitted to
the training runs: the function space. A record is recognised so: each moment's QQ is solved for beta; each such
candidate is put into the functions of all other moments; differences above the available coefficient xi are singular
points and left out; the candidate with the smallest mean difference is the answer.

Where the paper is silent, these rules hold: each real root in [-0.05, 1.05] of a moment is a candidate; one with fewer
than `least_share` of usable points is no answer. Of the functions that the paper offers, these are polynomials.
"""

from dataclasses import dataclass, field
from typing import Self

import numpy as np
import pandas as pd

from analysis.sweep.runs import Run
from recognition.estimation.arrays import Booleans, Floats, Integers, finite, training
from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.estimation.method import Fitted, RecordEstimator
from recognition.estimation.noise import noisy_copies
from recognition.paper.fusion import Fusion
from recognition.paper.q_parameter import fit_polynomials, real_roots

#: Judging standards. "mean", as published, is over the usable points only, so that a wrong candidate may win by having
#: its worst points deleted; "truncated" is the mean of min(difference, xi) over all points, in which a singular point
#: costs xi.
JUDGES = ("mean", "truncated")
FLAT = 1e-9  # QQ runs from 0 to 1; moments at which the training runs differ by less carry nothing


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
        of_k = np.moveaxis(self.parameters[k], -1, 0)
        return np.asarray(np.polynomial.polynomial.polyval(beta, of_k, tensor=False), float)


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
        curves, ratios = training(curves, ratios, 2)
        low, wanted = (1, self.max_degree) if self.degree is None else (self.degree, self.degree)
        different = np.unique(ratios).size
        high = min(wanted, different - 2)  # one ratio more than coefficients, else R^2 = 1 says nothing
        if high < low:
            raise RecognitionError(f"{different} mixing ratios; this rule needs at least {low + 2}")
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


@dataclass(frozen=True)
class Candidates:
    """Of one curve, shape (c,) each: the ratios, not clipped to [0, 1], their difference of QQ by the judge, their
    share of usable points, whether that share is enough, and the moment whose root each is."""

    ratio: Floats
    score: Floats
    usable_share: Floats
    allowed: Booleans
    moment: Integers

    @property
    def best(self) -> int:
        """Which has the least difference of those that are allowed."""
        return int(np.argmin(np.where(self.allowed, self.score, np.inf)))


@dataclass(eq=False)
class Strategy(Fitted):
    """Function space of K moments and its inverse solution.

    rule: how moments get their functions. xi: available coefficient, on the scale of QQ
    (0..1); the paper gives no value. least_share: of usable points, 0..1. judge: of JUDGES.

    >>> ratios = np.linspace(0, 1, 6)
    >>> curves = np.column_stack([ratios, 0.5 + 0.5 * ratios])
    >>> Strategy(Rule(degree=1)).fit(curves, ratios).predict([0.3, 0.65]).round(6).tolist()
    [0.3]
    """

    rule: Rule = field(default_factory=Rule)
    xi: float = 0.05
    least_share: float = 0.5
    judge: str = "mean"
    space_: FunctionSpace = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.judge not in JUDGES:
            raise RecognitionError(f"judge = {self.judge!r}; choose one of {', '.join(JUDGES)}")

    def fit(self, curves: Floats, ratios: Floats) -> Self:
        """curves: shape (n, K), QQ of the training runs; ratios: shape (n,), 0..1."""
        self.space_ = self.rule.fit(curves, ratios)
        return self

    def predict(self, curves: Floats) -> Floats:
        """Mixing ratio of each curve, shape (n,). Raises NotRecognised."""
        return np.array([self.recognise(curve) for curve in np.atleast_2d(curves)])

    def recognise(self, curve: Floats) -> float:
        """Mixing ratio of one curve, shape (K,). Raises NotRecognised."""
        found = self.candidates(curve)
        if found.ratio.size == 0:
            raise NotRecognised("no moment has a mixing ratio between -0.05 and 1.05 that explains it")
        if not np.any(found.allowed):
            raise NotRecognised(f"the best of {found.ratio.size} candidates explains {found.usable_share.max():.0%} of "
                                f"the moments within xi = {self.xi:g}; needs {self.least_share:.0%}")
        return float(found.ratio[found.best])

    def candidates(self, curve: Floats) -> Candidates:
        """Every candidate ratio of a curve, shape (K,), held against all other moments."""
        curve = finite("curve", curve, 1)
        if curve.shape != (self.space_.n_moments,):
            raise RecognitionError(f"the curve has {curve.size} moments; the model has {self.space_.n_moments}")
        values = curve[self.space_.moments]
        source, ratio = real_roots(self.space_, values)
        difference = np.abs(self.space_(np.arange(values.size)[None, :], ratio[:, None]) - values)
        usable = difference <= self.xi
        usable[np.arange(ratio.size), source] = False  # a moment agrees with its own root by construction
        count, others = usable.sum(axis=1), max(1, values.size - 1)
        allowed = (count > 0) & (count / others >= self.least_share)
        if self.judge == "truncated":
            score = np.minimum(difference, self.xi).sum(axis=1) / others
        else:
            score = np.where(usable, difference, 0.0).sum(axis=1) / np.maximum(count, 1)
        return Candidates(ratio, score, count / others, allowed, self.space_.moments[source])


@dataclass(eq=False)
class FusionPipeline(RecordEstimator):
    """A fusion of plate responses and the strategy on its curve (Figure 38). X, of `prepare`: (runs, copies, m, n).

    >>> sweep = read_sweep("runs/paper")
    >>> pipeline = FusionPipeline(Fusion("energy"), Strategy(Rule(degree=2), judge="truncated"))
    >>> X = np.stack([pipeline.prepare(run.signals) for run in sweep.runs])
    >>> bool(abs(pipeline.fit(X, sweep.ratios).predict(X) - sweep.ratios).max() < 0.05)
    True
    """

    fusion: Fusion = field(default_factory=Fusion)
    strategy: Strategy = field(default_factory=Strategy)

    def prepare(self, signals: pd.DataFrame, run: Run | None = None) -> Floats:
        """Responses of a record and of its `noisy_copies`, shape (copies, m, n)."""
        return np.stack([self.fusion.prepare(one) for one in noisy_copies(signals)])

    def learn(self, features: Floats, ratios: Floats) -> Self:
        """Fusion and function space, from responses (runs, m, n)."""
        self.fusion.fit(features)
        self.strategy.fit(self.fusion.transform(features), ratios)
        return self

    def transform(self, responses: Floats) -> Floats:
        """Fusion curves QQ, shape (runs, n)."""
        return self.fusion.transform(responses)

    def ratio_of(self, features: Floats) -> float:
        """By responses (m, n). Raises NotRecognised."""
        return self.strategy.recognise(self.transform(features))

    def summary(self) -> str:
        space = self.strategy.space_
        return f"functions at {space.moments.size} of {space.n_moments} moments"
