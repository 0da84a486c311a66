"""Lowest modes of a sparse structure."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, SuperLU, eigsh, splu

from common.tables import Refused

MODES_AT_MOST = 400  # three times those of the default scene; finding more takes minutes and gigabytes


def eigenmodes(
    stiffness: sp.csc_array, mass: sp.csc_array, max_frequency_Hz: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return omega^2 (n,) in 1/s^2 and mass-normalised vectors (size, n) of all modes up to max_frequency_Hz.

    The number of modes is that of the negative pivots of K - limit M (Sylvester's law of inertia). The modes come from
    shift-invert Lanczos about a small negative shift, which the singular stiffness of a free plate does not disturb.
    Raises RuntimeError if number and modes disagree, and Refused if there are more modes than MODES_AT_MOST, which
    happens where rods are so soft that they have modes of their own.
    """
    limit = (2 * np.pi * max_frequency_Hz) ** 2
    count = int((factor(stiffness - limit * mass).U.diagonal() < 0).sum())
    if count == 0:
        return np.empty(0), np.empty((stiffness.shape[0], 0))
    if count > MODES_AT_MOST:
        raise Refused("max_frequency_Hz", max_frequency_Hz, f"{count} modes of plate and rods lie below it, the limit "
                      f"is {MODES_AT_MOST}: it must be lower, or the rods stiffer")
    shift = -1e-4 * limit
    inverse = LinearOperator(stiffness.shape, factor(stiffness - shift * mass).solve, dtype=float)
    start = np.random.default_rng(1).standard_normal(stiffness.shape[0])
    values, vectors = eigsh(
        stiffness, count + 1, mass, sigma=shift, OPinv=inverse, v0=start, ncv=2 * count + 20, tol=1e-12
    )
    order = np.argsort(values)
    values, vectors = values[order], vectors[:, order]
    if not values[count - 1] <= limit < values[count]:
        raise RuntimeError(f"{count} modes lie below {max_frequency_Hz:g} Hz, but the eigensolver found others")
    values, vectors = values[:count], vectors[:, :count]
    values[values < 1e-9 * limit] = 0.0  # rigid-body modes, zero but for rounding
    return values, vectors / np.sqrt(np.einsum("ij,ij->j", vectors, mass @ vectors))


def factor(matrix: sp.csc_array | sp.csr_array) -> SuperLU:
    """Return the sparse LU factors of a symmetric matrix, with its pivots on the diagonal."""
    symmetric = {"SymmetricMode": True}
    return splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=symmetric)
