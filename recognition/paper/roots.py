"""Inverse solution: the ratios beta at which fitted functions take given values."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from recognition.estimation.arrays import Floats, Integers

#: A root counts from -margin to 1 + margin: noise puts a record of pure coal a little
#: below 0 as often as above, and cutting there would bias the ends. Nothing is clipped.
ROOT_MARGIN = 0.05

_GRID = np.linspace(-ROOT_MARGIN, 1 + ROOT_MARGIN, 111)
_BISECTIONS = 40  # 0.01 of ratio halved 40 times: 1e-14


def real_roots(
    function: Callable[[Integers, Floats], Floats], values: Floats
) -> tuple[Integers, Floats]:
    """All real roots of f_k(beta) = values[k] in [-margin, 1 + margin], for every k at once.

    function(k, beta): elementwise value of function number k at beta. Returns (k, beta) of
    every root, both shape (r,), in order of k, then beta: none, one or several for each k.
    Roots are bracketed on a grid of 0.01 of ratio and bisected, so that any continuous form
    of fit will do; a pair of roots closer than the grid is no answer that one could use, and
    is passed over.
    """
    values = np.asarray(values, dtype=float)
    above = function(np.arange(values.size)[:, None], _GRID[None, :]) - values[:, None] >= 0
    k, cell = np.nonzero(above[:, 1:] != above[:, :-1])
    low, high, rising = _GRID[cell], _GRID[cell + 1], above[k, cell + 1]
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        root_is_below = (function(k, middle) - values[k] >= 0) == rising
        low, high = np.where(root_is_below, low, middle), np.where(root_is_below, middle, high)
    return k, 0.5 * (low + high)
