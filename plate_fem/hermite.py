"""Evaluation of the bicubic Hermite (Bogner-Fox-Schmit) deflection on a rectangular grid."""

import numpy as np
import scipy.sparse as sp


def _cubics(s, h, order):
    """The four Hermite cubics of a cell of side h at s in [0, 1], differentiated `order` times in x.

    Order of the functions: value left, slope left, value right, slope right; result (4, k).
    """
    coefficients = np.array([[1, 0, -3, 2], [0, 1, -2, 1], [0, 0, 3, -2], [0, 0, -1, 1]], float)
    result = np.empty((4, len(s)))
    for i, c in enumerate(coefficients):
        scale = h if i % 2 else 1.0
        result[i] = np.polynomial.polynomial.polyval(s, np.polynomial.polynomial.polyder(c, order)) * scale
    return result / h**order


def interpolation(lines_x_m, lines_y_m, points_m, derivative=(0, 0)):
    """Matrix that evaluates the deflection, or a derivative of it, at points.

    points_m: (k, 2). derivative: orders in x and y. Returns a sparse (k, 4 * n_nodes) matrix acting on
    nodal values ordered [w, w_x, w_y, w_xy] blockwise (each block in node order). Points beyond the
    edge are extrapolated by the cubic of the cell at the edge.
    """
    points = np.atleast_2d(np.asarray(points_m, float))
    k, n_y = len(points), len(lines_y_m)
    cells, factors = [], []
    for axis, lines in enumerate((lines_x_m, lines_y_m)):
        cell = np.clip(np.searchsorted(lines, points[:, axis], "right") - 1, 0, len(lines) - 2)
        h = lines[cell + 1] - lines[cell]
        cells.append(cell)
        factors.append(_cubics((points[:, axis] - lines[cell]) / h, h, derivative[axis]))
    n_nodes = len(lines_x_m) * n_y
    columns, values = [], []
    for i in range(4):
        for j in range(4):
            node = (cells[0] + i // 2) * n_y + cells[1] + j // 2
            columns.append(node + n_nodes * (i % 2 + 2 * (j % 2)))
            values.append(factors[0][i] * factors[1][j])
    rows = np.tile(np.arange(k), 16)
    return sp.csr_array((np.concatenate(values), (rows, np.concatenate(columns))), shape=(k, 4 * n_nodes))


def integral(lines_x_m, lines_y_m, nodal):
    """Integral of the deflection over the plate; nodal (4, n_nodes, n), result (n,)."""
    weights = []
    for lines in (lines_x_m, lines_y_m):
        h = np.diff(lines)
        value, slope = np.zeros(len(lines)), np.zeros(len(lines))
        value[:-1] += h / 2
        value[1:] += h / 2
        slope[:-1] += h**2 / 12
        slope[1:] -= h**2 / 12
        weights.append((value, slope))
    (x0, x1), (y0, y1) = weights
    rows = [np.outer(x0, y0), np.outer(x1, y0), np.outer(x0, y1), np.outer(x1, y1)]
    return sum(row.ravel() @ block for row, block in zip(rows, nodal))
