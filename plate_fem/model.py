"""The whole structure: plate, rods and supports, reduced to its free unknowns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from common.plate import FlexiblePlate
from plate_fem import rods
from plate_fem.mesh import highest_frequency_Hz
from plate_fem.system import PlateSystem, assemble


@dataclass(frozen=True)
class PlateModel:
    """Stiffness and mass over the n free unknowns.

    `expansion`, sparse (system.size, n), gives the unknowns of the plate from the free ones. `rod_force`, sparse
    (n_rods, n), gives the axial force (N, tension positive) at the base of each rod.
    """

    system: PlateSystem
    stiffness: sp.csc_array
    mass: sp.csc_array
    expansion: sp.csr_array
    rod_force: sp.csr_array

    def deflection(self, points_m: np.ndarray) -> sp.csr_array:
        """Return the sparse matrix (k, n) that gives the deflection at points (k, 2)."""
        return self.system.deflection(points_m) @ self.expansion


def build_model(plate: FlexiblePlate) -> PlateModel:
    """Assemble plate, rods and supports. Raises Refused for a mesh that is too large."""
    system = assemble(plate)
    attached = [rods.attach(system, rod, highest_frequency_Hz(plate)) for rod in plate.rods]
    parts = [bar for bar, _ in attached] + [part for _, others in attached for part in others]
    ties = _place([part.tie() for part in parts], system.size)
    size = ties[-1].shape[1] if ties else system.size
    stiffness, mass = _grow(system.stiffness, size), _grow(system.mass, size)
    for part, tie in zip(parts, ties, strict=True):
        stiffness = stiffness + tie.T @ part.stiffness @ tie
        mass = mass + tie.T @ part.mass @ tie
    forces = [rods.base_force_row(bar) @ tie for (bar, _), tie in zip(attached, ties, strict=False)]
    rod_force = sp.vstack(forces) if forces else sp.csr_array((0, size))
    free = _free(system, size)
    return PlateModel(
        system,
        sp.csc_array(free.T @ stiffness @ free),
        sp.csc_array(free.T @ mass @ free),
        sp.csr_array(free[: system.size]),
        sp.csr_array(rod_force @ free),
    )


def _grow(matrix: sp.csr_array, size: int) -> sp.csr_array:
    """Append rows and columns of zeros to a square matrix."""
    rows = sp.coo_array(matrix)
    return sp.csr_array((rows.data, (rows.row, rows.col)), shape=(size, size))


def _place(ties: list[sp.csr_array], plate_size: int) -> list[sp.csr_array]:
    """Give each tie (n_local, plate + own) its own columns after those of the plate and of earlier ties."""
    size = plate_size + sum(tie.shape[1] - plate_size for tie in ties)
    placed, start = [], plate_size
    for tie in ties:
        entries = sp.coo_array(tie)
        own = entries.col >= plate_size
        columns = np.where(own, entries.col - plate_size + start, entries.col)
        placed.append(sp.csr_array((entries.data, (entries.row, columns)), shape=(tie.shape[0], size)))
        start += tie.shape[1] - plate_size
    return placed


def _free(system: PlateSystem, size: int) -> sp.csr_array:
    """Return the sparse matrix (size, n) that gives all unknowns from the free ones, as edges and supports demand."""
    keep = np.setdiff1d(np.arange(size), system.fixed)
    edges = sp.eye_array(size, format="csr")[:, keep]
    constraint = (_support_rows(system) @ edges[: system.size]).toarray()
    constraint = constraint[abs(constraint).max(axis=1, initial=0) > 0]  # a support on a held edge adds nothing
    if not len(constraint):
        return edges
    return edges @ _null_space(constraint)


def _support_rows(system: PlateSystem) -> sp.csr_array:
    """Return the sparse matrix (n_supports, system.size) of the deflections that point supports hold at zero.

    A shear-flexible plate does not feel a support at a mathematical point, since its deflection under a point force is
    infinite. There the support holds the mean over a disc as wide as the plate is thick.
    """
    plate, rows = system.plate, [sp.csr_array((0, system.size))]
    for support in plate.point_supports:
        points, weights = np.array([[support.x_m, support.y_m]]), np.ones(1)
        if system.theory == "mindlin":
            points, weights = rods.disc_quadrature(support.x_m, support.y_m, plate.thickness_m / 2)
            inside = (abs(points[:, 0]) <= plate.length_m / 2) & (abs(points[:, 1]) <= plate.width_m / 2)
            points, weights = points[inside], weights[inside] / weights[inside].sum()
        rows.append(sp.csr_array(weights[None, :]) @ system.deflection(points))
    return sp.csr_array(sp.vstack(rows))


def _null_space(constraint: np.ndarray) -> sp.csr_array:
    """Return a sparse basis of {u: constraint @ u = 0}, in which each constraint eliminates one well-placed unknown."""
    touched = np.flatnonzero(abs(constraint).max(axis=0))
    _, _, order = scipy.linalg.qr(constraint[:, touched], mode="economic", pivoting=True)
    slave = touched[order[: len(constraint)]]
    keep = np.setdiff1d(np.arange(constraint.shape[1]), slave)
    basis = sp.lil_array((constraint.shape[1], len(keep)))
    basis[keep, np.arange(len(keep))] = 1.0
    basis[slave, :] = -np.linalg.solve(constraint[:, slave], constraint[:, keep])
    return sp.csr_array(basis)
