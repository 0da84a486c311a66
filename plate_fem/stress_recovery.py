"""Bending stress at the top surface of the plate for each mode, from the curvature of its shape."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
import skfem
from scipy.linalg import solveh_banded
from skfem.helpers import dd, grad

from plate_fem.system import IN_PLANE, PlateSystem


def curvature_operator(system: PlateSystem) -> Callable[[np.ndarray], np.ndarray]:
    """Return the function from unknowns (system.size, n) to curvatures (3, n_nodes, n) at the nodes, in 1/m.

    The curvatures are theta_x,x, theta_y,y and theta_x,y + theta_y,x, with theta = grad w in Kirchhoff's theory. They
    are least-squares projections of the discontinuous derivatives on continuous biquadratics.
    """
    target = system.basis_w.with_element(skfem.ElementQuad2())
    solve = _mass_solver(system, target)
    rows = _kirchhoff_rows(system, target) if system.theory == "kirchhoff" else _mindlin_rows(system, target)

    def curvature(u: np.ndarray) -> np.ndarray:
        bending = u[:-IN_PLANE]
        return np.array([solve(row @ bending) for row in rows])

    return curvature


def _mass_solver(system: PlateSystem, target: skfem.Basis) -> Callable[[np.ndarray], np.ndarray]:
    """Return the function from moments (target.N, n) to values at the nodes (n_nodes, n), which inverts the mass matrix
    of biquadratics. On a grid of rectangles that is the product of those of quadratics along x and along y."""
    lines = system.lines_x_m, system.lines_y_m
    of_x, of_y = (abs(place[:, None] - _with_middles(along)).argmin(axis=1)
                  for place, along in zip(target.doflocs, lines, strict=True))
    mass_x, mass_y = (_mass_along(along) for along in lines)
    nodes = target.nodal_dofs[0]

    def solve(moments: np.ndarray) -> np.ndarray:
        grid = np.empty((mass_x.shape[1], mass_y.shape[1], moments.shape[1]))
        grid[of_x, of_y] = moments
        if grid.size == 0:  # no modes
            return np.empty((len(nodes), 0))
        at_nodes_x = solveh_banded(mass_x, grid.reshape(len(grid), -1))[::2].reshape(-1, *grid.shape[1:])
        by_y = at_nodes_x.transpose(1, 0, 2)
        at_nodes = solveh_banded(mass_y, by_y.reshape(len(by_y), -1))[::2].reshape(-1, *by_y.shape[1:])
        return at_nodes[of_y[nodes] // 2, of_x[nodes] // 2]

    return solve


def _with_middles(lines: np.ndarray) -> np.ndarray:
    """Return grid lines (n,) with those halfway between them, (2 n - 1,)."""
    return np.interp(np.arange(2 * len(lines) - 1) / 2, np.arange(len(lines)), lines)


def _mass_along(lines: np.ndarray) -> np.ndarray:
    """Return the mass matrix of quadratics between grid lines (n,), as the upper bands (3, 2 n - 1) of scipy."""
    h, bands = np.diff(lines) / 30, np.zeros((3, 2 * len(lines) - 1))
    bands[2, 1::2] = 16 * h
    bands[2, :-2:2] += 4 * h
    bands[2, 2::2] += 4 * h
    bands[1, 1:] = np.repeat(2 * h, 2)
    bands[0, 2::2] = -h
    return bands


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
