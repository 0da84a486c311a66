"""Lowest modes of a sparse structure, how many there may be, and the static compliance of those left out.

The compliance is that of a few more modes (residual vectors). Far below its frequency a mode answers statically:
shape^2 / omega^2 times the force. The static deflection under a unit load at each given point, less what the kept modes
give, holds exactly what the modes left out would add. Made orthogonal (Ritz), these deflections are further modes that
move like the others (Dickens, Nakagawa and Wittbrodt 1997, Comput. Struct. 62:985).

A load may also be a unit displacement of a rod's foot. By Maxwell and Betti the deflection under it at a place is the
share of a force there that the rod bears. With these deflections among the modes, each rod bears its exact share of
a steady force anywhere on the plate. All feet lifted together lift the plate as a rigid body, which is then a motion of
the modes too: the force on the plate less that on the rods is its change of momentum, at any time.

In Kirchhoff's theory the load is a point force. In Mindlin's the deflection under a point force is infinite, and the
load acts on a disc. A plate under a point force at its top moves there by the indentation of a half-space, which
contact laws count, and by a remainder. For an infinite elastic layer, loaded with wavenumber k, the remainder is
U(k) = 2 (1 - nu^2) / (E k) * [(sinh x cosh x + x) / (sinh^2 x - x^2) - 1], x = k t. Beyond a cut-off k t of 0.4 to 1.6
a disc of radius 1.4 t gives a Mindlin plate the compliance of this integral within 16 % (nu = 0.3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, SuperLU, eigsh, splu

from common.scene.plate import FlexiblePlate
from common.tables import Refused
from plate_fem.elements.mesh import bending_wavenumber, choose_theory, highest_frequency_Hz
from plate_fem.elements.rods import disc_quadrature
from plate_fem.elements.system import PlateSystem

if TYPE_CHECKING:
    from plate_fem.solution.model import PlateModel

LOAD_RADIUS = 1.4  # times the thickness
MODES_AT_MOST = 600  # four times those of the default scene; 538 take 72 s and 2.8 GB (docs/plate.md)


@dataclass(frozen=True)
class Part:
    """A part of a structure that has nothing to do with the rest: stiffness and mass over its unknowns `number` (n,).

    `shift` is a small omega^2, which the singular stiffness of a free plate needs to be inverted.
    """

    number: np.ndarray
    stiffness: sp.csc_array
    mass: sp.csc_array
    shift: float

    @cached_property
    def inverse(self) -> SuperLU:
        """The factors of stiffness + shift mass."""
        return factor(self.stiffness + self.shift * self.mass)


def independent_parts(stiffness: sp.csc_array, mass: sp.csc_array, max_frequency_Hz: float) -> list[Part]:
    """Return the parts that neither stiffness nor mass connects."""
    shift = 1e-4 * (2 * np.pi * max_frequency_Hz) ** 2
    count, part = sp.csgraph.connected_components(stiffness + shift * mass, directed=False)
    numbers = [np.flatnonzero(part == k) for k in range(count)]
    return [Part(k, stiffness[k][:, k], mass[k][:, k], shift) for k in numbers]


def solve_static(parts: list[Part], load: np.ndarray) -> np.ndarray:
    """Return the response (n, k) to static loads (n, k), but for the shift."""
    response = np.empty_like(load)
    for part in parts:
        response[part.number] = part.inverse.solve(np.ascontiguousarray(load[part.number]))
    return response


def eigenmodes(parts: list[Part], max_frequency_Hz: float) -> tuple[np.ndarray, sp.csc_array]:
    """Return omega^2 (n,) in 1/s^2 and mass-normalised vectors (size, n) of all modes up to max_frequency_Hz.

    The vectors are sparse, since each moves one part alone.

    The number of modes of a part is that of the negative pivots of K - limit M (Sylvester's law of inertia). The modes
    come from shift-invert Lanczos about the small negative shift of the part.
    Raises RuntimeError if number and modes disagree, and Refused if there is none, or more than MODES_AT_MOST, which
    happens where rods are so soft that they have modes of their own.
    """
    limit = (2 * np.pi * max_frequency_Hz) ** 2
    counts = [_count_below(part, limit) for part in parts]
    count = sum(counts)
    if not count:
        raise Refused("max_frequency_Hz", max_frequency_Hz,
                      "no mode of plate and rods lies below it: it must be higher, or the plate rigid")
    if count > MODES_AT_MOST:
        raise Refused("max_frequency_Hz", max_frequency_Hz, f"{count} modes of plate and rods lie below it, the limit "
                      f"is {MODES_AT_MOST}: it must be lower, or the rods stiffer")
    size = sum(len(part.number) for part in parts)
    found = [(part.number, *_lowest(part, limit, n)) for part, n in zip(parts, counts, strict=True) if n]
    values = np.concatenate([of_part for _, of_part, _ in found])
    values[values < 1e-9 * limit] = 0.0  # rigid-body modes, zero but for rounding
    order = np.argsort(values, kind="stable")
    vectors = sp.hstack([_placed(of_part, number, size) for number, _, of_part in found], format="csc")
    return values[order], vectors[:, order]


def _placed(vectors: np.ndarray, number: np.ndarray, size: int) -> sp.csc_array:
    """Return columns (size, n) that have the numbers of vectors (k, n) at the rows `number` (k,)."""
    k, n = vectors.shape
    return sp.csc_array((vectors.T.ravel(), np.tile(number, n), k * np.arange(n + 1)), shape=(size, n))


def _count_below(part: Part, limit: float) -> int:
    return int((factor(part.stiffness - limit * part.mass).U.diagonal() < 0).sum())


def _lowest(part: Part, limit: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the `count` lowest omega^2, which must be all up to `limit`, and their mass-normalised vectors."""
    stiffness, mass, size, kept = part.stiffness, part.mass, len(part.number), int(1.6 * count) + 10
    if kept >= size:
        values, vectors = scipy.linalg.eigh(stiffness.toarray(), mass.toarray(), subset_by_index=[0, count])
    else:
        inverse = LinearOperator(stiffness.shape, part.inverse.solve, dtype=float)
        start = np.random.default_rng(1).standard_normal(size)
        values, vectors = eigsh(
            stiffness, count + 1, mass.tocsr(), sigma=-part.shift, OPinv=inverse, v0=start, ncv=kept, tol=1e-10
        )
    order = np.argsort(values)
    values, vectors = values[order], vectors[:, order]
    if not values[count - 1] <= limit < values[count]:
        raise RuntimeError(f"{count} modes lie below {limit**0.5 / 2 / np.pi:g} Hz, but the eigensolver found others")
    values, vectors = values[:count], vectors[:, :count]
    return values, vectors / np.sqrt(np.einsum("ij,ij->j", vectors, mass @ vectors))


def factor(matrix: sp.csc_array | sp.csr_array) -> SuperLU:
    """Return the sparse LU factors of a symmetric matrix, with its pivots on the diagonal."""
    symmetric = {"SymmetricMode": True}
    return splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=symmetric)


def residual_modes(model: PlateModel, kept: sp.csc_array, loads: sp.csr_array) -> tuple[np.ndarray, np.ndarray]:
    """Return omega^2 (m,) in 1/s^2 and vectors (n, m) of the residual modes for loads, sparse (k, n), with m <= k.

    `kept`, sparse (n, p), holds the mass-normalised modes of the model that are kept. A load at a point is a row of
    `load_rows` times model.expansion; the displacement of a rod's foot is a row of model.rod_force. Raises RuntimeError
    where a load has no response.
    """
    projected = loads.T.toarray() - model.mass @ (kept @ (loads @ kept).toarray().T)
    response = solve_static(model.parts, projected)
    response -= kept @ (kept.T @ (model.mass @ response))
    squares = np.einsum("ij,ij->j", response, model.mass @ response)
    if not (squares > 0).all():  # a number that is none, too
        raise RuntimeError("the static response to a load is nothing that can be told from rounding")
    response /= np.sqrt(squares)
    size, directions = np.linalg.eigh(response.T @ (model.mass @ response))
    independent = size > 1e-8  # loads at one place, or mirrored ones on a held edge, have one response
    basis = response @ (directions[:, independent] / np.sqrt(size[independent]))
    omega_squared, combination = scipy.linalg.eigh(basis.T @ (model.stiffness @ basis))
    return omega_squared, basis @ combination


def load_rows(system: PlateSystem, points_m: np.ndarray) -> sp.csr_array:
    """Return the sparse matrix (k, n) that gives the deflection under each load.

    In Kirchhoff's theory that is w at the point, in Mindlin's the mean of w over the part of a disc that lies on the
    plate.
    """
    if system.theory == "kirchhoff":
        return system.deflection(points_m)
    rows = [sp.csr_array((0, system.size))]
    for x, y in points_m:
        points, weights = disc_quadrature(x, y, LOAD_RADIUS * system.plate.thickness_m)
        inside = (points[:, 0] >= system.lines_x_m[0]) & (points[:, 0] <= system.lines_x_m[-1])
        inside &= (points[:, 1] >= system.lines_y_m[0]) & (points[:, 1] <= system.lines_y_m[-1])
        mean = sp.csr_array(weights[None, inside] / weights[inside].sum())
        rows.append(mean @ system.deflection(points[inside]))
    return sp.csr_array(sp.vstack(rows))


def refuse_too_many_modes(plate: FlexiblePlate, most: int) -> None:
    """Raises Refused where a plate has more modes than `most` for sure: more than Weyl's area k^2/(4 pi), the edges of
    which add some more. Raises ValueError for a table that leaves its frequency to a tolerance."""
    frequency_Hz = highest_frequency_Hz(plate)
    if least_modes(plate, frequency_Hz) <= most:
        return
    allowed_Hz = frequency_Hz
    while least_modes(plate, allowed_Hz) > 0.8 * most:  # the rest is left to edges and rods
        allowed_Hz *= 0.98
    more = f"more than {least_modes(plate, frequency_Hz):.0f} modes of so large a plate"
    raise Refused("max_frequency_Hz", frequency_Hz, f"{more} lie below it, the limit is {most}: must be "
                  f"at most about {allowed_Hz:.2g}, or the plate smaller or thicker")


def least_modes(plate: FlexiblePlate, frequency_Hz: float) -> float:
    """Weyl's law without its term for the edges: area k^2/(4 pi), k the wavenumber of bending waves."""
    wavenumber = bending_wavenumber(plate, frequency_Hz, choose_theory(plate))
    return plate.length_m * plate.width_m * wavenumber**2 / (4 * math.pi)
