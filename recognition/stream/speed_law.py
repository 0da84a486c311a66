"""How fast the stones of one record fall: a law that is told by all of them, and what it tells of each.

Stones that fall from one height are as fast as each other, and impulse and duration of one stone alone do not tell a
fast coal stone from a slow one of gangue: log J - 3 log s = log rho + 1.6 log v + const, whatever its radius. There are
two cases. In one, the speeds are normal, with a mean that is unknown and a standard deviation of at most a tenth of the
middle of the limits, but for the share OTHERWISE of stones that bounced or slid, which have any speed between the
limits. In the other, all have any speed between the limits. The first is taken to be rare (ONE_FALL), so that stones of
any speed are not mistaken for it; forty stones of one speed show it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from recognition.estimation.arrays import Floats
from recognition.stream.listen import Heard
from recognition.stream.prior import StonePrior

ONE_FALL, OTHERWISE = 0.01, 0.1
WIDEST = 0.1  # standard deviation of the speeds of one fall, by the middle of the limits
MEANS, SPREADS, SHARES = 25, 4, 21  # nodes of mean, standard deviation and share of gangue


def with_speed_law(heard: Sequence[Heard], prior: StonePrior) -> list[Heard]:
    """The same stones, each with evidence and weights by the speeds of all."""
    speed = np.unique(prior.grid[:, 1])
    if len(speed) == 1 or not heard:
        return list(heard)
    law = speed_law(np.array([_by_speed(h, speed) for h in heard]), speed)
    relative = np.log(len(speed) * law)[np.searchsorted(speed, prior.grid[:, 1])]
    return [_weighed(h, relative) for h in heard]


def speed_law(log_evidence: Floats, speed_m_s: Floats) -> Floats:
    """(speeds,): how likely each speed is, the mean over all laws by their posterior probability.

    log_evidence (stones, 2, speeds): of coal and gangue at equally spaced speeds. Means and shares of gangue are
    equally likely beforehand, and so are the logarithms of standard deviations from that of one step of the speeds on.
    """
    laws = _laws(speed_m_s)
    likely = np.r_[np.full(len(laws) - 1, ONE_FALL / (len(laws) - 1)), 1 - ONE_FALL]
    top = log_evidence.max(axis=(1, 2), keepdims=True)
    coal, gangue = np.moveaxis(np.exp(log_evidence - top) @ laws.T, 1, 0)  # (stones, laws)
    shares = (np.arange(SHARES) + 0.5) / SHARES
    log_posterior = logsumexp([np.log((1 - p) * coal + p * gangue).sum(axis=0) for p in shares], axis=0)
    weight = likely * np.exp(log_posterior - log_posterior.max())
    return np.asarray(weight @ laws / weight.sum())


def _laws(speed_m_s: Floats) -> Floats:
    """(laws, speeds): probabilities of the speeds by each mean and standard deviation, and at last the uniform law."""
    step = speed_m_s[1] - speed_m_s[0]
    mean = np.linspace(speed_m_s[0], speed_m_s[-1], MEANS)[:, None, None]
    least = step / np.sqrt(12)
    spread = np.geomspace(least, max(least, WIDEST * speed_m_s.mean()), SPREADS)[None, :, None]
    normal = np.exp(-0.5 * ((speed_m_s - mean) / spread) ** 2).reshape(-1, len(speed_m_s))
    uniform = np.full((1, len(speed_m_s)), 1 / len(speed_m_s))
    fall = (1 - OTHERWISE) * normal / normal.sum(axis=1, keepdims=True) + OTHERWISE * uniform
    return np.asarray(np.vstack([fall, uniform]))


def _by_speed(stone: Heard, speed_m_s: Floats) -> Floats:
    """(2, speeds): logarithm of the evidence of either material at each speed, with any radius."""
    weight = stone.weights.reshape(2, -1, len(speed_m_s)).sum(axis=1)  # the grid has the speeds last
    return np.asarray(stone.log_evidence[:, None] + np.log(np.maximum(weight, np.finfo(float).tiny)))


def _weighed(stone: Heard, relative: Floats) -> Heard:
    """A stone with nodes of its grid that are more likely by exp(relative) (nodes,) than they were."""
    weight = stone.weights * np.exp(relative)
    total = weight.sum(axis=1, keepdims=True)
    return replace(stone, log_evidence=stone.log_evidence + np.log(total[:, 0]), weights=weight / total)
