"""scikit-learn estimator of `recognition.energies`."""

from __future__ import annotations

import warnings

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

from recognition.energies import ProcessNumbers
from recognition.likelihood import RatioLikelihood


class EnergyProcess(RegressorMixin, BaseEstimator):
    """Gaussian process on standardised features, X of shape (runs, p); a law of the features with their scatter says which
    records are strange."""

    def fit(self, X, y, nuisance=None, groups=None) -> EnergyProcess:
        """y (runs,): ratios; nuisance, groups: of the law, as in `RatioLikelihood.fit`, which raises RecognitionError."""
        X, y = np.asarray(X, dtype=float), np.asarray(y, dtype=float)
        mean, scale = X.mean(axis=0), X.std(axis=0)
        z = (X - mean) / scale
        # The bounds keep the search from the answer that all is noise, which is always there.
        kernel = ConstantKernel(1.0, (1e-2, 1e3)) * Matern(10.0, (0.3, 1e3), nu=2.5) + WhiteKernel(0.1, (1e-6, 1.0))
        with warnings.catch_warnings():
            # A scale of the kernel at its bound is an answer too: a straight line, or no noise.
            warnings.simplefilter("ignore", ConvergenceWarning)
            process = GaussianProcessRegressor(kernel, normalize_y=True, random_state=0).fit(z, y)
        self.process_ = process
        smooth = process.kernel_.k1
        law = RatioLikelihood(components=z.shape[1]).fit(z[:, None, :], y, nuisance, groups).posterior_
        self.numbers_ = ProcessNumbers(mean, scale, z, process.alpha_, float(smooth.k1.constant_value),
                                       float(smooth.k2.length_scale), float(y.mean()), float(y.std()), law)
        return self

    def predict(self, X) -> np.ndarray:
        """Ratios, shape (runs,); not clipped."""
        return np.array([self.numbers_.ratio(x) for x in np.asarray(X, dtype=float)])

    def strangeness(self, X) -> np.ndarray:
        """`ProcessNumbers.strangeness` of each record, shape (runs, 3)."""
        return np.array([self.numbers_.strangeness(x) for x in np.asarray(X, dtype=float)])
