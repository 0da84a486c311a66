"""Functions on the plate's grid of rectangles: products of one along x and one along y.

Their values are products too, and their integrals over the plate are Kronecker products of integrals along its sides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from plate_fem.elements import line


@dataclass(frozen=True)
class Products:
    """Each function along x times each along y; `number` (along_x.size, along_y.size) is that of their product."""

    along_x: line.Functions
    along_y: line.Functions
    number: np.ndarray

    @property
    def size(self) -> int:
        return self.number.size

    @property
    def integrals(self) -> np.ndarray:
        """(size,): the integral of each function over the plate."""
        along = [line.integral(one, line.parabolas(one.lines_m)).sum(axis=1) for one in (self.along_x, self.along_y)]
        found = np.empty(self.size)  # parabolas add up to one
        found[self.number] = np.outer(*along)
        return found

    def values(self, points_m: np.ndarray, derivative: tuple[int, int] = (0, 0)) -> sp.csr_array:
        """Return the sparse matrix (k, size) of the functions, or a derivative of them, at points (k, 2)."""
        points = np.atleast_2d(np.asarray(points_m, float))
        number_x, value_x = self.along_x.at(points[:, 0], derivative[0])
        number_y, value_y = self.along_y.at(points[:, 1], derivative[1])
        columns = self.number[number_x[:, :, None], number_y[:, None, :]]
        values = value_x[:, :, None] * value_y[:, None, :]
        start = np.arange(len(points) + 1) * (number_x.shape[1] * number_y.shape[1])
        return sp.csr_array((values.ravel(), columns.ravel(), start), shape=(len(points), self.size))


def nodes(lines_x_m: np.ndarray, lines_y_m: np.ndarray) -> np.ndarray:
    """Return the points (k, 2) where grid lines meet, those of the first line along y first."""
    return np.column_stack([v.ravel() for v in np.meshgrid(lines_x_m, lines_y_m, indexing="ij")])


def deflections(lines_x_m: np.ndarray, lines_y_m: np.ndarray) -> Products:
    """Return the bicubics with continuous slopes (Bogner-Fox-Schmit), numbered in the blocks w, w_x, w_y, w_xy at the
    nodes, each in the order of the nodes."""
    n_x, n_y = len(lines_x_m), len(lines_y_m)
    number = np.arange(4 * n_x * n_y).reshape(2, 2, n_x, n_y).transpose(1, 2, 0, 3).reshape(2 * n_x, 2 * n_y)
    return Products(line.smooth_cubics(lines_x_m), line.smooth_cubics(lines_y_m), number)


def rotations(lines_x_m: np.ndarray, lines_y_m: np.ndarray) -> Products:
    """Return the continuous bicubics."""
    along_x, along_y = (line.cubics(lines) for lines in (lines_x_m, lines_y_m))
    return Products(along_x, along_y, np.arange(along_x.size * along_y.size).reshape(along_x.size, along_y.size))


def integral(
    one: Products, other: Products, of_one: tuple[int, int] = (0, 0), of_other: tuple[int, int] = (0, 0)
) -> sp.csr_array:
    """Return the integrals (one.size, other.size) over the plate, sparse, of each function of one times each of other.

    They are derived as often by x and by y as `of_one` and `of_other` say.
    """
    along_x = line.integral(one.along_x, other.along_x, of_one[0], of_other[0])
    along_y = line.integral(one.along_y, other.along_y, of_one[1], of_other[1])
    product = sp.kron(along_x, along_y, format="coo")
    rows, columns = one.number.ravel()[product.row], other.number.ravel()[product.col]
    return sp.csr_array((product.data, (rows, columns)), shape=(one.size, other.size))
