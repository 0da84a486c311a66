"""Measures for what the paper says in words: rises, disorderly, stratified, single-peaked, volatile.

ratios: mixing ratio of each run, shape (runs,). values: one number a run, shape (runs,). curves: shape (runs, moments).
"""

from __future__ import annotations

import numpy as np
from scipy.stats import rankdata, spearmanr

#: A trend needs at least so many ratios.
LEAST_TREND = 4


def spearman(ratios: np.ndarray, values: np.ndarray) -> float:
    """Return Spearman's rank correlation of values with the ratio, -1..1; 0 where all values are equal."""
    if np.ptp(values) == 0:
        return 0.0
    return float(spearmanr(ratios, values).statistic)


def falling_steps(ratios: np.ndarray, values: np.ndarray) -> list[tuple[float, float]]:
    """Return the pairs of neighbouring ratios between which the values fall."""
    return [(float(ratios[i]), float(ratios[i + 1])) for i in np.flatnonzero(np.diff(values) < 0)]


def stratification(ratios: np.ndarray, curves: np.ndarray) -> float:
    """Return the mean over the moments of |Spearman| between ratio and value: 1 for curves that never cross.

    Moments at which all curves agree (before the impact) do not count. The order may turn over with time, as it must
    for a vibration.
    """
    alive = np.ptp(curves, axis=0) > 1e-12 * np.ptp(curves)
    ranks = rankdata(curves[:, alive], axis=0)
    ranks = ranks - ranks.mean(axis=0)
    r = rankdata(ratios) - np.mean(rankdata(ratios))
    return float(np.mean(np.abs(r @ ranks) / np.sqrt((r @ r) * np.sum(ranks**2, axis=0))))


def overlap(curves: np.ndarray) -> float:
    """Return the share of neighbouring curves, over all moments, that lie against the order of most at that moment."""
    alive = np.ptp(curves, axis=0) > 1e-12 * np.ptp(curves)
    rising = np.mean(np.diff(curves[:, alive], axis=0) > 0, axis=0)
    return float(np.mean(np.minimum(rising, 1 - rising)))


def separation(curves: np.ndarray) -> float:
    """Return the mean over the moments of the spread of the curves, divided by the whole range of values."""
    return float(np.mean(np.ptp(curves, axis=0)) / np.ptp(curves))


def travel(curve: np.ndarray) -> float:
    """Return the way of a curve up and down over twice its range: at most 1 for a single peak, n for n equal ones.

    curve: shape (moments,).
    """
    return float(np.sum(np.abs(np.diff(curve))) / (2 * np.ptp(curve)))


def fluctuation(signal: np.ndarray) -> float:
    """Return the RMS of the change from sample to sample over the signal's standard deviation, shape (samples,)."""
    return float(np.sqrt(np.mean(np.diff(signal) ** 2)) / np.std(signal))
