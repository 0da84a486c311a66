"""scikit-learn estimator of `recognition.regression.ratio_posterior`."""

from __future__ import annotations

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.covariance import oas
from sklearn.decomposition import PCA
from sklearn.model_selection import GroupKFold

from recognition.errors import RecognitionError
from recognition.regression.ratio_posterior import RatioPosterior, basis, monomials

FOLDS = 11


class RatioLikelihood(RegressorMixin, BaseEstimator):
    """Mixing ratio by one likelihood over all moments.

    components: most principal components kept; degree: of the polynomials in the ratio and the nuisances.
    X has the shape (runs, channels, samples).
    """

    def __init__(self, components: int = 40, degree: int = 2):
        self.components = components
        self.degree = degree

    def fit(self, X, y, nuisance=None, groups=None) -> RatioLikelihood:
        """y (runs,): ratios, 0..1; nuisance (runs, q - 1): conditions that a record will not tell; groups (runs,): runs
        that are held out together, each ratio by itself if None.

        RecognitionError for fewer runs than the polynomials have coefficients.
        """
        X, y = np.asarray(X, dtype=float), np.asarray(y, dtype=float)
        theta = y[:, None] if nuisance is None else np.column_stack([y, nuisance])
        low, high = theta.min(axis=0), theta.max(axis=0)
        if np.any(high <= low):
            raise RecognitionError("a ratio or a nuisance has the same value in all training runs")
        powers = monomials(theta.shape[1], self.degree)
        if len(y) < len(powers) + 2:
            raise RecognitionError(f"{len(y)} runs; degree {self.degree} in {theta.shape[1]} variables needs "
                                   f"{len(powers) + 2}")
        scale = np.sqrt(np.mean(X**2, axis=(0, 2)))
        rows = (X / scale[:, None]).reshape(len(X), -1)
        pca = PCA(min(self.components, len(y) - 1), svd_solver="full").fit(rows)
        z = pca.transform(rows)
        phi = basis(2 * (theta - low) / (high - low) - 1, powers)
        coefficients = np.linalg.lstsq(phi, z, rcond=None)[0]
        rest = held_out_rest(rows, phi, y if groups is None else np.asarray(groups))
        variance, turn = np.linalg.eigh(oas(rest @ pca.components_.T, assume_centered=True)[0])
        self.posterior_ = RatioPosterior(scale, pca.mean_, turn.T @ pca.components_, powers, coefficients @ turn,
                                         np.maximum(variance, 1e-12), low, high)
        return self

    def predict(self, X, return_std: bool = False, nuisance=None):
        """Ratios (runs,), not clipped, and their standard errors where asked for."""
        found = self.estimates(X, nuisance)
        ratio = np.array([e.ratio for e in found])
        return (ratio, np.array([e.standard_error for e in found])) if return_std else ratio

    def estimates(self, X, nuisance=None) -> list:
        """An `Estimate` of each record; nuisance (runs, q - 1) where it is known."""
        known = [None] * len(X) if nuisance is None else np.asarray(nuisance, dtype=float)
        return [self.posterior_.estimate(np.asarray(x, dtype=float), k) for x, k in zip(X, known, strict=True)]

    def strangeness(self, X) -> np.ndarray:
        """`Estimate.strangeness` of each record, shape (runs, 3)."""
        return np.array([e.strangeness for e in self.estimates(X)])


def held_out_rest(rows: np.ndarray, phi: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """What the law of the other groups leaves of each run, shape as rows (runs, d).

    The rest within the fit would be too small, most of all in the components that only few runs have.
    """
    rest = np.empty_like(rows)
    for train, test in GroupKFold(min(FOLDS, np.unique(groups).size)).split(rows, groups=groups):
        rest[test] = rows[test] - phi[test] @ np.linalg.lstsq(phi[train], rows[train], rcond=None)[0]
    return rest
