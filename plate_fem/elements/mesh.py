"""The mesh of the rectangular plate: functions on its grid, its lines, and what chooses theory and mesh size.

Functions are products of one along x and one along y. Their values are products too, and their integrals over the plate
are Kronecker products of integrals along its sides. Along a line, a side of the plate or a rod, functions are piecewise
polynomials.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.polynomial import polynomial
from scipy.interpolate import BSpline

from common.scene.plate import FlexiblePlate
from common.tables import Refused

DEGREE = 3  # of the splines along a side
# Polynomials on [0, 1], lowest power first. Hermite's cubics: value left, slope left, value right, slope right.
HERMITE = np.array([[1, 0, -3, 2], [0, 1, -2, 1], [0, 0, 3, -2], [0, 0, -1, 1]], float)
# Value left, value right, value in the middle (Lagrange).
PARABOLAS = np.array([[1, -3, 2], [0, -1, 2], [0, 4, -4]], float)


@dataclass(frozen=True)
class Functions:
    """Functions on a line with grid lines `lines_m` (m,), ascending: polynomials on each cell.

    `polynomials` (m - 1, k, powers) are those of the k functions that are not zero in a cell, on [0, 1], lowest power
    first, and `number` (m - 1, k) the numbers of these functions. `groups` holds how many functions of a kind follow
    each other, and 1 or -1 if reversing the line leaves or turns their sign.
    """

    lines_m: np.ndarray
    polynomials: np.ndarray
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
        derived = polynomial.polyder(self.polynomials, derivative, axis=2)[cell]
        power = ((points_m - self.lines_m[cell]) / side)[:, None] ** np.arange(derived.shape[2])
        return self.number[cell], np.einsum("pkd,pd->pk", derived, power) * side[:, None] ** -float(derivative)

    def mirrored(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the number and the sign (size,) of the image of each function, the line being reversed."""
        starts = np.cumsum([0, *(count for count, _ in self.groups)])
        image = [start + np.arange(count)[::-1] for start, (count, _) in zip(starts, self.groups, strict=False)]
        return np.concatenate(image), np.concatenate([np.full(count, sign) for count, sign in self.groups])


def smooth_cubics(lines_m: np.ndarray) -> Functions:
    """Return the cubics with continuous slope: m that are one at a grid line, then m whose slope is one there."""
    m, side = len(lines_m), np.diff(lines_m)
    left = np.arange(m - 1)
    scale = np.stack([np.ones(m - 1), side, np.ones(m - 1), side], axis=1)
    return Functions(lines_m, HERMITE * scale[:, :, None], np.stack([left, m + left, left + 1, m + left + 1], axis=1),
                     ((m, 1), (m, -1)))


def parabolas(lines_m: np.ndarray) -> Functions:
    """Return the continuous parabolas: m that are one at a grid line, then m - 1 that are one in the middle of a cell.

    Each is zero at all the other grid lines and middles.
    """
    m = len(lines_m)
    left = np.arange(m - 1)
    return Functions(lines_m, np.tile(PARABOLAS, (m - 1, 1, 1)), np.stack([left, left + 1, m + left], axis=1),
                     ((m, 1), (m - 1, 1)))


def splines(lines_m: np.ndarray, degree: int) -> Functions:
    """Return the B-splines of a degree with all derivatives but the highest continuous, but for the next one at lines
    that are there twice. The first and the last alone are not zero at the ends."""
    knots, lines = np.pad(lines_m, degree, mode="edge"), np.unique(lines_m)
    number = np.searchsorted(knots, lines[:-1], "right")[:, None] - 1 + np.arange(-degree, 1)
    size = len(lines_m) - 1 + degree
    basis = BSpline(knots, np.eye(size), degree)
    taylor = [np.take_along_axis(basis(lines[:-1], power), number, 1) / math.factorial(power)
              * np.diff(lines)[:, None] ** power for power in range(degree + 1)]
    return Functions(lines, np.stack(taylor, axis=2), number, ((size, 1),))


def line_integral(one: Functions, other: Functions, of_one: int = 0, of_other: int = 0) -> sp.csr_array:
    """Return the integrals (one.size, other.size) along the line, sparse, of each function of one times each of other,
    derived so many times. What is zero but for rounding is left out."""
    points, weight = gauss_points(one.lines_m, max(one.polynomials.shape[2], other.polynomials.shape[2]))
    rows, columns = (_weighted(functions, points, np.sqrt(weight), derivative)
                     for functions, derivative in ((one, of_one), (other, of_other)))
    entries = sp.coo_array(rows.T @ columns)
    length = [np.sqrt(matrix.power(2).sum(axis=0)) for matrix in (rows, columns)]  # bounds the entries (Schwarz)
    kept = abs(entries.data) > 1e-14 * length[0][entries.row] * length[1][entries.col]
    return sp.csr_array((entries.data[kept], (entries.row[kept], entries.col[kept])), shape=entries.shape)


def gauss_points(lines_m: np.ndarray, count: int = DEGREE + 1) -> tuple[np.ndarray, np.ndarray]:
    """Return points (k,) of a line, `count` in each cell, and their weights (k,), for integrals: exact for a product of
    two polynomials with so many powers."""
    at, weight = np.polynomial.legendre.leggauss(count)
    side = np.diff(lines_m)
    return (lines_m[:-1, None] + np.outer(side, (at + 1) / 2)).ravel(), np.outer(side, weight / 2).ravel()


def _weighted(functions: Functions, points_m: np.ndarray, weight: np.ndarray, derivative: int) -> sp.csr_array:
    """Return the sparse matrix (p, size) of weighted values at points (p,)."""
    number, value = functions.at(points_m, derivative)
    rows = np.repeat(np.arange(len(points_m)), number.shape[1])
    weighted = weight[:, None] * value
    return sp.csr_array((weighted.ravel(), (rows, number.ravel())), shape=(len(points_m), functions.size))


@dataclass(frozen=True)
class Products:
    """Each function along x times each along y; `number` (along_x.size, along_y.size) is that of their product, in 32
    bits, so that sparse matrices take a third less room."""

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
        start = np.arange(len(points) + 1, dtype=np.int32) * (number_x.shape[1] * number_y.shape[1])
        return sp.csr_array((values.ravel(), columns.ravel(), start), shape=(len(points), self.size))


def nodes(lines_x_m: np.ndarray, lines_y_m: np.ndarray) -> np.ndarray:
    """Return the points (k, 2) where grid lines meet, those of the first line along y first."""
    return np.column_stack([v.ravel() for v in np.meshgrid(lines_x_m, lines_y_m, indexing="ij")])


def bicubics(lines_x_m: np.ndarray, lines_y_m: np.ndarray) -> Products:
    """Return the bicubics with continuous slopes, numbered in the blocks w, w_x, w_y, w_xy at the nodes, each in the
    order of the nodes."""
    n_x, n_y = len(lines_x_m), len(lines_y_m)
    number = np.arange(4 * n_x * n_y, dtype=np.int32).reshape(2, 2, n_x, n_y).transpose(1, 2, 0, 3)
    return Products(smooth_cubics(lines_x_m), smooth_cubics(lines_y_m), number.reshape(2 * n_x, 2 * n_y))


def deflections(lines_x_m: np.ndarray, lines_y_m: np.ndarray) -> Products:
    """Return the splines of DEGREE along both sides."""
    return _products(splines(lines_x_m, DEGREE), splines(lines_y_m, DEGREE))


def rotations(lines_x_m: np.ndarray, lines_y_m: np.ndarray) -> tuple[Products, Products]:
    """Return the derivatives of deflections by x and by y: splines of a lower degree along that side."""
    return (_products(splines(lines_x_m, DEGREE - 1), splines(lines_y_m, DEGREE)),
            _products(splines(lines_x_m, DEGREE), splines(lines_y_m, DEGREE - 1)))


def _products(along_x: Functions, along_y: Functions) -> Products:
    number = np.arange(along_x.size * along_y.size, dtype=np.int32)
    return Products(along_x, along_y, number.reshape(along_x.size, along_y.size))


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


SHEAR_ERROR_ALLOWED = 0.005  # Kirchhoff's theory is used while its highest frequency is at most this much too high
MOST_CELLS, MOST_LINES = 20_000, 500  # these need some GB of memory
# Of a cell's side with the distance from a rod, whose radius is CELLS_PER_RADIUS cells. With 1.0 the motion of the top
# face between nodes near a thick rod is 2e-3 off, not 6e-4 (tests/dem/test_drag.py).
GROWTH = 0.5
CELLS_PER_RADIUS = 2
MODES_AT_MOST = 600  # four times those of the default scene; their shapes fill half a gigabyte
CELLS_PER_WAVELENGTH = 7  # modes kept within 1e-3


def shear_factor(poisson_ratio: float) -> float:
    """Return the shear correction factor 5 / (6 - nu) of a plate (Stephen 1997, J. Sound Vib. 202:539)."""
    return 5.0 / (6.0 - poisson_ratio)


def bending_stiffness(plate: FlexiblePlate) -> float:
    """Return the bending stiffness D = E t^3 / (12 (1 - nu^2)), in N m."""
    return plate.youngs_modulus_Pa * plate.thickness_m**3 / (12 * (1 - plate.poisson_ratio**2))


def shear_stiffness(plate: FlexiblePlate) -> float:
    """Return the shear stiffness kappa G t, in N/m."""
    nu = plate.poisson_ratio
    return shear_factor(nu) * plate.youngs_modulus_Pa / (2 * (1 + nu)) * plate.thickness_m


def bending_wavenumber(plate: FlexiblePlate, frequency_Hz: float, theory: str) -> float:
    """Return the wavenumber k (1/m) of plane bending waves at `frequency_Hz`.

    Kirchhoff: D k^4 = m W. Mindlin: (D k^2 + S - J W) (S k^2 - m W) = S^2 k^2. Here W is omega^2, m the mass and
    J = m t^2 / 12 the rotary inertia per area, D the stiffness in bending and S that in shear.
    """
    m, d, w = plate.density_kg_m3 * plate.thickness_m, bending_stiffness(plate), (2 * math.pi * frequency_Hz) ** 2
    if theory == "kirchhoff":
        return (m * w / d) ** 0.25
    s, j = shear_stiffness(plate), m * plate.thickness_m**2 / 12
    b = d * m * w + j * w * s
    return math.sqrt((b + math.sqrt(b * b + 4 * d * s * m * w * (s - j * w))) / (2 * d * s))


def highest_frequency_Hz(plate: FlexiblePlate) -> float:
    """Return `max_frequency_Hz` of a plate. Raises Refused if its table leaves it to the stones, or a copy has none."""
    if plate.max_frequency_Hz is None or not 0 < plate.max_frequency_Hz < math.inf:
        raise Refused("max_frequency_Hz", plate.max_frequency_Hz, "must be above 0; dem.run.prepare finds it")
    return plate.max_frequency_Hz


def kirchhoff_error(plate: FlexiblePlate) -> float:
    """Return by how much, relatively, Kirchhoff's frequency of the highest mode kept is above Mindlin's.

    It is the first term of the expansion of the two dispersion relations in k t, k being Kirchhoff's wavenumber:
    (k t)^2 / 24 * (1 + 2 / (kappa (1 - nu))). The first part is rotary inertia, the second shear.
    """
    kt = bending_wavenumber(plate, highest_frequency_Hz(plate), "kirchhoff") * plate.thickness_m
    nu = plate.poisson_ratio
    return kt**2 / 24 * (1 + 2 / (shear_factor(nu) * (1 - nu)))


def choose_theory(plate: FlexiblePlate) -> str:
    """Return "kirchhoff" or "mindlin": what the table says, or what `kirchhoff_error` decides where it says "auto"."""
    if plate.theory != "auto":
        return plate.theory
    return "kirchhoff" if kirchhoff_error(plate) <= SHEAR_ERROR_ALLOWED else "mindlin"


def refuse_too_many_modes(plate: FlexiblePlate) -> None:
    """Raises Refused where a plate has more modes than MODES_AT_MOST for sure: more than Weyl's area k^2/(4 pi), to
    which the edges add some. Raises ValueError for a table that leaves its frequency to a tolerance."""
    frequency_Hz = highest_frequency_Hz(plate)
    if _least_modes(plate, frequency_Hz) <= MODES_AT_MOST:
        return
    allowed_Hz = frequency_Hz
    while _least_modes(plate, allowed_Hz) > 0.8 * MODES_AT_MOST:  # the rest is left to edges and rods
        allowed_Hz *= 0.98
    more = f"more than {_least_modes(plate, frequency_Hz):.0f} modes of so large a plate"
    raise Refused("max_frequency_Hz", frequency_Hz, f"{more} lie below it, the limit is {MODES_AT_MOST}: must be "
                  f"at most about {allowed_Hz:.2g}, or the plate smaller or thicker")


def _least_modes(plate: FlexiblePlate, frequency_Hz: float) -> float:
    """Weyl's law without its term for the edges: area k^2/(4 pi), k the wavenumber of bending waves."""
    wavenumber = bending_wavenumber(plate, frequency_Hz, choose_theory(plate))
    return math.prod(plate.size_m) * wavenumber**2 / (4 * math.pi)


def default_mesh_size(plate: FlexiblePlate) -> float:
    """Return a fixed fraction of the bending wavelength at `max_frequency_Hz`, at most a quarter of a side (m)."""
    theory = choose_theory(plate)
    wavenumber = bending_wavenumber(plate, highest_frequency_Hz(plate), theory)  # 0 where the frequency's square is
    wavelength = 2 * math.pi / wavenumber if wavenumber > 0 else math.inf
    return min(wavelength / CELLS_PER_WAVELENGTH, min(plate.size_m) / 4)


def mesh_lines(plate: FlexiblePlate) -> list[np.ndarray]:
    """Return the grid lines along x and y (m), ascending from edge to edge, twice where curvature jumps.

    By default a cell at a rod is half as wide as the rod's radius, and cells grow away from it. A table's `mesh_size_m`
    refines these cells in the same proportion.
    Raises Refused for more than MOST_CELLS cells or MOST_LINES lines, before any memory is taken.
    """
    key = "max_frequency_Hz" if plate.mesh_size_m is None else "mesh_size_m"
    default = default_mesh_size(plate)
    largest = default if plate.mesh_size_m is None else plate.mesh_size_m
    if not math.prod(plate.size_m) / largest**2 <= MOST_CELLS:
        allowed = f"must leave a mesh of at most {MOST_CELLS} cells; here a cell is {largest:.3g} m wide"
        raise Refused(key, getattr(plate, key), allowed)
    scale = largest / default
    lines = []
    for axis, side in enumerate(plate.size_m):
        # Curvature jumps at the sides and axes of ribs and about the discs of rods.
        kinks = [rib.at_m + part * rib.section_m[0] for rib in plate.ribs if rib.axis != axis
                 for part in (-0.5, 0, 0.5)]
        kinks += [rod.place_m[axis] + part * rod.diameter_m for rod in plate.rods for part in (-0.5, 0.5)]
        fixed = [-side / 2, side / 2, *kinks, *(rod.place_m[axis] for rod in plate.rods)]
        fine = [(rod.place_m[axis], rod.diameter_m / 2, scale) for rod in plate.rods]
        graded = _graded(_distinct(fixed, 1e-6 * side), largest, fine)
        twice = [line for line in graded[1:-1] if kinks and abs(line - np.array(kinks)).min() < 1e-6 * side]
        lines.append(np.sort(np.append(graded, twice)))
        if len(lines[-1]) > MOST_LINES:
            raise Refused("rods", f"{len(plate.rods)} rods", f"must leave at most {MOST_LINES} lines across the mesh")
    cells = math.prod(len(line) - 1 for line in lines)
    if cells > MOST_CELLS and plate.rods:
        k, rod = min(enumerate(plate.rods), key=lambda each: each[1].diameter_m)
        raise Refused(f"rods.{k}.diameter_m", rod.diameter_m, f"must leave a mesh of at most {MOST_CELLS} cells, fine "
                      f"at the rods; here it has {cells}")
    return lines


def _distinct(values: list[float], tolerance: float) -> np.ndarray:
    ascending = np.unique(values)
    return ascending[np.append(True, np.diff(ascending) > tolerance)]


def _graded(fixed: np.ndarray, largest: float, fine: list[tuple[float, float, float]]) -> np.ndarray:
    """Fill the gaps between fixed lines with cells no larger than `largest`, finer near rods."""

    def size(x: float) -> float:  # wanted cell size at x
        return min([largest] + [scale * max(r / CELLS_PER_RADIUS, GROWTH * (abs(x - c) - r)) for c, r, scale in fine])

    lines = [fixed[0]]
    for a, b in itertools.pairwise(fixed):
        x = np.linspace(a, b, 65)
        density = np.array([1 / size(v) for v in x])
        count = np.append(0, np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(x)))  # cells up to x
        n = min(max(1, math.ceil(count[-1] - 1e-9)), MOST_LINES)  # so many are refused, however many there would be
        lines.extend(np.interp(np.arange(1, n + 1) / n * count[-1], count, x))
    return np.array(lines)
