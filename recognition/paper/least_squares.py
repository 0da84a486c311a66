"""Least-squares polynomials and their determination."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError


def r2(values: Floats, fitted: Floats) -> float:
    """R^2 = 1 - sum (y - f)^2 / sum (y - mean y)^2."""
    return float(1.0 - np.sum((values - fitted) ** 2) / np.sum((values - np.mean(values)) ** 2))


def adjusted_r2(values: Floats, fitted: Floats, parameters: int) -> float:
    """1 - (1 - R^2)(n - 1)/(n - parameters); NaN with no point to spare."""
    spare = values.size - parameters
    return 1.0 - (1.0 - r2(values, fitted)) * (values.size - 1) / spare if spare > 0 else float("nan")


@dataclass(frozen=True)
class PolynomialFit:
    """Least-squares polynomial, lowest power first.

    The paper's "R^2 = 0.99079" of Q is the adjusted one; the plain one of its Table 3 is 0.99263.
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
    coefficients = np.polynomial.polynomial.polyfit(ratios, values, degree).astype(float)
    fitted = np.asarray(np.polynomial.polynomial.polyval(ratios, coefficients))
    return PolynomialFit(coefficients, r2(values, fitted), adjusted_r2(values, fitted, degree + 1))
