"""A Gaussian process from features of a record to the ratio, with the law of these features (`ratio_law`)."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import cho_solve
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

from recognition.estimation.arrays import Floats
from recognition.estimation.method import RecordEstimator
from recognition.regression.ratio_law import RatioLaw, fit_law


@dataclass(frozen=True)
class ProcessModel:
    """A fitted Gaussian process with Matern's kernel (nu 5/2), and the law of its features.

    mean, scale (p,): of the features; points (n, m), weights (n,): of the process, in the first m standardised
    features; constant, length: of its kernel; scatter: mean square error of a training record left out, in units of
    size; offset, size: mean and standard deviation of the ratio in training; law: of the standardised features, taken
    as one channel.
    """

    mean: Floats
    scale: Floats
    points: Floats
    weights: Floats
    constant: float
    length: float
    scatter: float
    offset: float
    size: float
    law: RatioLaw

    @property
    def standard_error(self) -> float:
        """Of the ratio of a record without noise."""
        return float(self.size * np.sqrt(self.scatter))

    def ratio(self, record: Floats) -> tuple[float, float]:
        """Of one record, features and their errors (2, p): ratio, and its standard error from the scatter of the
        training and, through the slope of the process, the errors of the features."""
        m = self.points.shape[1]
        away = self.points - ((record[0] - self.mean) / self.scale)[:m]
        r = np.sqrt(5) * np.linalg.norm(away, axis=1) / self.length
        smooth = self.constant * np.exp(-r) * self.weights
        slope = 5 / (3 * self.length**2) * (smooth * (1 + r)) @ away
        error = slope * (record[1] / self.scale)[:m]
        return (float(self.offset + self.size * (smooth @ (1 + r + r**2 / 3))),
                float(np.hypot(self.standard_error, self.size * np.linalg.norm(error))))

    def distances(self, record: Floats) -> Floats:
        """Distances of features and errors (2, p) from the training, shape (3,), see `LawEstimate.distances`."""
        return self.law.estimate(((record[0] - self.mean) / self.scale)[None]).distances


def _scatter(process: GaussianProcessRegressor) -> float:
    """Mean square error at each training record when it is left out: alpha_i/(K^-1)_ii (Rasmussen and Williams 2006,
    5.12). The noise of the kernel may be none where few records happen to lie on a smooth curve."""
    inverse = cho_solve((process.L_, True), np.eye(len(process.L_)))
    return float(np.mean((process.alpha_ / np.diag(inverse)) ** 2))


def _fitted(z: Floats, y: Floats) -> GaussianProcessRegressor:
    # The bounds keep the search from the answer that all is noise, which is always there.
    kernel = ConstantKernel(1.0, (1e-2, 1e3)) * Matern(10.0, (0.3, 1e3), nu=2.5) + WhiteKernel(0.1, (1e-6, 1.0))
    with warnings.catch_warnings():
        # A scale of the kernel at its bound is an answer too: a straight line, or no noise.
        warnings.simplefilter("ignore", ConvergenceWarning)
        return GaussianProcessRegressor(kernel, normalize_y=True, random_state=0).fit(z, y)


class ProcessRegressor(RecordEstimator):
    """scikit-learn estimator: Gaussian process on standardised features, and a law of the features with their scatter,
    which tells records out of distribution.

    X has the shape (runs, 2, p): features, and their standard errors by the noise of the sensors.
    """

    def fit(self, X: Floats, y: Floats, nuisance: Floats | None = None,
            groups: Floats | None = None) -> ProcessRegressor:
        """y (runs,): ratios; nuisance, groups: of the law, as in `fit_law`, which raises RecognitionError."""
        X, y = np.asarray(X, dtype=float), np.asarray(y, dtype=float)
        mean, scale = X[:, 0].mean(axis=0), X[:, 0].std(axis=0)
        z = (X[:, 0] - mean) / scale
        process = _fitted(z, y)
        smooth = process.kernel_.k1
        law = fit_law(z[:, None, :], y, nuisance, groups, components=z.shape[1])
        self.model_ = ProcessModel(
            mean, scale, z, process.alpha_, float(smooth.k1.constant_value), float(smooth.k2.length_scale),
            _scatter(process), float(y.mean()), float(y.std()), law)
        return self

    def predict(self, X: Floats, return_std: bool = False) -> Any:
        """Ratios (runs,), not clipped, and their standard errors where asked for."""
        ratio, error = np.array([self.model_.ratio(x) for x in np.asarray(X, dtype=float)]).T
        return (ratio, error) if return_std else ratio

    def distances(self, X: Floats) -> Floats:
        """`ProcessModel.distances` of each record, shape (runs, 3)."""
        return np.array([self.model_.distances(x) for x in np.asarray(X, dtype=float)])
