"""How fast the stones of one record fall: a law that is told by all of them, and what it tells of each.

Stones that fall from one height are as fast as each other, and impulse and duration of one stone alone do not tell a
fast coal stone from a slow one of gangue: log J - 3 log s = log rho + 1.6 log v + const, whatever its radius. So the
speeds are taken to be normal, with mean and standard deviation unknown between the limits that are told, and but for
the share OTHERWISE of stones that bounced or slid, whose speeds are uniform.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from recognition.estimation.arrays import Floats
from recognition.stream.listen import Heard
from recognition.stream.prior import StonePrior

OTHERWISE = 0.1
MEANS, SPREADS, SHARES = 25, 6, 21  # nodes of mean, standard deviation and share of gangue


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

    log_evidence (stones, 2, speeds): of coal and gangue at equally spaced speeds. All means and shares of gangue are
    equally likely beforehand, standard deviations in their logarithm, from that of one step of the speeds to that of
    all of them.
    """
    laws = _laws(speed_m_s)
    top = log_evidence.max(axis=(1, 2), keepdims=True)
    coal, gangue = np.moveaxis(np.exp(log_evidence - top) @ laws.T, 1, 0)  # (stones, laws)
    share = (np.arange(SHARES) + 0.5)[:, None, None] / SHARES
    log_posterior = logsumexp(np.log((1 - share) * coal + share * gangue).sum(axis=1), axis=0)
    weight = np.exp(log_posterior - log_posterior.max())
    return np.asarray(weight @ laws / weight.sum())


def _laws(speed_m_s: Floats) -> Floats:
    """(laws, speeds): probabilities of the speeds by each mean and standard deviation."""
    step, span = speed_m_s[1] - speed_m_s[0], speed_m_s[-1] - speed_m_s[0]
    mean = np.linspace(speed_m_s[0], speed_m_s[-1], MEANS)[:, None, None]
    spread = np.geomspace(step / np.sqrt(12), span, SPREADS)[None, :, None]
    normal = np.exp(-0.5 * ((speed_m_s - mean) / spread) ** 2).reshape(-1, len(speed_m_s))
    return np.asarray((1 - OTHERWISE) * normal / normal.sum(axis=1, keepdims=True) + OTHERWISE / len(speed_m_s))


def _by_speed(stone: Heard, speed_m_s: Floats) -> Floats:
    """(2, speeds): logarithm of the evidence of either material at each speed, with any radius."""
    weight = stone.weights.reshape(2, -1, len(speed_m_s)).sum(axis=1)  # the grid has the speeds last
    return np.asarray(stone.log_evidence[:, None] + np.log(np.maximum(weight, np.finfo(float).tiny)))


def _weighed(stone: Heard, relative: Floats) -> Heard:
    """A stone with nodes of its grid that are more likely by exp(relative) (nodes,) than they were."""
    weight = stone.weights * np.exp(relative)
    total = weight.sum(axis=1, keepdims=True)
    return replace(stone, log_evidence=stone.log_evidence + np.log(total[:, 0]), weights=weight / total)
