"""Recognition by the fused parameter Q of the acceleration (Section V-A, Eq. 40).

Q is the weighted sum of eight standardised parameters; a quadratic Q(beta) is fitted to
the training runs and inverted for a new record.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis import as_record, base_parameters
from analysis.records import sample_rate_Hz
from recognition.errors import NotRecognised, RecognitionError
from recognition.paper.least_squares import PolynomialFit, fit_polynomial
from recognition.paper.roots import ROOT_MARGIN, real_roots
from recognition.paper.standardise import MinMaxByTrend, trend


class FusionQ:
    """Q-polynomial recognition.

    weights: shape (p,), sum 1 (the paper: equal). degree: of Q(beta) (the paper: 2).
    """

    def __init__(self, weights=None, degree: int = 2):
        self.weights = weights
        self.degree = degree

    @staticmethod
    def prepare(signals: pd.DataFrame) -> np.ndarray:
        """The eight base parameters of a record with `t_s` and `a_m_s2`, shape (8,)."""
        if "a_m_s2" not in signals.columns:
            raise RecognitionError("no column 'a_m_s2' in the record; needs it for Q")
        rate_Hz = sample_rate_Hz(signals["t_s"].to_numpy(dtype=float), "t_s")
        acceleration = signals["a_m_s2"].to_numpy(dtype=float)
        return base_parameters(as_record(acceleration, rate_Hz, unit="m/s^2", name="a_m_s2"))

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

        The real root in [-margin, 1 + margin]; of two such roots the one where Q rises with
        beta, as it was built to do (Eq. 39). It is not clipped to [0, 1].
        """
        _, roots = real_roots(lambda k, beta: self.fit_(beta) + 0.0 * k, np.array([q]))
        if roots.size > 1:
            slope = np.polynomial.polynomial.polyder(self.fit_.coefficients)
            roots = roots[np.polynomial.polynomial.polyval(roots, slope) > 0]
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
