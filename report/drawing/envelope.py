"""Curves thinned to what a screen can show."""

from __future__ import annotations

import numpy as np


def envelope(t_s: np.ndarray, values: np.ndarray, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a curve thinned to about `points` points that keeps every extreme wide enough to be seen.

    t_s, values: shape (samples,). Of each of points/2 stretches the least and the largest value remain, in their order.
    """
    bins = points // 2
    if t_s.size <= points:
        return t_s, values
    edges = np.linspace(0, t_s.size, bins + 1).astype(int)
    low = np.array([a + int(np.argmin(values[a:b])) for a, b in zip(edges, edges[1:], strict=False)])
    high = np.array([a + int(np.argmax(values[a:b])) for a, b in zip(edges, edges[1:], strict=False)])
    chosen = np.unique(np.concatenate([[0], low, high, [t_s.size - 1]]))
    return t_s[chosen], values[chosen]
