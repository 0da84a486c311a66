"""Stress at the top surface of the plate for each mode, from the curvature of its shape and its strain in the plane."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from plate_fem.elements import line
from plate_fem.elements.products import Products
from plate_fem.elements.system import PlateSystem


def surface_strain(system: PlateSystem, u: np.ndarray) -> np.ndarray:
    """Return the strain (3, n_nodes, n) of the top surface at the nodes from unknowns (system.size, n): xx, yy, 2 xy.

    It is that of the mid-plane less t/2 times the curvature: theta_x,x, theta_y,y and theta_x,y + theta_y,x, with
    theta = grad w in Kirchhoff's theory.
    """
    w, theta, lines = system.deflections, system.rotations, (system.lines_x_m, system.lines_y_m)
    if theta is None:
        curvature = np.array([_derivative(w, u[: w.size], order, lines) for order in ((2, 0), (0, 2), (1, 1))])
        curvature[2] *= 2
    else:
        curvature = _gradient(theta, u[w.size : w.size + 2 * theta.size], lines)
    strain, functions = -system.plate.thickness_m / 2 * curvature, system.in_plane.functions
    return strain if functions is None else strain + _gradient(functions, u[-2 * functions.size :], lines)


def _gradient(functions: Products, u: np.ndarray, lines: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Return v_x,x, v_y,y and v_x,y + v_y,x (3, n_nodes, n) of a vector v with coefficients u (2 size, n)."""
    x, y = u[: functions.size], u[functions.size :]
    shear = _derivative(functions, x, (0, 1), lines) + _derivative(functions, y, (1, 0), lines)
    return np.array([_derivative(functions, x, (1, 0), lines), _derivative(functions, y, (0, 1), lines), shear])


def _derivative(functions: Products, u: np.ndarray, order: tuple[int, int],
                lines: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Return the projection of a derivative of functions with coefficients u (size, n) at the nodes of the lines,
    (n_nodes, n): the derivatives are discontinuous, and their least-squares projections continuous biquadratics.

    On a grid of rectangles it is a projection along x after one along y.
    """
    along_x = _projection(functions.along_x, order[0], lines[0])
    along_y = _projection(functions.along_y, order[1], lines[1])
    by_y = np.tensordot(along_x, u[functions.number], 1)
    return np.matmul(along_y, by_y).reshape(-1, u.shape[1])


def _projection(functions: line.Functions, derivative: int, at_m: np.ndarray) -> np.ndarray:
    """Return the matrix (m, size) from coefficients to the values at m places of the derivative's projection on
    continuous parabolas."""
    target = line.parabolas(functions.lines_m)
    mass, moments = line.integral(target, target), line.integral(target, functions, 0, derivative)
    coefficients = scipy.linalg.solve(mass.toarray(), moments.toarray(), assume_a="pos")
    number, value = target.at(at_m)
    return np.asarray((value[:, :, None] * coefficients[number]).sum(axis=1))


def modal_surface_stress(system: PlateSystem, u: np.ndarray) -> np.ndarray:
    """Return the stress (n_nodes, 3, n) sx, sy, txy at the top surface for each column of unknowns (system.size, n).

    It is in Pa for unknowns in m and rad.
    """
    plate = system.plate
    nu = plate.poisson_ratio
    xx, yy, xy = surface_strain(system, u)
    scale = plate.youngs_modulus_Pa / (1 - nu**2)
    return scale * np.stack([xx + nu * yy, yy + nu * xx, (1 - nu) / 2 * xy], axis=1)
