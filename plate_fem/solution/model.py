"""The whole structure: plate and rods, reduced to its free unknowns.

**Mirrors.** The modes of a structure that is its own mirror image are even or odd about the mirror plane. In a basis
of even and odd unknowns, stiffness and mass fall into blocks that have nothing to do with each other: two for one
mirror plane, four for two. Their modes are found one block after the other, exactly and at a fraction of the cost.

**Residual vectors** are the static compliance of the modes left out, as a few more modes. Far below its frequency a
mode answers statically: shape^2 / omega^2 times the force. The static deflection under a unit load at each given
point, less what the kept modes give, holds exactly what the modes left out would add. Made orthogonal (Ritz), these
deflections are further modes that move like the others (Dickens, Nakagawa and Wittbrodt 1997, Comput. Struct. 62:985).

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

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from common.scene.plate import FlexiblePlate
from plate_fem.elements import ribs, rods
from plate_fem.elements.mesh import Products, highest_frequency_Hz
from plate_fem.elements.rods import PARTS
from plate_fem.elements.system import PlateSystem, assemble, grown, one_after_the_other, without_rounding
from plate_fem.solution.eigen import Part, independent_parts, solve_static


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
    """Assemble plate, ribs and rods. Raises Refused for a mesh that is too large."""
    system, *both = assemble(plate)
    stiffness, mass = (one + more for one, more in zip(both, ribs.matrices(system), strict=True))
    parts = [part for rod in plate.rods for part in rods.attach(system, rod, highest_frequency_Hz(plate))]
    rod_force, size = sp.csr_array((0, system.size)), system.size
    if parts:
        tie, of_parts = rods.tie(parts), one_after_the_other([part.stiffness for part in parts])
        size = tie.shape[1]
        stiffness = grown(stiffness, size) + tie.T @ of_parts @ tie
        mass = grown(mass, size) + tie.T @ one_after_the_other([part.mass for part in parts]) @ tie
        start = np.cumsum([0, *(part.stiffness.shape[0] for part in parts)])
        bases = [first + bar.held[0] for first, bar in zip(start[:-1:PARTS], parts[::PARTS], strict=True)]
        rod_force = -of_parts[bases] @ tie  # axial, at the base, tension positive
    own = np.split(np.arange(system.size, size), np.cumsum([len(part.own) for part in parts])[:-1])
    blocks = [_free(system, basis) for basis in mirror_blocks(system, own, size)]
    expansion = sp.csr_array(sp.hstack([basis for _, basis in blocks]))
    return PlateModel(system, _in_blocks(stiffness, blocks), _in_blocks(mass, blocks),
                      sp.csr_array(expansion[: system.size]), sp.csr_array(rod_force @ expansion))


def _in_blocks(matrix: sp.csr_array, blocks: list[tuple[sp.csr_array, sp.csr_array]]) -> sp.csc_array:
    """Return a symmetric matrix (size, size) over the free unknowns: its blocks one after the other."""
    by_rows = one_after_the_other([without_rounding(rows @ matrix @ basis) for rows, basis in blocks])
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


LOAD_RADIUS = 1.4  # times the thickness


def residual_modes(model: PlateModel, kept: sp.csc_array, loads: sp.csr_array) -> tuple[np.ndarray, np.ndarray]:
    """Return omega^2 (m,) in 1/s^2 and vectors (n, m) of the residual modes for loads, sparse (k, n), with m <= k.

    `kept`, sparse (n, p), holds the mass-normalised modes of the model that are kept. A load at a point is a row of
    elements.rods.load_rows times model.expansion; the displacement of a rod's foot is a row of model.rod_force. Raises
    RuntimeError where a load has no response.
    """
    projected = loads.T.toarray()
    projected -= model.mass @ (kept @ (kept.T @ projected))
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


SAME = 1e-9  # lengths that differ by less than this share of a side are the same


def mirror_axes(plate: FlexiblePlate, lines: tuple[np.ndarray, np.ndarray]) -> list[int]:
    """Return the axes (0 for x, 1 for y) along which the plate, its ribs, rods and mesh lines may be reversed."""
    return [axis for axis in (0, 1) if abs(lines[axis] + lines[axis][::-1]).max() < SAME * _side_m(plate)
            and _partners(plate, axis) is not None and _ribs_mirrored(plate, axis)]


def _ribs_mirrored(plate: FlexiblePlate, axis: int) -> bool:
    """Return whether the ribs are their own mirror image."""
    turned = [rib for rib in plate.ribs if rib.axis != axis]
    return all(any(other.section_m == rib.section_m and abs(other.at_m + rib.at_m) < SAME * _side_m(plate)
                   for other in turned) for rib in turned)


def mirror_blocks(system: PlateSystem, own: list[np.ndarray], size: int) -> list[sp.csr_array]:
    """Return orthonormal bases (size, n_i) of the unknowns that are even or odd about each mirror plane.

    `own` holds the numbers of the unknowns that belong to each part of the rods alone, in the order bar, beam in xz,
    beam in yz, shaft of the first rod, then of the next. Without a mirror plane the only block is the identity.
    """
    mirrors = [_mirror(system, own, size, axis)
               for axis in mirror_axes(system.plate, (system.lines_x_m, system.lines_y_m))]
    return [_even_or_odd(mirrors, signs, size) for signs in itertools.product((1, -1), repeat=len(mirrors))]


def _side_m(plate: FlexiblePlate) -> float:
    return max(plate.size_m)


def _partners(plate: FlexiblePlate, axis: int) -> list[int] | None:
    """Return the number of the mirror image of each rod, or None if one has none."""
    partners = []
    for rod in plate.rods:
        mirrored = np.array(rod.place_m) * np.where(np.arange(2) == axis, -1, 1)
        found = [k for k, other in enumerate(plate.rods) if other.model_copy(update={"place_m": rod.place_m}) == rod
                 and np.hypot(*(mirrored - other.place_m)) < SAME * _side_m(plate)]
        if not found:
            return None
        partners.append(found[0])
    return partners


def _mirror(system: PlateSystem, own: list[np.ndarray], size: int, axis: int) -> sp.csr_array:
    """Return the matrix (size, size) that takes each unknown to its image: one entry of 1 or -1 in each row.

    Slopes, rotations, sway and beams along the axis change their sign; so do yaw and shafts.
    """
    image, sign = np.arange(size), np.ones(size, int)
    image[: system.deflections.size], sign[: system.deflections.size] = _mirrored(system.deflections, axis)
    inside = system.size - system.in_plane.size
    for pair, start in ((system.rotations, system.deflections.size), (system.in_plane.functions, inside)):
        for kind, functions in enumerate(pair or ()):  # a component along x, then one along y
            partner, odd = _mirrored(functions, axis)
            image[start : start + len(partner)] = start + partner
            sign[start : start + len(partner)] = -odd if kind == axis else odd
            start += len(partner)
    if system.in_plane.functions is None:
        sign[[inside + axis, inside + 2]] = -1
    for rod, other in enumerate(_partners(system.plate, axis) or []):
        for kind in range(PARTS):
            image[own[PARTS * rod + kind]] = own[PARTS * other + kind]
            sign[own[PARTS * rod + kind]] = -1 if kind in (axis + 1, 3) else 1
    return sp.csr_array((sign, (image, np.arange(size))), shape=(size, size))


def _mirrored(functions: Products, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the number and the sign (size,) of the image of each product, reversed along one axis."""
    along = (functions.along_x, functions.along_y)[axis]
    image, sign = along.mirrored()
    number, size = functions.number, functions.size
    images, signs = np.empty(size, int), np.empty(size, int)
    images[number.ravel()] = np.take(number, image, axis).ravel()
    signs[number.ravel()] = np.broadcast_to(sign[:, None] if axis == 0 else sign, number.shape).ravel()
    return images, signs


def _even_or_odd(mirrors: list[sp.csr_array], signs: tuple[int, ...], size: int) -> sp.csr_array:
    """Return the basis of what each mirror multiplies by its sign: one column for each group of images."""
    first = np.arange(size)  # smallest number among the images of each unknown
    projection = sp.eye_array(size, format="csr")
    for mirror, sign in zip(mirrors, signs, strict=True):
        projection = (projection + sign * (mirror @ projection)) / 2
        first = np.minimum(first, first[mirror.indices])
    columns = projection.tocsc()[:, np.flatnonzero(first == np.arange(size))]
    columns.eliminate_zeros()
    length = np.sqrt(columns.power(2).sum(axis=0))
    kept = length > 0.1
    return sp.csr_array(columns[:, kept] / length[kept])
