"""Elements along a line, and their products on the plate, against scipy's splines and integrals in closed form."""

from functools import partial

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import BSpline, CubicHermiteSpline

from plate_fem.elements import mesh
from plate_fem.elements.mesh import bicubics, deflections, rotations

LINES_M = np.array([-0.3, -0.22, -0.05, 0.05, 0.22, 0.3])
SPACES = {"smooth cubics": mesh.smooth_cubics, "parabolas": mesh.parabolas,
          **{f"splines of {k}": partial(mesh.splines, degree=k) for k in (3, 4)}}


def values(functions, points_m, derivative=0):
    number, value = functions.at(np.asarray(points_m, float), derivative)
    full = np.zeros((len(points_m), functions.size))
    np.add.at(full, (np.arange(len(points_m))[:, None], number), value)
    return full


@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_smooth_cubics_are_hermites(derivative):
    rng = np.random.default_rng(1)
    value, slope = rng.normal(size=(2, len(LINES_M)))
    points = rng.uniform(-0.3, 0.3, 40)
    found = values(mesh.smooth_cubics(LINES_M), points, derivative) @ np.append(value, slope)
    expected = CubicHermiteSpline(LINES_M, value, slope)(points, derivative)
    assert found == pytest.approx(expected, abs=1e-12 * abs(expected).max())


def test_parabolas_are_all_that_are_continuous():
    """They join without a step, are zero at all grid lines but one, and hold any parabola."""
    functions = mesh.parabolas(LINES_M)
    assert functions.size == 2 * (len(LINES_M) - 1) + 1
    assert values(functions, LINES_M)[:, : len(LINES_M)] == pytest.approx(np.eye(len(LINES_M)))
    assert values(functions, LINES_M)[:, len(LINES_M):] == pytest.approx(0.0)
    assert values(functions, LINES_M[1:-1] - 1e-12) == pytest.approx(values(functions, LINES_M[1:-1]), abs=1e-9)
    assert_holds(functions, 2)


@pytest.mark.parametrize("degree", [1, 3, 4])
@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_splines_are_those_of_scipy(degree, derivative):
    functions, rng = mesh.splines(LINES_M, degree), np.random.default_rng(5)
    assert functions.size == len(LINES_M) - 1 + degree
    values_at, points = rng.normal(size=functions.size), rng.uniform(-0.3, 0.3, 40)
    expected = BSpline(np.r_[degree * [-0.3], LINES_M, degree * [0.3]], values_at, degree)(points, derivative)
    assert values(functions, points, derivative) @ values_at == pytest.approx(expected, abs=1e-10 * abs(expected).max())
    assert_holds(functions, degree)


def assert_holds(functions, degree):
    points = np.linspace(-0.3, 0.3, 101)
    basis = values(functions, points)
    for power in range(degree + 1):
        assert basis @ np.linalg.lstsq(basis, points**power, rcond=None)[0] == pytest.approx(points**power, abs=1e-12)


def test_rotations_contain_the_slopes_of_every_deflection():
    """So that the thin limit is reached without any loss of freedom."""
    lines, rng = (LINES_M, LINES_M[1:-1]), np.random.default_rng(6)
    w, points = deflections(*lines), rng.uniform((-0.3, -0.22), (0.3, 0.22), (900, 2))
    for theta, by in zip(rotations(*lines), ((1, 0), (0, 1)), strict=True):
        slope, basis = w.values(points, by) @ rng.normal(size=w.size), theta.values(points).toarray()
        assert basis @ np.linalg.lstsq(basis, slope, rcond=None)[0] == pytest.approx(slope, abs=1e-9 * abs(slope).max())


@pytest.mark.parametrize("one", SPACES)
@pytest.mark.parametrize("other", SPACES)
@pytest.mark.parametrize(("of_one", "of_other"), [(0, 0), (1, 0), (2, 1)])
def test_integrals_are_those_of_an_adaptive_quadrature(one, other, of_one, of_other):
    one, other = SPACES[one](LINES_M), SPACES[other](LINES_M)
    rng = np.random.default_rng(2)
    left, right = rng.normal(size=one.size), rng.normal(size=other.size)
    found = left @ (mesh.line_integral(one, other, of_one, of_other) @ right)
    expected = sum(quad(lambda x: (values(one, [x], of_one) @ left * (values(other, [x], of_other) @ right)).item(),
                        *cell, epsabs=0, epsrel=1e-10)[0] for cell in zip(LINES_M[:-1], LINES_M[1:], strict=True))
    assert found == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("name", SPACES)
def test_reversed_functions_are_their_images(name):
    functions, points = SPACES[name](LINES_M), np.linspace(-0.29, 0.29, 30)
    image, sign = functions.mirrored()
    assert values(functions, -points)[:, image] * sign == pytest.approx(values(functions, points), abs=1e-14)


@pytest.mark.parametrize("space", [deflections, bicubics, lambda *lines: rotations(*lines)[1]],
                         ids=["deflections", "bicubics", "rotation along y"])
def test_products_hold_a_bicubic_and_its_integrals(space):
    """w = x^3 y^2 on a rectangle 2a x 2b: w_x^2 has the integral 36 a^5 b^5 / 25, w_xx w_yy 16 a^5 b^3 / 5."""
    functions = space(LINES_M, LINES_M[1:-1])
    a, b = 0.3, 0.22
    points = np.random.default_rng(3).uniform((-a, -b), (a, b), (2 * functions.size, 2))
    w = np.linalg.lstsq(functions.values(points).toarray(), points[:, 0] ** 3 * points[:, 1] ** 2, rcond=None)[0]
    slope = functions.values(points, (1, 1)) @ w
    assert slope == pytest.approx(6 * points[:, 0] ** 2 * points[:, 1], abs=1e-9)
    stretch = mesh.integral(functions, functions, (1, 0), (1, 0))
    assert w @ (stretch @ w) == pytest.approx(36 * a**5 * b**5 / 25, rel=1e-9)
    crossed = mesh.integral(functions, functions, (2, 0), (0, 2))
    assert w @ (crossed @ w) == pytest.approx(16 * a**5 * b**3 / 5, rel=1e-9)


def test_bicubics_come_in_blocks_of_the_nodes():
    functions = bicubics(LINES_M, LINES_M[1:-1])
    x, y = (axis.ravel() for axis in np.meshgrid(LINES_M, LINES_M[1:-1], indexing="ij"))
    orders = [(0, 0), (1, 0), (0, 1), (1, 1)]
    nodal = np.concatenate([functions.values(np.column_stack([x, y]), order).toarray() for order in orders])
    assert nodal == pytest.approx(np.eye(functions.size), abs=1e-12)
