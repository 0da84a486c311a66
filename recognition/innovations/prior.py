"""What is known of a stone before it is heard.

Radius and speed are uniform between limits (all stones of one size or speed: equal limits). Duration, breaking and
impulse of a stone of given material, radius and speed are those of `StoneForces`, whole or broken. A fit uses a wide
Gaussian over all of them in their place, so that one fit serves both materials and stones that differ.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.innovations.bank import BREAKING, DURATION, IMPULSE
from recognition.stone_forces.forces import MATERIALS, StoneForces

NODES = 12  # of radius and of speed
RADIUS_BEYOND, SPEED_BEYOND = 1.25, 1.15  # of the limits that are told
WIDER = 2.0  # the covariance of the wide Gaussian, by that of all that there is
TRIPLE = [DURATION, BREAKING, IMPULSE]  # of a stone's parameters


@dataclass(frozen=True)
class StonePrior:
    """The law of the stones' forces, and limits of radius and speed."""

    forces: StoneForces
    radius_m: tuple[float, float]
    speed_m_s: tuple[float, float]

    def widened(self) -> Self:
        """Between limits that are farther apart: stones that differ from what is told are heard as well."""
        (small, large), (slow, fast) = self.radius_m, self.speed_m_s
        return replace(self, radius_m=(small / RADIUS_BEYOND, large * RADIUS_BEYOND),
                       speed_m_s=(slow / SPEED_BEYOND, fast * SPEED_BEYOND))

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
    def _moments(self) -> tuple[Floats, Floats]:
        """Mean (3,) and covariance (3, 3) of log s, b and log J of all stones, whole and broken."""
        law, speed, parts = self.forces, self.grid[:, 1], []
        for m in range(len(MATERIALS)):
            broken = law.share_at(m, speed)
            parts += [(1 - broken, self.means[m], law.scatter[m]),
                      (broken, law.broken_mean(m, *self.grid.T), law.broken_scatter)]
        share = np.array([one for one, _, _ in parts]) / len(MATERIALS) / len(speed)
        mean = np.einsum("pn,pni->i", share, [one for _, one, _ in parts])
        off = np.array([one - mean for _, one, _ in parts])
        scatter = np.einsum("pn,pij->ij", share, [one for _, _, one in parts])
        return np.asarray(mean), np.asarray(np.einsum("pn,pni,pnj->ij", share, off, off) + scatter)

    @property
    def typical(self) -> Floats:
        """(3,): mean of log s, b and log J of all stones."""
        return self._moments[0]

    @cached_property
    def precision(self) -> Floats:
        """(3, 3): of the wide Gaussian about `typical`."""
        return np.asarray(np.linalg.inv(WIDER * self._moments[1]))

    @cached_property
    def _log_determinant(self) -> float:
        return float(np.linalg.slogdet(self.precision)[1])

    def gaussian(self, stones: Floats) -> tuple[float, Floats]:
        """Minus the log of the wide Gaussian at stones (k, 6), and its slopes (k, 3)."""
        off = stones[:, TRIPLE] - self.typical
        slopes = off @ self.precision
        return 0.5 * (float(np.sum(off * slopes)) - len(stones) * self._log_determinant), slopes
