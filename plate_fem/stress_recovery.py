"""Bending stress at the top surface of the plate for each mode, from the curvature of its shape."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
import skfem
from skfem.helpers import dd, grad

from plate_fem.system import IN_PLANE, PlateSystem


def curvature_operator(system: PlateSystem) -> Callable[[np.ndarray], np.ndarray]:
    """Return the function from unknowns (system.size, n) to curvatures (3, n_nodes, n) at the nodes, in 1/m.

    The curvatures are theta_x,x, theta_y,y and theta_x,y + theta_y,x, with theta = grad w in Kirchhoff's theory. They
    are least-squares projections of the discontinuous derivatives on continuous biquadratics.
    """
    target = system.basis_w.with_element(skfem.ElementQuad2())
    mass = skfem.BilinearForm(lambda u, v, _: u * v).assemble(target)
    solve = sp.linalg.splu(mass.tocsc()).solve
    rows = _kirchhoff_rows(system, target) if system.theory == "kirchhoff" else _mindlin_rows(system, target)

    def curvature(u: np.ndarray) -> np.ndarray:
        bending = u[:-IN_PLANE]
        return np.array([solve(row @ bending)[target.nodal_dofs[0]] for row in rows])

    return curvature


def _kirchhoff_rows(system: PlateSystem, target: skfem.Basis) -> list[sp.csr_array]:
    def moments(i: int, j: int, factor: float) -> sp.csr_array:
        matrix = skfem.BilinearForm(lambda u, v, _: factor * dd(u)[i, j] * v).assemble(system.basis_w, target)
        return sp.csr_array(matrix)[:, system.order_w]

    return [moments(0, 0, 1.0), moments(1, 1, 1.0), moments(0, 1, 2.0)]


def _mindlin_rows(system: PlateSystem, target: skfem.Basis) -> list[sp.csr_array]:
    assert system.rotation_basis is not None  # a Mindlin plate has one
    derivative = [
        skfem.BilinearForm(lambda u, v, _, i=i: grad(u)[i] * v).assemble(system.rotation_basis, target) for i in (0, 1)
    ]
    zero_w, zero_t = (sp.csr_array((target.N, b.N)) for b in (system.basis_w, system.rotation_basis))
    blocks = [(derivative[0], zero_t), (zero_t, derivative[1]), (derivative[1], derivative[0])]
    return [sp.csr_array(sp.hstack([zero_w, *block])) for block in blocks]


def modal_surface_stress(system: PlateSystem, u: np.ndarray) -> np.ndarray:
    """Return the stress (n_nodes, 3, n) sx, sy, txy at the top surface for each column of unknowns (system.size, n).

    It is in Pa for unknowns in m and rad.
    """
    plate = system.plate
    nu = plate.poisson_ratio
    kx, ky, kxy = curvature_operator(system)(u)
    scale = -plate.youngs_modulus_Pa * plate.thickness_m / 2 / (1 - nu**2)  # in-plane displacement is -z theta
    return scale * np.stack([kx + nu * ky, ky + nu * kx, (1 - nu) / 2 * kxy], axis=1)
