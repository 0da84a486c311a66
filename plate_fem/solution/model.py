"""The whole structure: plate and rods, reduced to its free unknowns."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from common.scene.plate import FlexiblePlate
from plate_fem.elements import rods
from plate_fem.elements.mesh import highest_frequency_Hz
from plate_fem.elements.system import PlateSystem, assemble, grown, without_rounding
from plate_fem.solution import mirror
from plate_fem.solution.eigen import Part, independent_parts


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

    @cached_property
    def parts(self) -> list[Part]:
        """The parts of the model that have nothing to do with each other; each keeps its factors once it has them."""
        return independent_parts(self.stiffness, self.mass, highest_frequency_Hz(self.system.plate))


def build_model(plate: FlexiblePlate) -> PlateModel:
    """Assemble plate and rods. Raises Refused for a mesh that is too large."""
    system, stiffness, mass = assemble(plate)
    parts = [part for rod in plate.rods for part in rods.attach(system, rod, highest_frequency_Hz(plate))]
    rod_force, size = sp.csr_array((0, system.size)), system.size
    if parts:
        tie, of_parts = rods.tie(parts), sp.block_diag([part.stiffness for part in parts], format="csr")
        size = tie.shape[1]
        stiffness = grown(stiffness, size) + tie.T @ of_parts @ tie
        mass = grown(mass, size) + tie.T @ sp.block_diag([part.mass for part in parts], format="csr") @ tie
        start = np.cumsum([0, *(part.stiffness.shape[0] for part in parts)])
        bases = [first + bar.held[0] for first, bar in zip(start[:-1:rods.PARTS], parts[::rods.PARTS], strict=True)]
        rod_force = -of_parts[bases] @ tie  # axial, at the base, tension positive
    own = np.split(np.arange(system.size, size), np.cumsum([len(part.own) for part in parts])[:-1])
    blocks = [_free(system, basis) for basis in mirror.blocks(system, own, size)]
    expansion = sp.csr_array(sp.hstack([basis for _, basis in blocks]))
    return PlateModel(system, _in_blocks(stiffness, blocks), _in_blocks(mass, blocks),
                      sp.csr_array(expansion[: system.size]), sp.csr_array(rod_force @ expansion))


def _in_blocks(matrix: sp.csr_array, blocks: list[tuple[sp.csr_array, sp.csr_array]]) -> sp.csc_array:
    """Return a symmetric matrix (size, size) over the free unknowns: its blocks one after the other."""
    by_rows = sp.block_diag([without_rounding(rows @ matrix @ basis) for rows, basis in blocks], format="csr")
    narrow = (by_rows.data, by_rows.indices.astype(np.int32), by_rows.indptr.astype(np.int32))  # a third less room
    return sp.csc_array(narrow, shape=by_rows.shape)  # symmetric, so that its rows are its columns


def _free(system: PlateSystem, basis: sp.csr_array) -> tuple[sp.csr_array, sp.csr_array]:
    """Return a basis (size, n) of what edges leave free of a basis (size, m) of all unknowns.

    Before it comes the matrix (n, size) that stands for the transposed basis where a matrix is reduced, with a fraction
    of its numbers: what mirrors leave as it is makes an even or odd vector of another, and one row of each group of
    images tells which.
    """
    held = np.zeros(basis.shape[0])
    held[system.fixed] = 1.0
    basis = basis[:, abs(basis).T @ held == 0]  # an edge holds each of an unknown's images or none
    return _one_image(basis), basis


def _one_image(basis: sp.csr_array) -> sp.csr_array:
    """Return the inverse (m, size) of a basis (size, m) of groups of images that takes one image of each group."""
    columns = basis.tocsc()
    first = columns.indptr[:-1]
    rows, entries = columns.indices[first], columns.data[first]
    return sp.csr_array((1 / entries, rows, np.arange(len(first) + 1)), shape=(len(first), basis.shape[0]))
