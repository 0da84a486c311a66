"""Bending stress at the top surface of the plate for each mode, from the curvature of its shape."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg

from plate_fem.elements import line
from plate_fem.elements.products import Products
from plate_fem.elements.system import IN_PLANE, PlateSystem


def curvature_operator(system: PlateSystem) -> Callable[[np.ndarray], np.ndarray]:
    """Return the function from unknowns (system.size, n) to curvatures (3, n_nodes, n) at the nodes, in 1/m.

    The curvatures are theta_x,x, theta_y,y and theta_x,y + theta_y,x, with theta = grad w in Kirchhoff's theory. They
    are least-squares projections of the discontinuous derivatives on continuous biquadratics.
    """
    w, theta = system.deflections, system.rotations

    def curvature(u: np.ndarray) -> np.ndarray:
        bending = u[:-IN_PLANE]
        if theta is None:
            of_w = [_derivative(w, bending, order) for order in ((2, 0), (0, 2), (1, 1))]
            return np.array([of_w[0], of_w[1], 2 * of_w[2]])
        x, y = bending[w.size : w.size + theta.size], bending[w.size + theta.size :]
        twist = _derivative(theta, x, (0, 1)) + _derivative(theta, y, (1, 0))
        return np.array([_derivative(theta, x, (1, 0)), _derivative(theta, y, (0, 1)), twist])

    return curvature


def _derivative(functions: Products, u: np.ndarray, order: tuple[int, int]) -> np.ndarray:
    """Return the projection of a derivative of functions with coefficients u (size, n) at the nodes, (n_nodes, n).

    On a grid of rectangles it is a projection along x after one along y.
    """
    along_x, along_y = _projection(functions.along_x, order[0]), _projection(functions.along_y, order[1])
    by_y = np.tensordot(along_x, u[functions.number], 1)
    return np.matmul(along_y, by_y).reshape(-1, u.shape[1])


def _projection(functions: line.Functions, derivative: int) -> np.ndarray:
    """Return the matrix (m, size) from coefficients to the values at the m grid lines of the derivative's projection on
    continuous parabolas."""
    target = line.parabolas(functions.lines_m)
    mass, moments = line.integral(target, target), line.integral(target, functions, 0, derivative)
    values = scipy.linalg.solve(mass.toarray(), moments.toarray(), assume_a="pos")
    return np.asarray(values[: len(functions.lines_m)])


def modal_surface_stress(system: PlateSystem, u: np.ndarray) -> np.ndarray:
    """Return the stress (n_nodes, 3, n) sx, sy, txy at the top surface for each column of unknowns (system.size, n).

    It is in Pa for unknowns in m and rad.
    """
    plate = system.plate
    nu = plate.poisson_ratio
    kx, ky, kxy = curvature_operator(system)(u)
    scale = -plate.youngs_modulus_Pa * plate.thickness_m / 2 / (1 - nu**2)  # in-plane displacement is -z theta
    return scale * np.stack([kx + nu * ky, ky + nu * kx, (1 - nu) / 2 * kxy], axis=1)
