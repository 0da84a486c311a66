"""scikit-learn estimator of `recognition.regression.band_energies`."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

from recognition.errors import RecognitionError
from recognition.regression.band_energies import ProcessNumbers
from recognition.regression.ratio_likelihood import RatioLikelihood


def _scatter(process: GaussianProcessRegressor) -> float:
    """Mean square error at each training record when it is left out: alpha_i/(K^-1)_ii (Rasmussen and Williams 2006, 5.12).
    The noise of the kernel may be none where few records happen to lie on a smooth curve."""
    inverse = cho_solve((process.L_, True), np.eye(len(process.L_)))
    return float(np.mean((process.alpha_ / np.diag(inverse)) ** 2))


def _fitted(z: np.ndarray, y: np.ndarray) -> GaussianProcessRegressor:
    # The bounds keep the search from the answer that all is noise, which is always there.
    kernel = ConstantKernel(1.0, (1e-2, 1e3)) * Matern(10.0, (0.3, 1e3), nu=2.5) + WhiteKernel(0.1, (1e-6, 1.0))
    with warnings.catch_warnings():
        # A scale of the kernel at its bound is an answer too: a straight line, or no noise.
        warnings.simplefilter("ignore", ConvergenceWarning)
        return GaussianProcessRegressor(kernel, normalize_y=True, random_state=0).fit(z, y)


@dataclass(frozen=True)
class _Told:
    """A process on features and conditions that are told with a record, such as the impact speed."""

    process: GaussianProcessRegressor
    mean: np.ndarray
    scale: np.ndarray

    @classmethod
    def fit(cls, z: np.ndarray, conditions: np.ndarray, y: np.ndarray) -> _Told:
        mean, scale = conditions.mean(axis=0), conditions.std(axis=0)
        return cls(_fitted(np.hstack([z, (conditions - mean) / scale]), y), mean, scale)

    def predict(self, z: np.ndarray, conditions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.process.predict(np.hstack([z, (conditions - self.mean) / self.scale]), return_std=True)


class EnergyProcess(RegressorMixin, BaseEstimator):
    """Gaussian process on the first `answering` standardised features (None: on all); a law of all features with their
    scatter says which records are strange. X has the shape (runs, 2, p): features, and their errors by the noise of sensors."""

    def __init__(self, answering: int | None = None):
        self.answering = answering

    def fit(self, X, y, nuisance=None, groups=None) -> EnergyProcess:
        """y (runs,): ratios; nuisance, groups: of the law, as in `RatioLikelihood.fit`, which raises RecognitionError."""
        X, y = np.asarray(X, dtype=float), np.asarray(y, dtype=float)
        mean, scale = X[:, 0].mean(axis=0), X[:, 0].std(axis=0)
        z = (X[:, 0] - mean) / scale
        process = _fitted(z[:, :self.answering], y)
        self.process_ = process
        self.told_: _Told | None = None  # fitted when first asked for
        self.training_ = z[:, :self.answering], None if nuisance is None else np.asarray(nuisance, dtype=float), y
        smooth = process.kernel_.k1
        law = RatioLikelihood(components=z.shape[1]).fit(z[:, None, :], y, nuisance, groups).posterior_
        self.numbers_ = ProcessNumbers(mean, scale, z[:, :self.answering], process.alpha_, float(smooth.k1.constant_value),
                                       float(smooth.k2.length_scale), _scatter(process), float(y.mean()), float(y.std()), law)
        return self

    def predict(self, X, return_std: bool = False, nuisance=None):
        """Ratios (runs,), not clipped, and their standard errors where asked for; nuisance (runs, q): told with the records."""
        if nuisance is not None:
            z = (np.asarray(X, dtype=float)[:, 0] - self.numbers_.mean) / self.numbers_.scale
            if self.told_ is None:
                points, conditions, y = self.training_
                if conditions is None:
                    raise RecognitionError("conditions are told with a record; the training was told none")
                self.told_ = _Told.fit(points, conditions, y)
            ratio, error = self.told_.predict(z[:, :self.answering], np.asarray(nuisance, dtype=float))
            return (ratio, error) if return_std else ratio
        ratio, error = np.array([self.numbers_.ratio(x) for x in np.asarray(X, dtype=float)]).T
        return (ratio, error) if return_std else ratio

    def strangeness(self, X) -> np.ndarray:
        """`ProcessNumbers.strangeness` of each record, shape (runs, 3)."""
        return np.array([self.numbers_.strangeness(x) for x in np.asarray(X, dtype=float)])
