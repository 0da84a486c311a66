"""Impulses of the stones that are told of a volley: each number of stones, of gangue among them, and each speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.stone_forces.forces import StoneForces
from recognition.volley.moments import REACHES
from recognition.volley.responses import Stones

#: Impulse of a stone of a volley in m v, of coal and of gangue, where stones fall as near as on the paper's circle and
#: anywhere: `python -m lab run volley_shares`, of ten stones at 3 m/s in the families `ring` and `free` of
#: scenes/dataset.toml. Alone a stone pushes up to 7 % more: here others move the plate away from it, the more the
#: nearer they are.
NEAR_SHARE, FAR_SHARE = np.array([1.749, 1.708]), np.array([1.805, 1.768])
SPEEDS = 11  # between the lowest and the highest
WRONG_SPEED = 0.05  # relative, as which an answer is tried for other speeds
ROOM = 1.15  # of the total impulse beside all that is tried


@dataclass(frozen=True)
class Hypotheses:
    """number, gangue, speed_m_s, prior (n,): each number of stones and of gangue among them, each speed, and their
    probability beforehand: numbers are alike, and so are the counts of gangue of each. total, squares (reaches, n):
    total impulse, N s, and sum of its squares."""

    number: Floats
    gangue: Floats
    speed_m_s: Floats
    prior: Floats
    total: Floats
    squares: Floats

    @classmethod
    def of(cls, stones: Stones, forces: StoneForces) -> Hypotheses:
        fewest, most = stones.counts
        low, high = stones.speeds_m_s
        rows = np.array([(number, gangue, speed, 1 / (number + 1)) for number in range(fewest, most + 1)
                         for gangue in range(number + 1)
                         for speed in np.linspace(low, high, SPEEDS if high > low else 1)])
        number, gangue, speed, prior = rows.T
        mass = 4 / 3 * np.pi * stones.radius_m**3 * forces.density_kg_m3
        far = (np.array(REACHES) - REACHES[0]) / (REACHES[-1] - REACHES[0])
        impulse = (NEAR_SHARE + far[:, None] * (FAR_SHARE - NEAR_SHARE)) * mass  # by reach and material, per m/s
        of_each = np.stack([number - gangue, gangue])
        return cls(number, gangue, speed, prior / prior.sum(), impulse @ of_each * speed,
                   impulse**2 @ of_each * speed**2)

    def share(self, weight: Floats) -> Floats:
        """(n,): of gangue, where stones of coal and of gangue weigh `weight` (2,)."""
        gangue = self.gangue * weight[1]
        return np.asarray(gangue / (gangue + (self.number - self.gangue) * weight[0]))

    @property
    def reached(self) -> tuple[Floats, Floats]:
        """(reaches,) each: the least and the largest total impulse, and half of what one stone of gangue in the place
        of one of coal makes."""
        low, high = self.total.min(axis=1), self.total.max(axis=1)
        half = 0.5 * (high - low) / self.number.max()
        return low - half, high + half

    @property
    def ranges(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Between which total impulses and effective numbers of stones all of them lie, and some room."""
        number = self.total**2 / self.squares
        return ((float(self.total.min()) / ROOM, float(self.total.max()) * ROOM),
                (float(number.min()), float(number.max())))


def widened(stones: Stones) -> Stones:
    """With one stone fewer and more and speeds by WRONG_SPEED lower and higher than are told."""
    fewest, most = stones.counts
    low, high = stones.speeds_m_s
    return Stones((max(1, fewest - 1), most + 1), stones.radius_m, (low * (1 - WRONG_SPEED), high * (1 + WRONG_SPEED)))
