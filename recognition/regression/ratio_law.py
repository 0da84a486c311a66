"""How records change with the mixing ratio and with the conditions of a run, and how far a record is from that law.

    x = m(theta) + e + n,   m(theta) = sum over monomials of theta, of total degree d
    theta = (beta, nuisances)    nuisances: impact speed, damping ... known of the training runs, not of a record
    e ~ N(0, S)    what theta does not say: arrangement, packing, breakage; from residuals of held-out training runs
    n ~ N(0, s^2)  white noise of the sensors; s^2 from the part of the record that no training run has

The law holds for the k leading principal components of the training records, turned so that S is diagonal; what lies
outside them is an estimate of s^2. S is shrunk (OAS, Chen et al. 2010, IEEE Trans. Signal Process. 58:5016). theta is
found by Gauss-Newton from the best point of a grid.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement

import numpy as np
from sklearn.covariance import oas
from sklearn.decomposition import PCA
from sklearn.model_selection import GroupKFold

from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError

COMPONENTS, DEGREE = 40, 2
FOLDS = 11
MARGIN = 0.15  # of each range, how far outside of the training theta is looked for
GRID = {1: (131,), 2: (53, 25), 3: (53, 13, 9)}  # points along each axis of theta
STEPS = 12
WORST_NOISE_DB = 20.0  # below the signal; louder noise is not that of a sensor in use
#: How far outside its range in training, in shares of it, a ratio or condition is expected to come out.
EXTRAPOLATION = 0.1
#: Names of the distances of a record from the training, in the order of `LawEstimate.distances`.
DISTANCES = ("misfit", "part unknown to the training", "ratio or condition outside the training")


def monomials(count: int, degree: int) -> Floats:
    """Powers of each variable in every monomial of total degree up to `degree`, shape (p, count)."""
    terms = [t for d in range(degree + 1) for t in combinations_with_replacement(range(count), d)]
    return np.array([[term.count(k) for k in range(count)] for term in terms], dtype=float)


def basis(theta: Floats, powers: Floats) -> Floats:
    """Monomials at theta (..., q), shape (..., p)."""
    return np.asarray(np.prod(theta[..., None, :] ** powers, axis=-1))


def basis_slopes(theta: Floats, powers: Floats) -> Floats:
    """Their derivatives by each variable at theta (q,), shape (q, p)."""
    rows = []
    for k in range(powers.shape[1]):
        lower = powers.copy()
        lower[:, k] = np.maximum(lower[:, k] - 1, 0)
        rows.append(powers[:, k] * basis(theta, lower))
    return np.array(rows)


@dataclass(frozen=True)
class LawEstimate:
    """Of one record. theta (q,): ratio, not clipped, and conditions; misfit: chi-square over its degrees of freedom;
    noise: what no training record has, as a share of the record's own rms; outside: how far theta lies outside the
    training, in shares of the range of each variable, at most."""

    theta: Floats
    misfit: float
    noise: float
    outside: float

    @property
    def distances(self) -> Floats:
        """Distances from the training, shape (3,) as in DISTANCES, 1 being as expected: the misfit, the part that no
        training record has against noise of WORST_NOISE_DB, and how far outside theta is against EXTRAPOLATION."""
        return np.array([self.misfit, self.noise / 10 ** (-WORST_NOISE_DB / 20), self.outside / EXTRAPOLATION])


@dataclass(frozen=True)
class RatioLaw:
    """A fitted law; d = channels x samples, k components, q variables of theta, p monomials.

    scale (channels,): rms of each channel in training; mean (d,), components (k, d): of records in shares of scale;
    powers (p, q), coefficients (p, k): of m; variance (k,): of e; low, high (q,): of theta in training, ratio first.
    """

    scale: Floats
    mean: Floats
    components: Floats
    powers: Floats
    coefficients: Floats
    variance: Floats
    low: Floats
    high: Floats

    def scaled(self, record: Floats) -> Floats:
        """A record (channels, samples) as a row (d,), each channel in shares of its rms in training."""
        return (record / self.scale[:, None]).ravel()

    def estimate(self, record: Floats) -> LawEstimate:
        """Of one record, shape (channels, samples)."""
        row = self.scaled(record)
        off = row - self.mean
        z = self.components @ off
        spare = max(1, off.size - z.size)
        noise2 = max(0.0, float(off @ off - z @ z)) / spare
        weight = 1.0 / (self.variance + noise2)
        grid, law = self._grid
        start = grid[np.argmin((law**2) @ weight - 2 * (law @ (weight * z)))]
        theta = self._gauss_newton(z, weight, start.copy())
        residual = z - basis(theta, self.powers) @ self.coefficients
        misfit = float(np.sum(weight * residual**2)) / len(z)
        outside = max(0.0, float(np.abs(theta).max() - 1) / 2)
        physical = self.low + 0.5 * (theta + 1) * (self.high - self.low)
        return LawEstimate(physical, misfit, float(np.sqrt(noise2 / np.mean(row**2))), outside)

    @cached_property
    def _grid(self) -> tuple[Floats, Floats]:
        """theta (g, q) in units of -1..1 and the law there (g, k)."""
        axes = [np.linspace(-1 - 2 * MARGIN, 1 + 2 * MARGIN, n) for n in GRID[len(self.low)]]
        theta = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
        return theta, basis(theta, self.powers) @ self.coefficients

    def _gauss_newton(self, z: Floats, weight: Floats, theta: Floats) -> Floats:
        """theta in units of -1..1; steps are halved until the chi-square falls."""
        def chi_square(at: Floats) -> float:
            return float(np.sum(weight * (z - basis(at, self.powers) @ self.coefficients) ** 2))
        best = chi_square(theta)
        for _ in range(STEPS):
            slope = basis_slopes(theta, self.powers) @ self.coefficients
            residual = z - basis(theta, self.powers) @ self.coefficients
            curvature = (slope * weight) @ slope.T
            step = np.linalg.lstsq(curvature, (slope * weight) @ residual, rcond=None)[0]
            length = 1.0
            while length > 1e-3 and chi_square(theta + length * step) > best:
                length /= 2
            if length <= 1e-3 or np.abs(step).max() < 1e-7:
                break
            theta = np.clip(theta + length * step, -2.0, 2.0)
            best = chi_square(theta)
        return theta


def fit_law(X: Floats, y: Floats, nuisance: Floats | None = None, groups: Floats | None = None,
            components: int = COMPONENTS, degree: int = DEGREE) -> RatioLaw:
    """Law of records X (runs, channels, samples) of ratio y (runs,).

    nuisance (runs, q - 1): conditions; groups (runs,): runs that are held out together, each ratio by itself if None;
    components: most that are kept; degree: of the polynomials. RecognitionError for too few runs.
    """
    theta = y[:, None] if nuisance is None else np.column_stack([y, nuisance])
    low, high = theta.min(axis=0), theta.max(axis=0)
    if np.any(high <= low):
        raise RecognitionError("a ratio or a nuisance has the same value in all training runs")
    powers = monomials(theta.shape[1], degree)
    if len(y) < len(powers) + 2:
        raise RecognitionError(f"{len(y)} runs; degree {degree} in {theta.shape[1]} variables needs {len(powers) + 2}")
    scale = np.sqrt(np.mean(X**2, axis=(0, 2)))
    rows = (X / scale[:, None]).reshape(len(X), -1)
    pca = PCA(min(components, len(y) - 1), svd_solver="full").fit(rows)
    phi = basis(2 * (theta - low) / (high - low) - 1, powers)
    coefficients = np.linalg.lstsq(phi, pca.transform(rows), rcond=None)[0]
    residual = held_out_residual(rows, phi, y if groups is None else np.asarray(groups))
    variance, turn = np.linalg.eigh(oas(residual @ pca.components_.T, assume_centered=True)[0])
    return RatioLaw(scale, pca.mean_, turn.T @ pca.components_, powers, coefficients @ turn,
                    np.maximum(variance, 1e-12), low, high)


def held_out_residual(rows: Floats, phi: Floats, groups: Floats) -> Floats:
    """Residual of each run by the law of the other groups, shape as rows (runs, d).

    The residual within the fit would be too small, most of all in the components that only few runs have.
    """
    residual = np.empty_like(rows)
    for train, test in GroupKFold(min(FOLDS, np.unique(groups).size)).split(rows, groups=groups):
        residual[test] = rows[test] - phi[test] @ np.linalg.lstsq(phi[train], rows[train], rcond=None)[0]
    return residual
