"""What is known of a stone before it is heard, and the material that follows from its fit.

Radius and speed are uniform between limits (all stones of one size or speed: equal limits). Duration, breaking and
impulse of a stone of given material, radius and speed are those of `StoneForces`, whole or broken. A fit uses a wide
Gaussian over all of them in their place, so that one fit serves both materials.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.innovations.bank import BREAKING, DURATION, IMPULSE
from recognition.stone_forces.forces import MATERIALS, StoneForces

NODES = 12  # of radius and of speed
WIDER = 2.0  # the covariance of the wide Gaussian, by that of all that there is
TRIPLE = [DURATION, BREAKING, IMPULSE]  # of a stone's parameters


@dataclass(frozen=True)
class StonePrior:
    """The law of the stones' forces, and limits of radius and speed."""

    forces: StoneForces
    radius_m: tuple[float, float]
    speed_m_s: tuple[float, float]

    @cached_property
    def grid(self) -> Floats:
        """(nodes, 2): radii and speeds, all equally likely."""
        axes = [np.array([a]) if a == b else a + (b - a) * (np.arange(NODES) + 0.5) / NODES
                for a, b in (self.radius_m, self.speed_m_s)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)

    @cached_property
    def means(self) -> Floats:
        """(material, nodes, 3): mean of log s, b and log J of whole stones."""
        return np.array([self.forces.mean(m, *self.grid.T) for m in range(len(MATERIALS))])

    @cached_property
    def _laws(self) -> tuple[Floats, Floats, Floats]:
        """Of whole and of broken stones: log share (material, nodes, 2), means (material, nodes, 2, 3), and covariance
        about them (material, nodes, 2, 3, 3), also by the distance of the nodes of the grid."""
        law, share, means, scatter = self.forces, [], [], []
        for m in range(len(MATERIALS)):
            broken = law.share_at(m, self.grid[:, 1])
            share.append(np.stack([1 - broken, broken], axis=-1))
            both = (self.means[m], law.broken_mean(m, *self.grid.T))
            means.append(np.stack(both, axis=1))
            scatter.append(np.stack([covariance + _between(mean, self.grid) for covariance, mean
                                     in zip((law.scatter[m], law.broken_scatter), both, strict=True)], axis=1))
        with np.errstate(divide="ignore"):  # where none breaks
            return np.log(share), np.array(means), np.array(scatter)

    @cached_property
    def typical(self) -> Floats:
        """(3,): mean of log s, b and log J of all stones."""
        log_share, means, _ = self._laws
        return np.asarray((np.exp(log_share)[..., None] * means).sum(axis=2).mean(axis=(0, 1)))

    @cached_property
    def precision(self) -> Floats:
        """(3, 3): of the wide Gaussian about `typical`."""
        log_share, means, scatter = self._laws
        off = means - self.typical
        every = np.exp(log_share)[..., None, None] * (off[..., :, None] * off[..., None, :] + scatter)
        return np.asarray(np.linalg.inv(WIDER * every.sum(axis=2).mean(axis=(0, 1))))

    @cached_property
    def _log_determinant(self) -> float:
        return float(np.linalg.slogdet(self.precision)[1])

    def gaussian(self, stones: Floats) -> tuple[float, Floats]:
        """Minus the log of the wide Gaussian at stones (k, 6), and its slopes (k, 3)."""
        off = stones[:, TRIPLE] - self.typical
        slopes = off @ self.precision
        return 0.5 * (float(np.sum(off * slopes)) - len(stones) * self._log_determinant), slopes

    @cached_property
    def _inner(self) -> tuple[Floats, Floats, Floats]:
        """Precision (material, nodes, 2, 3, 3) about the means, that times the means, and what of the evidence does not
        depend on the stone (material, nodes, 2)."""
        log_share, means, scatter = self._laws
        inner = np.asarray(np.linalg.inv(scatter), dtype=float)
        from_means = (inner @ means[..., None])[..., 0]
        constant = np.linalg.slogdet(inner)[1] - np.sum(means * from_means, axis=-1)
        return inner, from_means, 0.5 * constant + log_share

    def evidence(self, estimate: Floats, covariance: Floats) -> tuple[Floats, Floats, Floats]:
        """Logarithm of the factor (materials,) by which the true prior of a material changes the evidence of a fit made
        with the wide one, the weights of the grid (materials, nodes), and by how much more than such stones do it
        seems to have broken (materials,): the probability that it broke less that of a stone at its speed.

        estimate (3,), covariance (3, 3): of log s, b and log J with the wide prior. The likelihood alone is the
        quotient of that Gaussian and the wide prior.
        """
        posterior = np.linalg.inv(covariance)
        likelihood = posterior - self.precision  # singular at worst, never below zero but for rounding
        information = posterior @ estimate - self.precision @ self.typical
        inner, from_means, constant = self._inner
        total, linear = likelihood + inner, information + from_means
        log_law = constant + 0.5 * (np.sum(linear * np.linalg.solve(total, linear[..., None])[..., 0], axis=-1)
                                    - np.linalg.slogdet(total)[1])
        log_node = np.logaddexp(log_law[..., 0], log_law[..., 1])  # of whole and of broken
        log_wide = 0.5 * ((posterior @ estimate) @ estimate - (self.precision @ self.typical) @ self.typical
                          + self._log_determinant - np.linalg.slogdet(posterior)[1])
        top = log_node.max(axis=1)
        weight = np.exp(log_node - top[:, None])
        relative = weight / weight.sum(axis=1, keepdims=True)
        broke = np.exp(log_law[..., 1] - log_node) - np.exp(self._laws[0][..., 1])
        return top + np.log(weight.mean(axis=1)) - log_wide, relative, np.sum(relative * broke, axis=1)


def _between(mean: Floats, grid: Floats) -> Floats:
    """(nodes, 3, 3): covariance of the means within a cell of the grid, each axis uniform."""
    total = np.zeros((len(mean), 3, 3))
    for axis in (0, 1):
        values = np.unique(grid[:, axis])
        if len(values) > 1:
            step = values[1] - values[0]
            along = mean.reshape(*(len(np.unique(grid[:, k])) for k in (0, 1)), 3)
            slope = np.gradient(along, step, axis=axis).reshape(-1, 3) * step
            total += np.einsum("ni,nj->nij", slope, slope) / 12
    return total
