"""The bicubic Hermite (Bogner-Fox-Schmit) deflection on a rectangular grid: evaluation, integral."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

# Polynomials on [0, 1], lowest power first: value left, slope left, value right, slope right.
CUBICS = np.array([[1, 0, -3, 2], [0, 1, -2, 1], [0, 0, 3, -2], [0, 0, -1, 1]], float)


def cubic(number: int, s: np.ndarray, h: np.ndarray, order: int) -> np.ndarray:
    """Return Hermite cubic `number` (0..3) of a cell of side h (m) at s in [0, 1], derived `order` times by x."""
    coefficients = np.polynomial.polynomial.polyder(CUBICS[number], order)
    return np.polynomial.polynomial.polyval(s, coefficients) * h ** (number % 2 - order)


def interpolation(
    lines_x_m: np.ndarray, lines_y_m: np.ndarray, points_m: np.ndarray, derivative: tuple[int, int] = (0, 0)
) -> sp.csr_array:
    """Return the sparse matrix (k, 4 * n_nodes) that evaluates the deflection, or a derivative of it, at points (k, 2).

    `derivative` holds the orders in x and y. The matrix acts on nodal values in the blocks w, w_x, w_y, w_xy, each in
    the order of the nodes. Beyond the edge the cubic of the outermost cell goes on.
    """
    points = np.atleast_2d(np.asarray(points_m, float))
    k, n_y = len(points), len(lines_y_m)
    cells, factors = [], []
    for axis, lines in enumerate((lines_x_m, lines_y_m)):
        cell = np.clip(np.searchsorted(lines, points[:, axis], "right") - 1, 0, len(lines) - 2)
        h = lines[cell + 1] - lines[cell]
        cells.append(cell)
        s = (points[:, axis] - lines[cell]) / h
        factors.append([cubic(number, s, h, derivative[axis]) for number in range(4)])
    n_nodes = len(lines_x_m) * n_y
    columns, values = [], []
    for i in range(4):
        for j in range(4):
            node = (cells[0] + i // 2) * n_y + cells[1] + j // 2
            columns.append(node + n_nodes * (i % 2 + 2 * (j % 2)))
            values.append(factors[0][i] * factors[1][j])
    rows = np.tile(np.arange(k), 16)
    return sp.csr_array((np.concatenate(values), (rows, np.concatenate(columns))), shape=(k, 4 * n_nodes))


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
