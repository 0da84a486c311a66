"""Lowest modes of a sparse structure."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from scipy.sparse.linalg import SuperLU, splu

from common.tables import Refused
from plate_fem.elements.mesh import MODES_AT_MOST

BLOCK = 8  # vectors that factors solve for at once, in a third of the time that one after the other takes
CONVERGED = 1e-9  # residual of a mode over its 1/(omega^2 + shift); the error of omega^2 goes with its square


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
    """Return the `count` lowest omega^2, which must be all up to `limit`, and their mass-normalised vectors.

    They come from the largest 1/(omega^2 + shift), ascending, which factors of the stiffness give precisely.
    """
    mass = part.mass.tocsr()
    if len(part.number) < 2 * _vectors_for(count):
        inverse, vectors = scipy.linalg.eigh(mass.toarray(), (part.stiffness + part.shift * mass).toarray())
    else:
        inverse, vectors = _lanczos(part, mass, count + 1)
    if (inverse * (limit + part.shift) >= 1).sum() != count:
        raise RuntimeError(f"{count} modes lie below {limit**0.5 / 2 / np.pi:g} Hz, but the eigensolver found others")
    inverse, vectors = inverse[: -count - 1 : -1], vectors[:, : -count - 1 : -1]
    return 1 / inverse - part.shift, vectors / np.sqrt(np.einsum("ij,ij->j", vectors, mass @ vectors))


def _vectors_for(count: int) -> int:
    """About how many vectors it takes until so many modes have converged."""
    return int(2.3 * count) + 5 * BLOCK


def _lanczos(part: Part, mass: sp.csr_array, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the `count` largest 1/(omega^2 + shift), ascending, and their vectors (n, count), by block Lanczos with a
    basis that is kept orthonormal (Golub and Van Loan 2013, Matrix Computations, 10.3.6). Raises RuntimeError if they
    do not converge.
    """
    due, most = _vectors_for(count), len(part.number) - BLOCK
    basis = np.empty((len(part.number), 2 * due), order="F")
    projected = np.zeros((2 * due, 2 * due))  # the inverse on the basis, above the diagonal
    nothing, start = basis[:, :0], np.random.default_rng(1).standard_normal((len(part.number), BLOCK))
    block, heavy, _ = _orthonormal(start, mass @ start, mass, nothing, nothing)
    for old in range(0, min(2 * due, most) - BLOCK, BLOCK):
        end, last = old + BLOCK, slice(max(0, old - BLOCK), old + BLOCK)
        basis[:, old:end] = block
        block = part.inverse.solve(heavy)
        heavy = mass @ block
        projected[last, old:end] = basis[:, last].T @ heavy
        block, heavy, rest = _orthonormal(block, heavy, mass, basis[:, last], basis[:, :end])
        if end < due:
            continue
        found, combination = np.linalg.eigh(projected[:end, :end], UPLO="U")
        found, combination = found[-count:], combination[:, -count:]
        if (np.linalg.norm(rest @ combination[-BLOCK:], axis=0) <= CONVERGED * found).all():
            return found, basis[:, :end] @ combination
        due = int(1.05 * due)
    raise RuntimeError(f"{count} modes did not converge")


def _orthonormal(block: np.ndarray, heavy: np.ndarray, mass: sp.csr_array,
                 *bases: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vectors (n, k) that are orthonormal in the mass among themselves, after one basis after the other was
    taken out of them, and the matrix (k, k) by which they give what is left of `block`. `heavy`, which is returned in
    the middle, is mass @ block."""
    factors = np.eye(block.shape[1])
    for basis in bases:
        block = block - basis @ (basis.T @ heavy)
        heavy = mass @ block
        upper = np.linalg.cholesky(block.T @ heavy).T
        inverse = np.linalg.inv(upper)
        block, heavy, factors = block @ inverse, heavy @ inverse, upper @ factors
    return block, heavy, factors


def factor(matrix: sp.csc_array | sp.csr_array) -> SuperLU:
    """Return the sparse LU factors of a symmetric matrix, with its pivots on the diagonal."""
    symmetric = {"SymmetricMode": True}  # unrelaxed: to merge columns of elements would only add zeros
    return splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, relax=1, options=symmetric)
