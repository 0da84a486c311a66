"""Finite elements along a line, a side of the plate or a rod: piecewise polynomials, their values and integrals."""

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


def integral(one: Functions, other: Functions, of_one: int = 0, of_other: int = 0) -> sp.csr_array:
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
