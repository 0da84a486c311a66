"""What is known of a stone before it is heard, and the material that follows from its fit.

Radius and speed are uniform between limits (all stones of one size or speed: equal limits). Duration and impulse of a
stone of given material, radius and speed are those of `StoneForces`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.stream.bank import DURATION, IMPULSE
from recognition.stream.forces import MATERIALS, StoneForces

NODES = 12  # of radius and of speed


@dataclass(frozen=True)
class StonePrior:
    """Limits of radius and speed, and the share of gangue that is expected."""

    forces: StoneForces
    radius_m: tuple[float, float]
    speed_m_s: tuple[float, float]
    gangue_ratio: float = 0.5

    @cached_property
    def grid(self) -> Floats:
        """(nodes, 2): radii and speeds, all equally likely."""
        axes = [np.array([a]) if a == b else a + (b - a) * (np.arange(NODES) + 0.5) / NODES
                for a, b in (self.radius_m, self.speed_m_s)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)

    @cached_property
    def means(self) -> Floats:
        """(material, nodes, 2): mean of log s and log J."""
        return np.array([self.forces.mean_log(m, *self.grid.T).T for m in range(len(MATERIALS))])

    @cached_property
    def _gaussians(self) -> list[tuple[Floats, Floats, float]]:
        """Mean, precision and its log determinant of (log s, log J) of each material, wider than the limits say."""
        spread = [np.atleast_2d(np.cov(mean.T, bias=True)) if len(mean) > 1 else np.zeros((2, 2))
                  for mean in self.means]
        precision = [np.linalg.inv(2 * cov + scatter) for cov, scatter in zip(spread, self.forces.scatter, strict=True)]
        return [(mean.mean(axis=0), p, float(np.linalg.slogdet(p)[1]))
                for mean, p in zip(self.means, precision, strict=True)]

    def typical(self, material: int) -> Floats:
        """(2,): mean of log s and log J."""
        return self._gaussians[material][0]

    def gaussian(self, material: int, stone: Floats) -> tuple[float, Floats, Floats]:
        """Minus the log of the wide Gaussian prior at a stone's log s and log J, its slope (2,), and precision."""
        mean, precision, log_determinant = self._gaussians[material]
        off = stone[[DURATION, IMPULSE]] - mean
        slope = precision @ off
        return 0.5 * (float(off @ slope) - log_determinant), slope, precision

    def evidence(self, material: int, estimate: Floats, covariance: Floats) -> tuple[float, Floats]:
        """Logarithm of the factor by which the true prior changes the evidence of a fit made with the wide one, and the
        weights of the grid (nodes,).

        estimate (2,), covariance (2, 2): of log s and log J with the wide prior. The likelihood alone is the quotient
        of that Gaussian and the wide prior.
        """
        wide_mean, wide, log_wide_precision = self._gaussians[material]
        posterior = np.linalg.inv(covariance)
        likelihood = posterior - wide  # precision; may be singular, never below zero but for rounding
        information = posterior @ estimate - wide @ wide_mean
        inner = np.linalg.inv(self.forces.scatter[material])
        means = self.means[material]
        total = likelihood + inner
        linear = information + means @ inner
        log_node = (0.5 * np.einsum("ni,ni->n", linear, np.linalg.solve(total, linear.T).T)
                    - 0.5 * np.einsum("ni,ij,nj->n", means, inner, means)
                    + 0.5 * np.linalg.slogdet(inner)[1] - 0.5 * np.linalg.slogdet(total)[1])
        log_wide = (0.5 * (posterior @ estimate) @ estimate - 0.5 * (wide @ wide_mean) @ wide_mean
                    + 0.5 * log_wide_precision - 0.5 * np.linalg.slogdet(posterior)[1])
        top = log_node.max()
        weight = np.exp(log_node - top)
        return float(top + np.log(weight.mean()) - log_wide), weight / weight.sum()
