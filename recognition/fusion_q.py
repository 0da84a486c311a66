"""Recognition by the fused parameter Q of the acceleration (Section V-A, Eq. 40).

Q is the weighted sum of eight standardised parameters; a quadratic Q(beta) is
fitted to the training runs and inverted for a new record.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recognition.errors import NotRecognised, RecognitionError
from recognition.roots import ROOT_MARGIN, polynomials, real_roots
from recognition.standardise import MinMaxByTrend, trend


@dataclass(frozen=True)
class PolynomialFit:
    """Least-squares polynomial, lowest power first, with its determination.

    r2_adjusted = 1 - (1 - R^2)(n - 1)/(n - degree - 1). The paper's "R^2 = 0.99079"
    of Q is the adjusted one; the plain one of its Table 3 is 0.99263.
    """

    coefficients: np.ndarray
    r2: float
    r2_adjusted: float

    def __call__(self, ratio):
        return np.polynomial.polynomial.polyval(ratio, self.coefficients)


def fit_polynomial(ratios: np.ndarray, values: np.ndarray, degree: int) -> PolynomialFit:
    """Polynomial of a given degree by least squares; needs more points than the degree."""
    ratios, values = np.asarray(ratios, dtype=float), np.asarray(values, dtype=float)
    if np.unique(ratios).size <= degree:
        raise RecognitionError(
            f"degree {degree} needs at least {degree + 1} ratios; has {np.unique(ratios).size}"
        )
    coefficients = np.polynomial.polynomial.polyfit(ratios, values, degree)
    residual = np.sum((values - np.polynomial.polynomial.polyval(ratios, coefficients)) ** 2)
    r2 = 1.0 - residual / np.sum((values - values.mean()) ** 2)
    spare = ratios.size - degree - 1
    adjusted = 1.0 - (1.0 - r2) * (ratios.size - 1) / spare if spare > 0 else float("nan")
    return PolynomialFit(coefficients, float(r2), float(adjusted))


class FusionQ:
    """Q-polynomial recognition.

    weights: shape (p,), sum 1 (the paper: equal). degree: of Q(beta) (the paper: 2).
    """

    def __init__(self, weights=None, degree: int = 2):
        self.weights = weights
        self.degree = degree

    def fit(self, parameters: np.ndarray, ratios: np.ndarray) -> FusionQ:
        """parameters: shape (n, p), ratios: shape (n,), 0..1. Directions (Eq. 39) from the data."""
        parameters, ratios = np.asarray(parameters, dtype=float), np.asarray(ratios, dtype=float)
        count = parameters.shape[1]
        weights = (
            np.full(count, 1.0 / count) if self.weights is None else np.asarray(self.weights, dtype=float)
        )
        if weights.shape != (count,) or not np.isclose(weights.sum(), 1.0):
            raise RecognitionError(f"weights = {weights.tolist()}; needs {count} numbers with sum 1")
        self.weights_ = weights
        self.scaler_ = MinMaxByTrend().fit(parameters, trend(parameters, ratios))
        self.fit_ = fit_polynomial(ratios, self.transform(parameters), self.degree)
        return self

    def transform(self, parameters: np.ndarray) -> np.ndarray:
        """Q of each record, shape (n,)."""
        return self.scaler_.transform(parameters) @ self.weights_

    def predict(self, parameters: np.ndarray) -> np.ndarray:
        """Mixing ratio of each record, shape (n,). Raises NotRecognised where Q has no root."""
        return np.array([self.invert(q) for q in self.transform(np.atleast_2d(parameters))])

    def invert(self, q: float) -> float:
        """The ratio beta with Q(beta) = q.

        The real root in [-margin, 1 + margin]; of two such roots the one where Q rises
        with beta, as it was built to do (Eq. 39). It is not clipped to [0, 1].
        """
        _, roots = real_roots(polynomials(self.fit_.coefficients[None, :]), np.array([q]))
        if roots.size > 1:
            slope = np.polynomial.polynomial.polyval(
                roots, np.polynomial.polynomial.polyder(self.fit_.coefficients)
            )
            roots = roots[slope > 0]
        if roots.size == 0:
            low, high = -ROOT_MARGIN, 1 + ROOT_MARGIN
            raise NotRecognised(
                f"Q = {q:.4g} has no rising root between {low:g} and {high:g} of mixing ratio"
            )
        return float(roots[0])

    def to_dict(self) -> dict:
        return {
            "weights": self.weights_.tolist(),
            "minimum": self.scaler_.minimum.tolist(),
            "maximum": self.scaler_.maximum.tolist(),
            "direction": self.scaler_.direction.tolist(),
            "coefficients": self.fit_.coefficients.tolist(),
            "r2": self.fit_.r2,
            "r2_adjusted": self.fit_.r2_adjusted,
        }

    @classmethod
    def from_dict(cls, data: dict) -> FusionQ:
        coefficients = np.asarray(data["coefficients"], dtype=float)
        model = cls(weights=data["weights"], degree=coefficients.size - 1)
        model.weights_ = np.asarray(data["weights"], dtype=float)
        model.scaler_ = MinMaxByTrend(
            np.asarray(data["minimum"], dtype=float),
            np.asarray(data["maximum"], dtype=float),
            np.asarray(data["direction"], dtype=int),
        )
        model.fit_ = PolynomialFit(coefficients, float(data["r2"]), float(data["r2_adjusted"]))
        return model
