"""Functions on the plate's grid of rectangles: products of one along x and one along y.

Their values are products too, and their integrals over the plate are Kronecker products of integrals along its sides.
Along a line, a side of the plate or a rod, functions are piecewise polynomials.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.polynomial import polynomial

GAUSS_POINTS = 4  # in a cell: exact for a product of two cubics
# Polynomials on [0, 1], lowest power first. Hermite's cubics: value left, slope left, value right, slope right.
HERMITE = np.array([[1, 0, -3, 2], [0, 1, -2, 1], [0, 0, 3, -2], [0, 0, -1, 1]], float)
# Value left, value right, value in the middle (Lagrange).
PARABOLAS = np.array([[1, -3, 2], [0, -1, 2], [0, 4, -4]], float)
# Left hat, right hat, and what vanishes at both ends: a parabola, and a cubic that is odd about the middle.
CUBICS = np.array([[1, -1, 0, 0], [0, 1, 0, 0], [0, 1, -1, 0], [0, -1, 3, -2]], float)


@dataclass(frozen=True)
class Functions:
    """Functions on a line with grid lines `lines_m` (m,), ascending: on each cell the same k polynomials.

    `polynomials` (k, 4) are on [0, 1], lowest power first. `length_power` (k,) is the power of the cell's side by which
    each is multiplied. `number` (k, m - 1) is the number of the function to which each belongs in each cell. `groups`
    holds how many functions of a kind follow each other, and 1 or -1 if reversing the line leaves or turns their sign.
    """

    lines_m: np.ndarray
    polynomials: np.ndarray
    length_power: np.ndarray
    number: np.ndarray
    groups: tuple[tuple[int, int], ...]

    @property
    def size(self) -> int:
        return sum(count for count, _ in self.groups)

    def at(self, points_m: np.ndarray, derivative: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Return the numbers and the values (p, k) of the functions, derived so many times, that are not zero at points
        (p,). Beyond the ends the polynomials of the outermost cells go on."""
        cell = np.clip(np.searchsorted(self.lines_m, points_m, "right") - 1, 0, len(self.lines_m) - 2)
        side = self.lines_m[cell + 1] - self.lines_m[cell]
        derived = polynomial.polyder(self.polynomials, derivative, axis=1).T
        value = polynomial.polyval((points_m - self.lines_m[cell]) / side, derived)
        return self.number[:, cell].T, (value * side ** (self.length_power[:, None] - float(derivative))).T

    def mirrored(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the number and the sign (size,) of the image of each function, the line being reversed."""
        starts = np.cumsum([0, *(count for count, _ in self.groups)])
        image = [start + np.arange(count)[::-1] for start, (count, _) in zip(starts, self.groups, strict=False)]
        return np.concatenate(image), np.concatenate([np.full(count, sign) for count, sign in self.groups])


def smooth_cubics(lines_m: np.ndarray) -> Functions:
    """Return the cubics with continuous slope: m that are one at a grid line, then m whose slope is one there."""
    m = len(lines_m)
    left = np.arange(m - 1)
    return Functions(lines_m, HERMITE, np.array([0, 1, 0, 1]), np.stack([left, m + left, left + 1, m + left + 1]),
                     ((m, 1), (m, -1)))


def parabolas(lines_m: np.ndarray) -> Functions:
    """Return the continuous parabolas: m that are one at a grid line, then m - 1 that are one in the middle of a cell.

    Each is zero at all the other grid lines and middles.
    """
    m = len(lines_m)
    left = np.arange(m - 1)
    return Functions(lines_m, PARABOLAS, np.zeros(3, int), np.stack([left, left + 1, m + left]), ((m, 1), (m - 1, 1)))


def cubics(lines_m: np.ndarray) -> Functions:
    """Return the continuous cubics: m hats that are one at a grid line, then m - 1 parabolas and m - 1 odd cubics, each
    zero beyond its cell."""
    m = len(lines_m)
    left = np.arange(m - 1)
    return Functions(lines_m, CUBICS, np.zeros(4, int), np.stack([left, left + 1, m + left, 2 * m - 1 + left]),
                     ((m, 1), (m - 1, 1), (m - 1, -1)))


def line_integral(one: Functions, other: Functions, of_one: int = 0, of_other: int = 0) -> sp.csr_array:
    """Return the integrals (one.size, other.size) along the line, sparse, of each function of one times each of other,
    derived so many times. What is zero but for rounding is left out."""
    at, weight = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    side = np.diff(one.lines_m)
    points = (one.lines_m[:-1, None] + np.outer(side, (at + 1) / 2)).ravel()
    root = np.sqrt(np.outer(side, weight / 2)).ravel()
    rows, columns = (_weighted(functions, points, root, derivative)
                     for functions, derivative in ((one, of_one), (other, of_other)))
    entries = sp.coo_array(rows.T @ columns)
    length = [np.sqrt(matrix.power(2).sum(axis=0)) for matrix in (rows, columns)]  # bounds the entries (Schwarz)
    kept = abs(entries.data) > 1e-14 * length[0][entries.row] * length[1][entries.col]
    return sp.csr_array((entries.data[kept], (entries.row[kept], entries.col[kept])), shape=entries.shape)


def _weighted(functions: Functions, points_m: np.ndarray, weight: np.ndarray, derivative: int) -> sp.csr_array:
    """Return the sparse matrix (p, size) of weighted values at points (p,)."""
    number, value = functions.at(points_m, derivative)
    rows = np.repeat(np.arange(len(points_m)), number.shape[1])
    weighted = weight[:, None] * value
    return sp.csr_array((weighted.ravel(), (rows, number.ravel())), shape=(len(points_m), functions.size))


@dataclass(frozen=True)
class Products:
    """Each function along x times each along y; `number` (along_x.size, along_y.size) is that of their product."""

    along_x: Functions
    along_y: Functions
    number: np.ndarray

    @property
    def size(self) -> int:
        return self.number.size

    @property
    def integrals(self) -> np.ndarray:
        """(size,): the integral of each function over the plate."""
        along = [line_integral(one, parabolas(one.lines_m)).sum(axis=1) for one in (self.along_x, self.along_y)]
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
    return Products(smooth_cubics(lines_x_m), smooth_cubics(lines_y_m), number)


def rotations(lines_x_m: np.ndarray, lines_y_m: np.ndarray) -> Products:
    """Return the continuous bicubics."""
    along_x, along_y = (cubics(lines) for lines in (lines_x_m, lines_y_m))
    return Products(along_x, along_y, np.arange(along_x.size * along_y.size).reshape(along_x.size, along_y.size))


def integral(
    one: Products, other: Products, of_one: tuple[int, int] = (0, 0), of_other: tuple[int, int] = (0, 0)
) -> sp.csr_array:
    """Return the integrals (one.size, other.size) over the plate, sparse, of each function of one times each of other.

    They are derived as often by x and by y as `of_one` and `of_other` say.
    """
    along_x = line_integral(one.along_x, other.along_x, of_one[0], of_other[0])
    along_y = line_integral(one.along_y, other.along_y, of_one[1], of_other[1])
    product = sp.kron(along_x, along_y, format="coo")
    rows, columns = one.number.ravel()[product.row], other.number.ravel()[product.col]
    return sp.csr_array((product.data, (rows, columns)), shape=(one.size, other.size))
