"""The mixing ratio of a record from one likelihood over all moments of all its signals.

    x = m(theta) + e + n,   m(theta) = sum over monomials of theta, of total degree d
    theta = (beta, nuisances)    nuisances: impact speed, damping ... known in training, not in a record
    e ~ N(0, S)    what theta does not say: arrangement, packing, breakage; from the residuals of training
    n ~ N(0, s^2)  white noise of the sensors; s^2 from the part of the record that no training run has

Everything happens in the k leading principal components of the training records, turned so that S is diagonal there;
what lies outside them is an estimate of s^2. theta by Gauss-Newton from the best point of a grid, its standard error
from the curvature there. Only numpy is needed.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from functools import cached_property
from itertools import combinations_with_replacement

import numpy as np

MARGIN = 0.15  # of each range, how far outside of the training theta is looked for
GRID = {1: (131,), 2: (53, 25), 3: (53, 13, 9)}  # points along each axis of theta
STEPS = 12
WORST_NOISE_DB = 20.0  # below the signal; what is louder is no noise of a sensor that one would use
EXTRAPOLATION = 0.1  # how far outside its range in training, in shares of it, a ratio or condition is expected to come out
#: What each number of `Estimate.strangeness` says of a record.
STRANGE = ("misfit", "part unknown to the training", "ratio or condition outside the training")


def monomials(count: int, degree: int) -> np.ndarray:
    """Powers of each variable in every monomial of total degree up to `degree`, shape (p, count)."""
    terms = [t for d in range(degree + 1) for t in combinations_with_replacement(range(count), d)]
    return np.array([[term.count(k) for k in range(count)] for term in terms])


def basis(theta: np.ndarray, powers: np.ndarray) -> np.ndarray:
    """Monomials at theta (..., q), shape (..., p)."""
    return np.prod(theta[..., None, :] ** powers, axis=-1)


def basis_slopes(theta: np.ndarray, powers: np.ndarray) -> np.ndarray:
    """Their derivatives by each variable at theta (q,), shape (q, p)."""
    rows = []
    for k in range(powers.shape[1]):
        lower = powers.copy()
        lower[:, k] = np.maximum(lower[:, k] - 1, 0)
        rows.append(powers[:, k] * basis(theta, lower))
    return np.array(rows)


def _standard_error(curvature: np.ndarray) -> float:
    """Of the first variable; infinite where the record does not tell it from the others."""
    try:
        variance = np.linalg.inv(curvature)[0, 0]
    except np.linalg.LinAlgError:
        return np.inf
    return float(np.sqrt(variance)) if variance > 0 else np.inf


@dataclass(frozen=True)
class Estimate:
    """Of one record. ratio is not clipped. misfit: chi-square over its degrees of freedom; noise: what no training
    record has, as a share of the record's own rms; outside: how far theta lies outside the training, in shares of the
    range of each variable, at most."""

    ratio: float
    standard_error: float
    misfit: float
    noise: float
    outside: float
    nuisance: np.ndarray

    @property
    def strangeness(self) -> np.ndarray:
        """How unlike the training, shape (3,) as in STRANGE, 1 being as expected: misfit of the model, what no training
        record has against noise of WORST_NOISE_DB, and how far outside against EXTRAPOLATION."""
        return np.array([self.misfit, self.noise / 10 ** (-WORST_NOISE_DB / 20), self.outside / EXTRAPOLATION])


def why_strange(strangeness: np.ndarray, limit: np.ndarray) -> str:
    """Which of STRANGE are above their limits, "" if none is."""
    return "; ".join(f"{what} {value:.3g}, limit {most:.3g}"
                     for what, value, most in zip(STRANGE, strangeness, limit, strict=True) if value > most)


@dataclass(frozen=True)
class RatioPosterior:
    """Fitted numbers; d = channels x samples, k components, q variables of theta, p monomials.

    scale (channels,); mean (d,), components (k, d) of scaled records; powers (p, q), coefficients (p, k);
    variance (k,) of e; low, high (q,) of theta in training, the ratio first; degrees: of freedom of `misfit`.
    """

    scale: np.ndarray
    mean: np.ndarray
    components: np.ndarray
    powers: np.ndarray
    coefficients: np.ndarray
    variance: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def scaled(self, record: np.ndarray) -> np.ndarray:
        """Records (..., channels, samples) as rows (..., d), each channel in shares of its rms in training."""
        record = record / self.scale[:, None]
        return record.reshape(*record.shape[:-2], -1)

    def estimate(self, record: np.ndarray, nuisance: np.ndarray | None = None) -> Estimate:
        """Of one record, shape (channels, samples); nuisance (q - 1,) where it is known."""
        row = self.scaled(record)
        off = row - self.mean
        z = self.components @ off
        spare = max(1, off.size - z.size)
        noise2 = max(0.0, float(off @ off - z @ z)) / spare
        weight = 1.0 / (self.variance + noise2)
        free = np.ones(len(self.low), dtype=bool)
        start = self._best_of_grid(z, weight)
        if nuisance is not None:
            free[1:] = False
            start = self._best_given(z, weight, self._to_unit(np.concatenate([[0.0], nuisance]))[1:])
        theta, curvature = self._gauss_newton(z, weight, start, free)
        rest = z - basis(theta, self.powers) @ self.coefficients
        physical = self.low + 0.5 * (theta + 1) * (self.high - self.low)
        error = 0.5 * (self.high - self.low)[0] * _standard_error(curvature)
        misfit = float(np.sum(weight * rest**2)) / len(z)
        outside = max(0.0, float(np.abs(theta).max() - 1) / 2)
        return Estimate(float(physical[0]), float(error), misfit, float(np.sqrt(noise2 / np.mean(row**2))), outside,
                        physical[1:])

    def _to_unit(self, theta: np.ndarray) -> np.ndarray:
        return 2 * (theta - self.low) / (self.high - self.low) - 1

    @cached_property
    def _grid(self) -> tuple[np.ndarray, np.ndarray]:
        """theta (g, q) in units of -1..1 and the model there (g, k)."""
        axes = [np.linspace(-1 - 2 * MARGIN, 1 + 2 * MARGIN, n) for n in GRID[len(self.low)]]
        theta = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
        return theta, basis(theta, self.powers) @ self.coefficients

    def _best_of_grid(self, z: np.ndarray, weight: np.ndarray) -> np.ndarray:
        theta, model = self._grid
        return theta[np.argmin((model**2) @ weight - 2 * (model @ (weight * z)))].copy()

    def _best_given(self, z: np.ndarray, weight: np.ndarray, known: np.ndarray) -> np.ndarray:
        ratio = np.linspace(-1 - 2 * MARGIN, 1 + 2 * MARGIN, GRID[1][0])
        theta = np.column_stack([ratio, np.tile(known, (ratio.size, 1))])
        rest = z - basis(theta, self.powers) @ self.coefficients
        return theta[np.argmin(rest**2 @ weight)].copy()

    def _gauss_newton(self, z, weight, theta, free):
        """theta and the curvature of half the chi-square by its free variables; steps are halved until it falls."""
        def misfit(at):
            return float(np.sum(weight * (z - basis(at, self.powers) @ self.coefficients) ** 2))
        best = misfit(theta)
        for _ in range(STEPS):
            slope = (basis_slopes(theta, self.powers) @ self.coefficients)[free]
            rest = z - basis(theta, self.powers) @ self.coefficients
            curvature = (slope * weight) @ slope.T
            step = np.zeros_like(theta)
            step[free] = np.linalg.lstsq(curvature, (slope * weight) @ rest, rcond=None)[0]
            length = 1.0
            while length > 1e-3 and misfit(theta + length * step) > best:
                length /= 2
            if length <= 1e-3 or np.abs(step).max() < 1e-7:
                break
            theta = np.clip(theta + length * step, -2.0, 2.0)
            best = misfit(theta)
        slope = (basis_slopes(theta, self.powers) @ self.coefficients)[free]
        return theta, (slope * weight) @ slope.T

    def to_dict(self) -> dict:
        return {name: np.asarray(value).tolist() for name, value in asdict(self).items()}

    @classmethod
    def from_dict(cls, data: dict) -> RatioPosterior:
        return cls(**{field.name: np.asarray(data[field.name], dtype=float) for field in fields(cls)})
