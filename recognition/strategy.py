"""The recognition strategy on fusion curves (Section V-B-3, Figures 37 and 38).

A fusion curve QQ has one value at each of K moments (267 in 0.04 s). At every
moment a polynomial QQ_k(beta) is fitted to the training runs: the function space.
A record is recognised so: each moment's QQ is solved for beta; each such candidate
is put into the functions of all other moments; differences above the available
coefficient xi are singular points and left out; the candidate with the smallest mean
difference is the answer.

Where the paper is silent, these rules hold:
- a moment whose R^2 stays below the limit up to `max_degree`, or at which all
  training runs agree, has no function and is left out of the space;
- no real root in [-0.05, 1.05]: the moment gives no candidate;
- several roots: each is a candidate;
- `judge="mean"`, as printed, takes the mean over the usable points only, so that a wrong
  candidate may win by having its worst points deleted; `judge="truncated"` takes the mean
  of min(difference, xi) over all points, in which a singular point costs xi;
- a candidate with fewer than `least_share` of usable points is no answer; if none is
  left, `NotRecognised` is raised and nothing is guessed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recognition.errors import NotRecognised, RecognitionError
from recognition.fusion_q import fit_polynomial
from recognition.roots import polynomials, real_roots

# QQ runs from 0 to 1; moments at which the training runs differ by less carry nothing.
FLAT = 1e-9

JUDGES = ("mean", "truncated")


@dataclass(frozen=True)
class Answer:
    """ratio: the mixing ratio, not clipped to [0, 1]; mean_difference: of QQ over usable moments."""

    ratio: float
    mean_difference: float
    usable_share: float
    moment: int


class Strategy:
    """Function space of K moments and its inverse solution.

    degree: of every polynomial, or None for the paper's rule: the lowest degree with
    R^2 >= min_r2, at most max_degree. xi: available coefficient, on the scale of QQ
    (0..1); the paper gives no value. least_share: of usable points, 0..1. judge: "mean"
    or "truncated".
    """

    def __init__(
        self,
        degree: int | None = None,
        min_r2: float = 0.99,
        max_degree: int = 4,
        xi: float = 0.05,
        least_share: float = 0.5,
        judge: str = "mean",
    ):
        self.degree = degree
        self.min_r2 = min_r2
        self.max_degree = max_degree
        self.xi = xi
        self.least_share = least_share
        self.judge = judge

    def fit(self, curves: np.ndarray, ratios: np.ndarray) -> Strategy:
        """curves: shape (n, K), QQ of the training runs; ratios: shape (n,), 0..1."""
        curves, ratios = np.asarray(curves, dtype=float), np.asarray(ratios, dtype=float)
        if self.judge not in JUDGES:
            raise RecognitionError(f"judge = {self.judge!r}; choose one of {', '.join(JUDGES)}")
        top = self.max_degree if self.degree is None else self.degree
        # One point more than coefficients, else R^2 = 1 says nothing.
        top = min(top, np.unique(ratios).size - 2)
        if top < 1 or (self.degree is not None and top < self.degree):
            raise RecognitionError(
                f"{np.unique(ratios).size} ratios are too few for polynomials of this degree"
            )
        functions = {k: self._fit_moment(ratios, values, top) for k, values in enumerate(curves.T)}
        functions = {k: fit for k, fit in functions.items() if fit is not None}
        if not functions:
            raise RecognitionError(f"no moment has a polynomial of degree <= {top} with R^2 >= {self.min_r2}")
        self.n_moments_ = curves.shape[1]
        self.moments_ = np.array(list(functions))
        self.coefficients_ = np.zeros((self.moments_.size, top + 1))
        for row, fit in enumerate(functions.values()):
            self.coefficients_[row, : fit.coefficients.size] = fit.coefficients
        return self

    def _fit_moment(self, ratios, values, top):
        if np.ptp(values) < FLAT:
            return None
        if self.degree is not None:
            return fit_polynomial(ratios, values, self.degree)
        fits = (fit_polynomial(ratios, values, degree) for degree in range(1, top + 1))
        return next((fit for fit in fits if fit.r2 >= self.min_r2), None)

    def predict(self, curves: np.ndarray) -> np.ndarray:
        """Mixing ratio of each curve, shape (n,). Raises NotRecognised."""
        return np.array([self.recognise(curve).ratio for curve in np.atleast_2d(curves)])

    def recognise(self, curve: np.ndarray) -> Answer:
        """Mixing ratio of one curve, shape (K,), with how well it is supported."""
        curve = np.asarray(curve, dtype=float)
        if curve.shape != (self.n_moments_,):
            raise RecognitionError(f"the curve has {curve.size} moments; the model has {self.n_moments_}")
        values = curve[self.moments_]
        function = polynomials(self.coefficients_)
        source, candidates = real_roots(function, values)
        if candidates.size == 0:
            raise NotRecognised("no moment has a mixing ratio between -0.05 and 1.05 that explains it")
        rows = np.arange(values.size)[None, :]
        difference = np.abs(function(rows, candidates[:, None]) - values)
        usable = difference <= self.xi
        usable[np.arange(candidates.size), source] = (
            False  # a moment agrees with its own root by construction
        )
        count = usable.sum(axis=1)
        share = count / max(1, values.size - 1)
        if self.judge == "truncated":
            mean = np.minimum(difference, self.xi).sum(axis=1) / max(1, values.size - 1)
        else:
            mean = np.where(usable, difference, 0.0).sum(axis=1) / np.maximum(count, 1)
        allowed = (count > 0) & (share >= self.least_share)
        if not np.any(allowed):
            raise NotRecognised(
                f"the best of {candidates.size} candidates explains {share.max():.0%} of the moments within"
                f" xi = {self.xi:g}; needs {self.least_share:.0%}"
            )
        best = int(np.argmin(np.where(allowed, mean, np.inf)))
        moment = int(self.moments_[source[best]])
        return Answer(float(candidates[best]), float(mean[best]), float(share[best]), moment)

    def to_dict(self) -> dict:
        return {
            "degree": self.degree,
            "min_r2": self.min_r2,
            "max_degree": self.max_degree,
            "xi": self.xi,
            "least_share": self.least_share,
            "judge": self.judge,
            "n_moments": self.n_moments_,
            "moments": self.moments_.tolist(),
            "coefficients": self.coefficients_.tolist(),
        }

    @classmethod
    def from_dict(cls, data: dict) -> Strategy:
        model = cls(
            *(data[name] for name in ("degree", "min_r2", "max_degree", "xi", "least_share", "judge"))
        )
        model.n_moments_ = int(data["n_moments"])
        model.moments_ = np.asarray(data["moments"], dtype=int)
        model.coefficients_ = np.asarray(data["coefficients"], dtype=float)
        return model
