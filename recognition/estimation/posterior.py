"""Draws from a posterior with several modes: each is climbed from many starts, t distributions about them are then
drawn from by importance, and made alike to the posterior in some rounds."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.special import gammaln, logsumexp

from recognition.estimation.arrays import Floats

STEPS, SLOPE_STEP = 25, 1e-4
DRAWS, ROUNDS, ENOUGH = 1500, 16, 300  # rounds end when the weights are worth ENOUGH draws
FLATTER = 0.8 ** np.arange(40)  # powers of weights
FREEDOM = 6.0
WIDER = 1.5  # covariance of the first t distributions, by that at their modes
FORGOTTEN = 30.0  # of the log evidence: modes that are less likely by so much
#: (k, d) to the logarithm of each datum's density (k, n), and of the prior (k,) but for a constant.
Densities = Callable[[Floats], tuple[Floats, Floats]]


def drawn(densities: Densities, starts: Floats, prior_curvature: Floats, count: int,
          rng: np.random.Generator) -> tuple[Floats, float]:
    """(count, d): draws, each as likely as the others, and how many independent ones the last weights are worth.

    starts (k, d); prior_curvature (d, d): about that of minus the log prior."""
    modes, covariances, height = climbed(densities, starts, prior_curvature)
    mixture = Mixture.of(modes, covariances, height)
    for round_ in range(ROUNDS):
        z = mixture.draw(DRAWS, rng)
        each, prior = densities(z)
        log_weight = each.sum(axis=1) + prior - logsumexp(mixture.log_parts(z), axis=1)
        weight = _normal(log_weight)
        worth = _worth(weight)
        if worth > ENOUGH and round_:
            break
        # A few heavy ones tell no covariance: the mixture follows as flat a power as is worth ENOUGH.
        flat = next((w for w in map(_normal, FLATTER[:, None] * log_weight) if _worth(w) > ENOUGH), weight)
        mixture = mixture.nearer(z, flat)
    chosen = np.searchsorted(np.cumsum(weight), (np.arange(count) + rng.random()) / count).clip(max=DRAWS - 1)
    return z[chosen], worth


def _normal(log_weight: Floats) -> Floats:
    return np.asarray(np.exp(log_weight - logsumexp(log_weight)))


def _worth(weight: Floats) -> float:
    return float(1 / np.sum(weight**2))


def climbed(densities: Densities, z: Floats, prior_curvature: Floats) -> tuple[Floats, Floats, Floats]:
    """Modes (k, d) from starts, covariances (k, d, d) there, and the log posterior (k,), by scoring: the curvature is
    the sum of products of the data's slopes, and that of the prior."""
    k, d = z.shape
    around = SLOPE_STEP * np.vstack([np.zeros(d), np.eye(d)])
    damping = np.full(k, 1e-2)
    for _ in range(STEPS):
        each, prior = (v.reshape(k, d + 1, -1) for v in densities((z[:, None] + around).reshape(-1, d)))
        now = each[:, 0].sum(axis=1) + prior[:, 0, 0]
        slopes = (each[:, 1:] - each[:, :1]) / SLOPE_STEP
        gradient = slopes.sum(axis=2) + (prior[:, 1:, 0] - prior[:, :1, 0]) / SLOPE_STEP
        curvature = slopes @ slopes.swapaxes(1, 2) + prior_curvature
        damped = curvature + damping[:, None, None] * np.einsum("kii->ki", curvature)[:, :, None] * np.eye(d)
        trial = z + np.linalg.solve(damped, gradient[..., None])[..., 0].clip(-1, 1)
        each, prior = densities(trial)
        better = each.sum(axis=1) + prior > now
        z = np.where(better[:, None], trial, z)
        damping = np.where(better, damping / 5, damping * 8).clip(1e-4, 1e4)
    return z, np.asarray(np.linalg.inv(curvature), float), np.asarray(now)


@dataclass(frozen=True)
class Mixture:
    """Of t distributions: log shares (m,), centres (m, d), roots (m, d, d) of their matrices."""

    log_share: Floats
    centre: Floats
    root: Floats

    @classmethod
    def of(cls, modes: Floats, covariances: Floats, height: Floats) -> Self:
        """Of modes, by Laplace's evidence under the square root: none is forgotten that is nearly as likely."""
        root = np.linalg.cholesky(WIDER * covariances)
        evidence = height + np.log(np.einsum("mii->mi", root)).sum(axis=1)
        kept = evidence > evidence.max() - FORGOTTEN
        log_share = 0.5 * evidence[kept]
        return cls(log_share - logsumexp(log_share), modes[kept], root[kept])

    def draw(self, count: int, rng: np.random.Generator) -> Floats:
        """(count, d)"""
        which = rng.choice(len(self.centre), count, p=np.exp(self.log_share))
        normal = rng.standard_normal((count, self.centre.shape[1]))
        scale = np.sqrt(FREEDOM / rng.chisquare(FREEDOM, count))
        return np.asarray(self.centre[which] + scale[:, None] * np.einsum("kij,kj->ki", self.root[which], normal))

    def log_parts(self, z: Floats) -> Floats:
        """Logarithms (k, m) of the density of each part, by its share."""
        d = z.shape[1]
        off = np.linalg.solve(self.root, (z[None] - self.centre[:, None]).swapaxes(1, 2))
        constant = gammaln((FREEDOM + d) / 2) - gammaln(FREEDOM / 2) - d / 2 * np.log(FREEDOM * np.pi)
        widths = np.log(np.einsum("mii->mi", self.root)).sum(axis=1)
        size = np.sum(off**2, axis=1).T
        return np.asarray(self.log_share + constant - widths - (FREEDOM + d) / 2 * np.log1p(size / FREEDOM))

    def nearer(self, z: Floats, weight: Floats) -> "Mixture":
        """Nearer to what weighted draws are of; a part of few draws stays as wide as it was."""
        parts = self.log_parts(z)
        own = np.exp(parts - logsumexp(parts, axis=1, keepdims=True)) * weight[:, None]
        total = own.sum(axis=0)
        share = 0.9 * total + 0.1 / len(total)
        centre, root = self.centre.copy(), self.root.copy()
        for m in np.flatnonzero(total > 1e-3):
            w = own[:, m] / total[m]
            if 1 / np.sum(w**2) > 3 * z.shape[1]:
                centre[m] = w @ z
                off = z - centre[m]
                root[m] = np.linalg.cholesky((off.T * w) @ off + 1e-9 * np.eye(z.shape[1]))
        return Mixture(np.log(share / share.sum()), centre, root)
