"""Mirror symmetry of a plate with its rods.

The modes of a structure that is its own mirror image are even or odd about the mirror plane. In a basis of even and odd
unknowns, stiffness and mass fall into blocks that have nothing to do with each other: two for one mirror plane, four
for two. Their modes are found one block after the other, exactly and at a fraction of the cost.
"""

from __future__ import annotations

import itertools

import numpy as np
import scipy.sparse as sp

from common.scene.plate import FlexiblePlate
from plate_fem.elements.products import Products
from plate_fem.elements.rods import PARTS
from plate_fem.elements.system import PlateSystem

SAME = 1e-9  # lengths that differ by less than this share of a side are the same


def mirror_axes(plate: FlexiblePlate, lines: tuple[np.ndarray, np.ndarray]) -> list[int]:
    """Return the axes (0 for x, 1 for y) along which the plate, its rods and mesh lines may be reversed."""
    return [axis for axis in (0, 1) if abs(lines[axis] + lines[axis][::-1]).max() < SAME * _side_m(plate)
            and _partners(plate, axis) is not None]


def blocks(system: PlateSystem, own: list[np.ndarray], size: int) -> list[sp.csr_array]:
    """Return orthonormal bases (size, n_i) of the unknowns that are even or odd about each mirror plane.

    `own` holds the numbers of the unknowns that belong to each part of the rods alone, in the order bar, beam in xz,
    beam in yz, shaft of the first rod, then of the next. Without a mirror plane the only block is the identity.
    """
    mirrors = [_mirror(system, own, size, axis)
               for axis in mirror_axes(system.plate, (system.lines_x_m, system.lines_y_m))]
    return [_even_or_odd(mirrors, signs, size) for signs in itertools.product((1, -1), repeat=len(mirrors))]


def _side_m(plate: FlexiblePlate) -> float:
    return max(plate.length_m, plate.width_m)


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
    for functions, first in ((system.rotations, system.deflections.size), (system.in_plane.functions, inside)):
        if functions is not None:  # a component along x, then one along y
            partner, odd = _mirrored(functions, axis)
            for kind in (0, 1):
                start = first + kind * len(partner)
                image[start : start + len(partner)] = start + partner
                sign[start : start + len(partner)] = -odd if kind == axis else odd
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
