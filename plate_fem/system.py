"""Stiffness and mass matrices of the plate, for thin (Kirchhoff) and shear-flexible (Mindlin) theory.

In both the deflection w is bicubic and has continuous slopes (Bogner-Fox-Schmit). Mindlin's rotations are continuous
bicubics, a space that contains the gradient of every such w. The thin limit theta = grad w is therefore reached
without any loss of freedom, and the element cannot lock, although every integral is exact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse as sp
import skfem
from skfem.helpers import dd, ddot, dot, grad

from common.plate import FlexiblePlate
from plate_fem import element, hermite, mesh

Form = Callable[[Any, Any], Any]  # of two fields of scikit-fem
IN_PLANE = 3  # unknowns of the rigid motion in the plane: sway along x, sway along y, yaw
_ALL = ["u", "u_x", "u_y", "u_xy"]
# Unknowns of Kirchhoff's deflection that the edges x = const and y = const hold at zero.
HELD_BY_EDGES: dict[str, tuple[list[str], list[str]]] = {
    "free": ([], []), "simply_supported": (["u", "u_y"], ["u", "u_x"]), "clamped": (_ALL, _ALL),
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
    basis_w: skfem.Basis
    order_w: np.ndarray  # number in basis_w of each deflection unknown
    rotation_basis: skfem.Basis | None = None  # of one rotation (Mindlin)
    _last_probes: dict[bytes, sp.coo_array] = field(default_factory=dict, repr=False)

    @property
    def n_nodes(self) -> int:
        return len(self.lines_x_m) * len(self.lines_y_m)

    @property
    def size(self) -> int:
        return self.stiffness.shape[0]

    def deflection(self, points_m: np.ndarray, derivative: tuple[int, int] = (0, 0)) -> sp.csr_array:
        """Return the sparse matrix (k, size) that evaluates w, or a derivative of it, at points (k, 2)."""
        rows = hermite.interpolation(self.lines_x_m, self.lines_y_m, points_m, derivative)
        return sp.csr_array((rows.data, rows.indices, rows.indptr), shape=(rows.shape[0], self.size))

    def rotation(self, points_m: np.ndarray, axis: int) -> sp.csr_array:
        """Return the sparse matrix (k, size) that evaluates theta_x (axis 0) or theta_y (axis 1) at points (k, 2)."""
        if self.theory == "kirchhoff":
            return self.deflection(points_m, (1, 0) if axis == 0 else (0, 1))
        assert self.rotation_basis is not None  # a Mindlin plate has one
        rows = self._probes(self.rotation_basis, np.asarray(points_m, float))
        start = 4 * self.n_nodes + axis * self.rotation_basis.N
        return sp.csr_array((rows.data, (rows.row, rows.col + start)), shape=(rows.shape[0], self.size))

    def _probes(self, basis: skfem.Basis, points_m: np.ndarray) -> sp.coo_array:
        """The values of a rotation's basis at points (k, 2), kept of the last ones: both rotations and both
        displacements are asked for at the same points."""
        key = points_m.tobytes()
        if key not in self._last_probes:
            self._last_probes.clear()
            self._last_probes[key] = sp.coo_array(basis.probes(points_m.T))
        return self._last_probes[key]

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
    quads = element.quad_mesh(lines_x, lines_y)
    basis_w = skfem.Basis(quads, element.RectangleBFS(), intorder=6)
    build = _kirchhoff if theory == "kirchhoff" else _mindlin
    stiffness, mass, fixed, rotation_basis = build(plate, quads, basis_w)
    stiffness = sp.block_diag([stiffness, sp.csr_array((IN_PLANE, IN_PLANE))])
    mass = sp.block_diag([mass, sp.diags_array(_rigid_mass(plate))])
    order = _blockwise(basis_w, stiffness.shape[0])
    position = np.argsort(order)
    held = np.append(position[fixed], [] if sways(plate) else np.arange(len(order) - IN_PLANE, len(order))).astype(int)
    return PlateSystem(
        plate, theory, lines_x, lines_y,
        without_rounding(stiffness)[order][:, order], without_rounding(mass)[order][:, order],
        held, basis_w, order[: basis_w.N], rotation_basis,
    )  # fmt: skip


def sways(plate: FlexiblePlate) -> bool:
    """Return whether the plate can move in its plane: it stands on rods, which bend, and on nothing else."""
    return bool(plate.rods) and plate.edges == "free" and not plate.point_supports


def _rigid_mass(plate: FlexiblePlate) -> list[float]:
    """Return the plate's mass (kg) against sway along x and y, and its moment of inertia (kg m2) against yaw."""
    mass = plate.density_kg_m3 * plate.thickness_m * plate.length_m * plate.width_m
    return [mass, mass, mass * (plate.length_m**2 + plate.width_m**2) / 12]


def without_rounding(matrix: Any) -> sp.csr_array:
    """Return a symmetric matrix (n, n) without the entries that are zero but for rounding, a third of them."""
    entries = sp.coo_array(matrix)
    scale = np.sqrt(entries.diagonal())
    kept = abs(entries.data) > 1e-14 * scale[entries.row] * scale[entries.col]
    return sp.csr_array((entries.data[kept], (entries.row[kept], entries.col[kept])), shape=entries.shape)


def _blockwise(basis_w: skfem.Basis, size: int) -> np.ndarray:
    """Return the old numbers of the unknowns in their new order: w of all nodes first, then w_x, w_y, w_xy."""
    return np.concatenate([basis_w.nodal_dofs.ravel(), np.arange(basis_w.N, size)])


def _bending(plate: FlexiblePlate) -> Form:
    """Return the bending energy's form D [(1 - nu) sym g : sym g + nu (tr g)^2] of the rotation gradient g (2 x 2)."""
    stiffness, nu = mesh.bending_stiffness(plate), plate.poisson_ratio

    def form(g: Any, h: Any) -> Any:
        trace_g, trace_h = g[0, 0] + g[1, 1], h[0, 0] + h[1, 1]
        symmetric = (g + np.swapaxes(g, 0, 1)) / 2
        return stiffness * ((1 - nu) * ddot(symmetric, h) + nu * trace_g * trace_h)

    return form


def _kirchhoff(plate: FlexiblePlate, quads: skfem.MeshQuad, basis_w: skfem.Basis) -> tuple[Any, Any, np.ndarray, None]:
    """Return stiffness, mass, held unknowns and no basis of rotations."""
    bending = _bending(plate)
    mass_per_area = plate.density_kg_m3 * plate.thickness_m
    stiffness = skfem.BilinearForm(lambda u, v, _: bending(dd(u), dd(v))).assemble(basis_w)
    mass = skfem.BilinearForm(lambda u, v, _: mass_per_area * u * v).assemble(basis_w)
    return stiffness, mass, _edge_unknowns(plate, quads, basis_w, *HELD_BY_EDGES[plate.edges]), None


def _mindlin(
    plate: FlexiblePlate, quads: skfem.MeshQuad, basis_w: skfem.Basis
) -> tuple[Any, Any, np.ndarray, skfem.Basis]:
    """Return stiffness, mass, held unknowns and the basis of one rotation."""
    basis_t = skfem.Basis(quads, skfem.ElementQuadP(3), intorder=6)
    t, shear = plate.thickness_m, mesh.shear_stiffness(plate)
    mass_per_area = plate.density_kg_m3 * t
    grad_grad = [[skfem.BilinearForm(lambda u, v, _, i=i, j=j: grad(u)[j] * grad(v)[i]).assemble(basis_t)
                  for j in range(i + 1)] for i in (0, 1)]
    value = skfem.BilinearForm(lambda u, v, _: u * v).assemble(basis_t)
    k_ww = skfem.BilinearForm(lambda u, v, _: shear * dot(grad(u), grad(v))).assemble(basis_w)
    k_wt = [skfem.BilinearForm(lambda u, v, _, i=i: -shear * u * grad(v)[i]).assemble(basis_t, basis_w) for i in (0, 1)]
    k_xx, k_xy, k_yy = _bending_of_rotations(plate, grad_grad[0][0], grad_grad[1][1], grad_grad[1][0])
    k_tt = [[k_xx + shear * value, k_xy], [k_xy.T, k_yy + shear * value]]
    stiffness = sp.block_array(
        [[k_ww, k_wt[0], k_wt[1]], [k_wt[0].T, k_tt[0][0], k_tt[0][1]], [k_wt[1].T, k_tt[1][0], k_tt[1][1]]]
    )
    m_w = skfem.BilinearForm(lambda u, v, _: mass_per_area * u * v).assemble(basis_w)
    m_t = mass_per_area * t**2 / 12 * value
    return stiffness, sp.block_diag([m_w, m_t, m_t]), _mindlin_edges(plate, quads, basis_w, basis_t), basis_t


def _bending_of_rotations(plate: FlexiblePlate, xx: Any, yy: Any, yx: Any) -> tuple[Any, Any, Any]:
    """Return `_bending` for theta_x with itself, theta_x with theta_y, and theta_y with itself.

    It is put together from the integrals xx of u_x v_x, yy of u_y v_y and yx of u_x v_y, v being the row.
    """
    stiffness, nu = mesh.bending_stiffness(plate), plate.poisson_ratio
    half = stiffness * (1 - nu) / 2
    return stiffness * xx + half * yy, half * yx + stiffness * nu * yx.T, stiffness * yy + half * xx


def _mindlin_edges(
    plate: FlexiblePlate, quads: skfem.MeshQuad, basis_w: skfem.Basis, basis_t: skfem.Basis
) -> np.ndarray:
    """Return the unknowns held by the edges. A simply supported edge holds w and the rotation along the edge (hard)."""
    if plate.edges == "free":
        return np.array([], int)
    on_x, on_y = _edge_facets(plate, quads)
    held_w = _edge_unknowns(plate, quads, basis_w, ["u", "u_y"], ["u", "u_x"])
    dofs_x, dofs_y = basis_t.get_dofs(on_x).all(), basis_t.get_dofs(on_y).all()
    if plate.edges == "clamped":
        dofs_x = dofs_y = np.union1d(dofs_x, dofs_y)
    # theta_y is the rotation along edges x = const, theta_x along edges y = const
    return np.concatenate([held_w, basis_w.N + dofs_y, basis_w.N + basis_t.N + dofs_x])


def _edge_facets(plate: FlexiblePlate, quads: skfem.MeshQuad) -> tuple[np.ndarray, np.ndarray]:
    """Return the facets on the edges x = const and on the edges y = const."""
    on_x = quads.facets_satisfying(lambda x: np.isclose(abs(x[0]), plate.length_m / 2), boundaries_only=True)
    on_y = quads.facets_satisfying(lambda x: np.isclose(abs(x[1]), plate.width_m / 2), boundaries_only=True)
    return on_x, on_y


def _edge_unknowns(
    plate: FlexiblePlate, quads: skfem.MeshQuad, basis_w: skfem.Basis, names_x: list[str], names_y: list[str]
) -> np.ndarray:
    """Return the unknowns of the deflection to hold on the edges x = const and y = const, given by name."""
    held = [np.array([], int)]
    for facets, names in zip(_edge_facets(plate, quads), (names_x, names_y), strict=True):
        if names:
            held.append(basis_w.get_dofs(facets).all(names))
    return np.unique(np.concatenate(held))
