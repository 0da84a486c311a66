"""The bicubic Hermite deflection from its values at the nodes: evaluation, integral."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from plate_fem.elements import products


def interpolation(
    lines_x_m: np.ndarray, lines_y_m: np.ndarray, points_m: np.ndarray, derivative: tuple[int, int] = (0, 0)
) -> sp.csr_array:
    """Return the sparse matrix (k, 4 * n_nodes) that evaluates the deflection, or a derivative of it, at points (k, 2).

    `derivative` holds the orders in x and y. The matrix acts on nodal values in the blocks w, w_x, w_y, w_xy, each in
    the order of the nodes. Beyond the edge the cubic of the outermost cell goes on.
    """
    return products.deflections(lines_x_m, lines_y_m).values(points_m, derivative)


def integration(lines_x_m: np.ndarray, lines_y_m: np.ndarray) -> np.ndarray:
    """Return weights (4, n_nodes) whose sum with the nodal values w, w_x, w_y, w_xy is the integral of w."""
    weights = []
    for lines in (lines_x_m, lines_y_m):
        h = np.diff(lines)
        value = np.convolve(h, [0.5, 0.5])
        slope = np.convolve(h**2, [-1 / 12, 1 / 12])
        weights.append((value, -slope))
    (x0, x1), (y0, y1) = weights
    return np.array([np.outer(x, y).ravel() for x, y in ((x0, y0), (x1, y0), (x0, y1), (x1, y1))])
