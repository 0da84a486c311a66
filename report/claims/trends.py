"""Numbers behind the words of the paper: rises, disorderly, stratified, single-peaked, volatile."""

from __future__ import annotations

import numpy as np
from scipy.stats import rankdata, spearmanr


def spearman(ratios: np.ndarray, values: np.ndarray) -> float:
    """Rank correlation of values with the ratio, -1..1; 0 where all values are equal."""
    if np.ptp(values) == 0:
        return 0.0
    return float(spearmanr(ratios, values).statistic)


def falling_steps(ratios: np.ndarray, values: np.ndarray) -> list[tuple[float, float]]:
    """Pairs of neighbouring ratios between which the values fall."""
    return [(float(ratios[i]), float(ratios[i + 1])) for i in np.flatnonzero(np.diff(values) < 0)]


def stratification(ratios: np.ndarray, curves: np.ndarray) -> float:
    """Mean over the moments of |Spearman| between ratio and value: 1 for curves that never cross.

    curves: shape (n, K). Moments at which all curves agree (before the impact) do not count.
    The sign of the order may change with time, as it must for a vibration.
    """
    alive = np.ptp(curves, axis=0) > 1e-12 * np.ptp(curves)
    ranks = rankdata(curves[:, alive], axis=0)
    ranks = ranks - ranks.mean(axis=0)
    r = rankdata(ratios) - np.mean(rankdata(ratios))
    return float(np.mean(np.abs(r @ ranks) / np.sqrt((r @ r) * np.sum(ranks**2, axis=0))))


def overlap(curves: np.ndarray) -> float:
    """Share of (moment, neighbouring curves) that are out of the order most of them keep at that moment."""
    alive = np.ptp(curves, axis=0) > 1e-12 * np.ptp(curves)
    rising = np.mean(np.diff(curves[:, alive], axis=0) > 0, axis=0)
    return float(np.mean(np.minimum(rising, 1 - rising)))


def separation(curves: np.ndarray) -> float:
    """Mean over the moments of the spread between the curves, over the whole range of values."""
    return float(np.mean(np.ptp(curves, axis=0)) / np.ptp(curves))


def travel(curve: np.ndarray) -> float:
    """Total way up and down over twice the range: at most 1 for a single peak, n for n equal ones."""
    return float(np.sum(np.abs(np.diff(curve))) / (2 * np.ptp(curve)))


def fluctuation(signal: np.ndarray) -> float:
    """RMS of the change from sample to sample over the standard deviation of the signal."""
    return float(np.sqrt(np.mean(np.diff(signal) ** 2)) / np.std(signal))
