"""Stiffness and mass matrices of the plate, for thin (Kirchhoff) and shear-flexible (Mindlin) theory.

In both the deflection w is bicubic and has continuous slopes (Bogner-Fox-Schmit). Mindlin's rotations are continuous
bicubics, a space that contains the gradient of every such w. The thin limit theta = grad w is therefore reached
without any loss of freedom, and the element cannot lock, although every integral is exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from common.scene.plate import FlexiblePlate
from plate_fem.elements import mesh, products
from plate_fem.elements.products import Products, integral

IN_PLANE = 3  # unknowns of the rigid motion in the plane: sway along x, sway along y, yaw
# Of w, w_x, w_y, w_xy those that the edges x = const and y = const hold at zero.
HELD_BY_EDGES: dict[str, tuple[list[int], list[int]]] = {
    "free": ([], []), "simply_supported": ([0, 2], [0, 1]), "clamped": ([0, 1, 2, 3], [0, 1, 2, 3]),
}  # fmt: skip


@dataclass(frozen=True)
class PlateSystem:
    """Matrices over all unknowns: w, w_x, w_y, w_xy at the nodes, block by block, then Mindlin's theta_x and theta_y,
    and last the rigid motion of the plate in its plane: sway along x and y (m), and yaw (rad).

    `stiffness` and `mass` are sparse (size, size); `fixed` holds the numbers of the unknowns that are held at zero: by
    the edges, and sway and yaw unless the plate stands on rods alone.
    """

    plate: FlexiblePlate
    theory: str
    lines_x_m: np.ndarray
    lines_y_m: np.ndarray
    stiffness: sp.csr_array
    mass: sp.csr_array
    fixed: np.ndarray
    deflections: Products
    rotations: Products | None = None  # of one rotation (Mindlin)

    @property
    def n_nodes(self) -> int:
        return len(self.lines_x_m) * len(self.lines_y_m)

    @property
    def size(self) -> int:
        return self.stiffness.shape[0]

    def deflection(self, points_m: np.ndarray, derivative: tuple[int, int] = (0, 0)) -> sp.csr_array:
        """Return the sparse matrix (k, size) that evaluates w, or a derivative of it, at points (k, 2)."""
        rows = self.deflections.values(points_m, derivative)
        return sp.csr_array((rows.data, rows.indices, rows.indptr), shape=(rows.shape[0], self.size))

    def rotation(self, points_m: np.ndarray, axis: int, derivative: tuple[int, int] = (0, 0)) -> sp.csr_array:
        """Return the sparse matrix (k, size) that evaluates theta_x (axis 0) or theta_y (axis 1), or a derivative
        of it, at points (k, 2)."""
        if self.theory == "kirchhoff":
            return self.deflection(points_m, (derivative[0] + (axis == 0), derivative[1] + (axis == 1)))
        assert self.rotations is not None  # a Mindlin plate has them
        rows = self.rotations.values(points_m, derivative)
        columns = rows.indices + 4 * self.n_nodes + axis * self.rotations.size
        return sp.csr_array((rows.data, columns, rows.indptr), shape=(rows.shape[0], self.size))

    def curvature(self, points_m: np.ndarray) -> tuple[sp.csr_array, sp.csr_array, sp.csr_array]:
        """Return the sparse matrices (k, size) of theta_x,x, theta_y,y and theta_x,y + theta_y,x at points (k, 2)."""
        x, y = ((1, 0), (0, 1))
        twist = self.rotation(points_m, 0, y) + self.rotation(points_m, 1, x)
        return self.rotation(points_m, 0, x), self.rotation(points_m, 1, y), sp.csr_array(twist)

    def lateral(self, points_m: np.ndarray, axis: int, z_m: float) -> sp.csr_array:
        """Return the sparse matrix (k, size) of the displacement along x (axis 0) or y (axis 1) at points (k, 2).

        They lie z_m above the mid-plane: u_x = sway_x - y yaw - z theta_x, u_y = sway_y + x yaw - z theta_y.
        """
        points = np.atleast_2d(np.asarray(points_m, float))
        arm = -points[:, 1] if axis == 0 else points[:, 0]
        rigid = np.column_stack([np.full(len(points), float(axis == 0)), np.full(len(points), float(axis == 1)), arm])
        rows = sp.coo_array(rigid)
        columns = rows.col + self.size - IN_PLANE
        swayed = sp.csr_array((rows.data, (rows.row, columns)), shape=(len(points), self.size))
        return sp.csr_array(swayed - z_m * self.rotation(points, axis))

    def yaw(self) -> sp.csr_array:
        """Return the sparse row (1, size) that picks the yaw."""
        return sp.csr_array(([1.0], ([0], [self.size - 1])), shape=(1, self.size))


def assemble(plate: FlexiblePlate) -> PlateSystem:
    """Assemble the matrices of a plate without rods and supports. Raises Refused for a mesh that is too large."""
    theory = mesh.choose_theory(plate)
    lines_x, lines_y = mesh.mesh_lines(plate)
    w = products.deflections(lines_x, lines_y)
    theta = None if theory == "kirchhoff" else products.rotations(lines_x, lines_y)
    stiffness, mass = _kirchhoff(plate, w) if theta is None else _mindlin(plate, w, theta)
    held = [_held_deflections(w, plate.edges)] if theta is None else [_held_in_mindlin(w, theta, plate.edges)]
    size = stiffness.shape[0] + IN_PLANE
    rigid = sp.diags_array(np.append(np.zeros(size - IN_PLANE), _rigid_mass(plate)), format="csr")
    if not sways(plate):
        held.append(np.arange(size - IN_PLANE, size))
    return PlateSystem(
        plate, theory, lines_x, lines_y,
        grown(stiffness, size), sp.csr_array(grown(mass, size) + rigid),
        np.concatenate(held), w, theta,
    )  # fmt: skip


def sways(plate: FlexiblePlate) -> bool:
    """Return whether the plate can move in its plane: it stands on rods, which bend, and on nothing else."""
    return bool(plate.rods) and plate.edges == "free" and not plate.point_supports


def _rigid_mass(plate: FlexiblePlate) -> list[float]:
    """Return the plate's mass (kg) against sway along x and y, and its moment of inertia (kg m2) against yaw."""
    mass = plate.density_kg_m3 * plate.thickness_m * plate.length_m * plate.width_m
    return [mass, mass, mass * (plate.length_m**2 + plate.width_m**2) / 12]


def grown(matrix: sp.csr_array, size: int) -> sp.csr_array:
    """Append rows and columns of zeros to a square matrix."""
    start = np.append(matrix.indptr, np.full(size - matrix.shape[0], matrix.indptr[-1]))
    return sp.csr_array((matrix.data, matrix.indices, start), shape=(size, size))


def without_rounding(matrix: sp.csr_array) -> sp.csr_array:
    """Return a symmetric matrix (n, n) without the entries that are zero but for rounding."""
    scale = np.sqrt(matrix.diagonal())
    bound = np.repeat(1e-14 * scale, np.diff(matrix.indptr)) * scale[matrix.indices]
    kept = matrix.copy()
    kept.data[abs(kept.data) <= bound] = 0.0
    kept.eliminate_zeros()
    return kept


def _kirchhoff(plate: FlexiblePlate, w: Products) -> tuple[Any, Any]:
    """Return stiffness and mass. The bending energy is that of `_mindlin` with theta = grad w."""
    nu, mass_per_area = plate.poisson_ratio, plate.density_kg_m3 * plate.thickness_m
    xx, yy = integral(w, w, (2, 0), (2, 0)), integral(w, w, (0, 2), (0, 2))
    xy, twist = integral(w, w, (2, 0), (0, 2)), integral(w, w, (1, 1), (1, 1))
    stiffness = mesh.bending_stiffness(plate) * (xx + yy + nu * (xy + xy.T) + 2 * (1 - nu) * twist)
    return stiffness, mass_per_area * integral(w, w)


def _mindlin(plate: FlexiblePlate, w: Products, theta: Products) -> tuple[Any, Any]:
    """Return stiffness and mass.

    The energy is the integral of D [(1 - nu) e:e + nu (tr e)^2] / 2 + S |grad w - theta|^2 / 2, e = sym grad theta.
    """
    t, nu = plate.thickness_m, plate.poisson_ratio
    bending, shear, mass_per_area = mesh.bending_stiffness(plate), mesh.shear_stiffness(plate), plate.density_kg_m3 * t
    value = integral(theta, theta)
    xx, yy = integral(theta, theta, (1, 0), (1, 0)), integral(theta, theta, (0, 1), (0, 1))
    xy = integral(theta, theta, (1, 0), (0, 1))
    twist = (1 - nu) / 2  # times D theta_x,y + theta_y,x squared
    k_ww = shear * (integral(w, w, (1, 0), (1, 0)) + integral(w, w, (0, 1), (0, 1)))
    k_wx, k_wy = -shear * integral(w, theta, (1, 0)), -shear * integral(w, theta, (0, 1))
    k_xx = bending * (xx + twist * yy) + shear * value
    k_xy = bending * (nu * xy + twist * xy.T)
    k_yy = bending * (yy + twist * xx) + shear * value
    stiffness = sp.block_array([[k_ww, k_wx, k_wy], [k_wx.T, k_xx, k_xy], [k_wy.T, k_xy.T, k_yy]], format="csr")
    rotary = mass_per_area * t**2 / 12 * value
    return stiffness, sp.block_diag([mass_per_area * integral(w, w), rotary, rotary], format="csr")


def _held_deflections(w: Products, edges: str) -> np.ndarray:
    """Return the unknowns of the deflection that edges hold in Kirchhoff's theory."""
    n_x, n_y = len(w.along_x.lines_m), len(w.along_y.lines_m)
    kinds = np.arange(w.size).reshape(4, n_x, n_y)
    by_x, by_y = HELD_BY_EDGES[edges]
    return np.union1d(kinds[by_x][:, [0, -1]], kinds[by_y][:, :, [0, -1]])


def _held_in_mindlin(w: Products, theta: Products, edges: str) -> np.ndarray:
    """Return the unknowns that edges hold in Mindlin's theory. A simply supported edge holds w and the rotation along
    the edge (hard): theta_y on x = const, theta_x on y = const. A clamped one holds both rotations."""
    if edges == "free":
        return np.array([], int)
    n_x, n_y = len(w.along_x.lines_m), len(w.along_y.lines_m)
    on_x, on_y = theta.number[[0, n_x - 1]].ravel(), theta.number[:, [0, n_y - 1]].ravel()
    if edges == "clamped":
        on_x = on_y = np.union1d(on_x, on_y)
    return np.concatenate([_held_deflections(w, "simply_supported"), w.size + on_y, w.size + theta.size + on_x])
