"""Lowest modes of a sparse structure."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, SuperLU, eigsh, splu

from common.tables import Refused
from plate_fem.elements.mesh import MODES_AT_MOST


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
    numbers = [np.flatnonzero(part == k).astype(np.int32) for k in range(count)]
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
    return values[order], _ordered(found, order, size)


def _ordered(found: list[tuple[np.ndarray, np.ndarray, np.ndarray]], order: np.ndarray, size: int) -> sp.csc_array:
    """Return as columns (size, n), in `order` (n,), the vectors (k, m) of all parts, with the rows (k,) and omega^2 of
    each. They are taken out of `found` one by one, as they fill much of the memory."""
    lengths = np.concatenate([np.full(vectors.shape[1], len(number)) for number, _, vectors in found])
    start = np.append(0, np.cumsum(lengths[order])).astype(np.int32)
    place = np.empty(len(order), int)
    place[order] = start[:-1]  # of each vector as it was found
    data, row, done = np.empty(start[-1]), np.empty(start[-1], np.int32), 0
    while found:
        number, _, vectors = found.pop(0)
        for first, vector in zip(place[done:], vectors.T, strict=False):
            data[first : first + len(number)], row[first : first + len(number)] = vector, number
        done += vectors.shape[1]
    return sp.csc_array((data, row, start), shape=(size, len(order)))


def _count_below(part: Part, limit: float) -> int:
    return int((factor(part.stiffness - limit * part.mass).U.diagonal() < 0).sum())


def _lowest(part: Part, limit: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the `count` lowest omega^2, which must be all up to `limit`, and their mass-normalised vectors."""
    stiffness, mass, size, kept = part.stiffness, part.mass, len(part.number), int(1.6 * count) + 10
    if kept >= size:
        values, vectors = scipy.linalg.eigh(stiffness.toarray(), mass.toarray())
    else:
        inverse = LinearOperator(stiffness.shape, part.inverse.solve, dtype=float)
        start = np.random.default_rng(1).standard_normal(size)
        values, vectors = eigsh(
            stiffness, count + 1, mass.tocsr(), sigma=-part.shift, OPinv=inverse, v0=start, ncv=kept, tol=1e-10
        )
    order = np.argsort(values)
    values, vectors = values[order], vectors[:, order]
    if (values <= limit).sum() != count:
        raise RuntimeError(f"{count} modes lie below {limit**0.5 / 2 / np.pi:g} Hz, but the eigensolver found others")
    values, vectors = values[:count], vectors[:, :count]
    return values, vectors / np.sqrt(np.einsum("ij,ij->j", vectors, mass @ vectors))


def factor(matrix: sp.csc_array | sp.csr_array) -> SuperLU:
    """Return the sparse LU factors of a symmetric matrix, with its pivots on the diagonal."""
    symmetric = {"SymmetricMode": True}
    return splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=symmetric)
