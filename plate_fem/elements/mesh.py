"""Mesh lines of the rectangular plate, and the criteria that choose theory and mesh size."""

from __future__ import annotations

import itertools
import math

import numpy as np

from common.scene.plate import FlexiblePlate
from common.tables import Refused

SHEAR_ERROR_ALLOWED = 0.005  # Kirchhoff's theory is used while its highest frequency is at most this much too high
MOST_CELLS, MOST_LINES = 20_000, 500  # these need some GB of memory
GROWTH = 0.7  # of a cell's side with the distance from a rod; 0.2 moves no mode of four plates by more than 2e-4
MODES_AT_MOST = 600  # four times those of the default scene; 538 take 72 s and 2.8 GB (docs/plate.md)
CELLS_PER_WAVELENGTH = {"kirchhoff": 5.6, "mindlin": 4.5}  # modes kept within 2e-3, docs/plate.md


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
    """Return `max_frequency_Hz` of a plate. Raises ValueError if its table leaves it to the stones."""
    if plate.max_frequency_Hz is None:
        raise ValueError("max_frequency_Hz is not known yet: see common.scene.error_laws.with_cut_off")
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
    return plate.length_m * plate.width_m * wavenumber**2 / (4 * math.pi)


def mesh_size(plate: FlexiblePlate) -> float:
    """Return the largest side of a cell (m): the table's `mesh_size_m`, or the default."""
    return default_mesh_size(plate) if plate.mesh_size_m is None else plate.mesh_size_m


def default_mesh_size(plate: FlexiblePlate) -> float:
    """Return a fixed fraction of the bending wavelength at `max_frequency_Hz`, at most a quarter of a side (m)."""
    theory = choose_theory(plate)
    wavenumber = bending_wavenumber(plate, highest_frequency_Hz(plate), theory)  # 0 where the frequency's square is
    wavelength = 2 * math.pi / wavenumber if wavenumber > 0 else math.inf
    return min(wavelength / CELLS_PER_WAVELENGTH[theory], plate.length_m / 4, plate.width_m / 4)


def mesh_lines(plate: FlexiblePlate) -> list[np.ndarray]:
    """Return the grid lines along x and along y (m), ascending, from edge to edge.

    By default a cell at a rod is as wide as the rod's radius, and cells grow
    away from it. A table's `mesh_size_m` refines these cells in the same proportion.
    Raises Refused for more than MOST_CELLS cells or MOST_LINES lines, before any memory is taken.
    """
    key = "max_frequency_Hz" if plate.mesh_size_m is None else "mesh_size_m"
    largest = mesh_size(plate)
    if not plate.length_m * plate.width_m / largest**2 <= MOST_CELLS:
        allowed = f"must leave a mesh of at most {MOST_CELLS} cells; here a cell is {largest:.3g} m wide"
        raise Refused(key, getattr(plate, key), allowed)
    scale = largest / default_mesh_size(plate)
    lines = []
    for axis, side in enumerate((plate.length_m, plate.width_m)):
        fixed = [-side / 2, side / 2]
        fine = []
        for rod in plate.rods:
            centre, radius = rod.place_m[axis], rod.diameter_m / 2
            fixed += [centre - radius, centre, centre + radius]
            fine.append((centre, radius, scale))
        lines.append(_graded(_distinct(fixed, 1e-6 * side), largest, fine))
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
        return min([largest] + [scale * max(r, GROWTH * (abs(x - c) - r)) for c, r, scale in fine])

    lines = [fixed[0]]
    for a, b in itertools.pairwise(fixed):
        x = np.linspace(a, b, 65)
        density = np.array([1 / size(v) for v in x])
        count = np.append(0, np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(x)))  # cells up to x
        n = max(1, math.ceil(count[-1] - 1e-9))
        lines.extend(np.interp(np.arange(1, n + 1) / n * count[-1], count, x))
    return np.array(lines)
