"""How fast the stones of one record fall: laws of their speeds, told by all of them, and what these tell of each.

Impulse and duration of one stone alone do not tell a fast coal stone from a slow one of gangue: log J - 3 log s =
log rho + 1.6 log v + const, whatever its radius. The law of the speeds, which coal and gangue have in common, does so
for many stones, and is unknown itself. There are two cases. In one, all fall from one height: the speeds are normal,
with a mean that is unknown and a standard deviation of at most a tenth of the middle of the limits, but for the share
OTHERWISE of stones that bounced or slid, which have any speed between the limits. In the other, the logarithm of the
density of speeds between the limits is a parabola: t x + c (x^2 - 1/3), with x from -1 to 1 between the limits, and
t and c normal with mean 0 and the standard deviations TILT and CURVE. The first case is taken to be rare (ONE_FALL),
so that stones of many speeds are not mistaken for it; forty stones of one speed show it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from recognition.estimation.arrays import Floats
from recognition.stream.listen import Heard
from recognition.stream.prior import StonePrior

ONE_FALL, OTHERWISE = 0.01, 0.1
WIDEST = 0.1  # standard deviation of the speeds of one fall, by the middle of the limits
TILT, CURVE = 1.0, 1.0  # a tilt of one makes the fastest seven times as frequent as the slowest
MEANS, SPREADS, SHARES = 25, 4, 21  # nodes of mean, standard deviation and share of gangue
TILTS, CURVES, FARTHEST = 11, 5, 2.5  # nodes of t and c, which reach so many standard deviations from zero
DRAWN = 16  # laws that stand for all, each as likely as the others


@dataclass(frozen=True)
class SpeedLaws:
    """All laws of speeds: density (laws, speeds) and probability (laws,)."""

    density: Floats
    probability: Floats

    @classmethod
    def before(cls, speed_m_s: Floats) -> SpeedLaws:
        """Those that there are before any stone is heard, at equally spaced speeds."""
        fall, many, likely = _of_one_fall(speed_m_s), *_of_many_speeds(len(speed_m_s))
        return cls(np.vstack([fall, many]), np.r_[np.full(len(fall), ONE_FALL / len(fall)), (1 - ONE_FALL) * likely])

    def after(self, log_evidence: Floats) -> SpeedLaws:
        """The same when stones were heard. log_evidence (stones, 2, speeds): of coal and gangue; all shares of gangue
        are equally likely."""
        top = log_evidence.max(axis=(1, 2), keepdims=True)
        coal, gangue = np.moveaxis(np.exp(log_evidence - top) @ self.density.T, 1, 0)  # (stones, laws)
        shares = (np.arange(SHARES) + 0.5) / SHARES
        log_posterior = logsumexp([np.log((1 - p) * coal + p * gangue).sum(axis=0) for p in shares], axis=0)
        weight = self.probability * np.exp(log_posterior - log_posterior.max())
        return replace(self, probability=weight / weight.sum())

    def mean(self) -> Floats:
        """(speeds,): the mean of all laws."""
        return np.asarray(self.probability @ self.density)

    def drawn(self) -> Floats:
        """(DRAWN, speeds): laws as frequent as they are likely."""
        at = np.searchsorted(np.cumsum(self.probability), (np.arange(DRAWN) + 0.5) / DRAWN)
        return np.asarray(self.density[np.minimum(at, len(self.density) - 1)])


def with_speed_laws(heard: Sequence[Heard], prior: StonePrior) -> tuple[list[Heard], Floats]:
    """The same stones, each with evidence and weights by the mean law of the speeds of all; and the logarithm of the
    odds of gangue by each of the laws drawn, (stones, DRAWN)."""
    speed = np.unique(prior.grid[:, 1])
    if len(speed) == 1 or not heard:
        return list(heard), np.array([h.log_evidence[1:] - h.log_evidence[:1] for h in heard]).reshape(len(heard), 1)
    evidence = np.array([_by_speed(h, speed) for h in heard])
    laws = SpeedLaws.before(speed).after(evidence)
    relative = np.log(len(speed) * laws.mean())[np.searchsorted(speed, prior.grid[:, 1])]
    coal, gangue = np.moveaxis(logsumexp(evidence[:, :, None, :], b=laws.drawn(), axis=-1), 1, 0)
    return [_weighed(h, relative) for h in heard], np.asarray(gangue - coal)


def _of_one_fall(speed_m_s: Floats) -> Floats:
    """(laws, speeds): one for each mean and standard deviation."""
    step = speed_m_s[1] - speed_m_s[0]
    mean = np.linspace(speed_m_s[0], speed_m_s[-1], MEANS)[:, None, None]
    least = step / np.sqrt(12)
    spread = np.geomspace(least, max(least, WIDEST * speed_m_s.mean()), SPREADS)[None, :, None]
    normal = np.exp(-0.5 * ((speed_m_s - mean) / spread) ** 2).reshape(-1, len(speed_m_s))
    return np.asarray((1 - OTHERWISE) * normal / normal.sum(axis=1, keepdims=True) + OTHERWISE / len(speed_m_s))


def _of_many_speeds(speeds: int) -> tuple[Floats, Floats]:
    """(laws, speeds): one for each t and c, and how likely it is, (laws,)."""
    x = (2 * np.arange(speeds) + 1) / speeds - 1
    t, c = (a.reshape(-1, 1) for a in np.meshgrid(FARTHEST * np.linspace(-1, 1, TILTS),
                                                  FARTHEST * np.linspace(-1, 1, CURVES), indexing="ij"))
    density = np.exp(TILT * t * x + CURVE * c * (x**2 - 1 / 3))
    likely = np.exp(-0.5 * (t**2 + c**2))[:, 0]
    return density / density.sum(axis=1, keepdims=True), likely / likely.sum()


def _by_speed(stone: Heard, speed_m_s: Floats) -> Floats:
    """(2, speeds): logarithm of the evidence of either material at each speed, with any radius."""
    weight = stone.weights.reshape(2, -1, len(speed_m_s)).sum(axis=1)  # the grid has the speeds last
    return np.asarray(stone.log_evidence[:, None] + np.log(np.maximum(weight, np.finfo(float).tiny)))


def _weighed(stone: Heard, relative: Floats) -> Heard:
    """A stone with nodes of its grid that are more likely by exp(relative) (nodes,) than they were."""
    weight = stone.weights * np.exp(relative)
    total = weight.sum(axis=1, keepdims=True)
    return replace(stone, log_evidence=stone.log_evidence + np.log(total[:, 0]), weights=weight / total)
