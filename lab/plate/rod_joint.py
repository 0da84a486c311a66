"""Makes plate_fem/elements/rod_joints.csv: what the joint of a rod adds to plate and beam theory, by a solid of
revolution.

The solid is a round plate (E = 1) with a rod (radius 1) below its middle, in rings of bicubic quadrilaterals, graded
towards the edge where both meet, for displacements u_r, u_z ~ cos n phi and u_phi ~ sin n phi. With n = 0 the rod is
pulled and the plate's rim bent, with n = 1 the rod is pushed sideways and bent, with n = 2 the rim is bent. What the
plate's theory (Reissner's, the same finite elements along the radius) and the rod's (bar; Timoshenko with Cowper's
shear coefficient) give is subtracted:

- stub, stub_twist: the disc above the rod is stiffer by these factors, less one, where the plate bends into a bowl and
  into a saddle. From the turn of the bent rim.
- offset: a rod's head moves by offset t^2 tr e more than the mid-plane, e = sym grad theta. From the rod's rise when
  the rim is bent; the lower face comes nearer to the mid-plane by Poisson's effect, but for the rod in its way.
- sheared_side t, sheared_turn: by these factors of the mean of grad w - theta over the disc the head moves sideways and
  turns more than the normals of the plate do. From the motion of the head when the rim is lifted on one side and
  lowered on the other, but not turned. None of a disc wider than twice the thickness: its mean shear is too small.
- axial (1/E a), side (1/E a), side_turn (1/E a^2) and turn (1/E a^3): compliances of the joint. Kirchhoff's theory has
  others of its own, since its discs turn less.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import scipy.sparse as sp
from scipy.optimize import brentq
from scipy.sparse.linalg import splu

from lab.study import Row
from plate_fem.elements.rods import JOINTS

RADIUS_OVER_THICKNESS = (0.1, 0.2, 0.35, 0.6, 1.0, 1.6, 2.5, 4.0)
POISSON_RATIO = (0.0, 0.15, 0.3, 0.45)
ROD_OVER_PLATE = (0.1, 0.3, 1.0, 3.0, 10.0)  # of the moduli
DEGREE, LENGTH, LOOK = 3, 6.0, 3.0  # of the elements; of the rod; about where its motion is looked at
REISSNER, RIGID_IN_SHEAR = 5 / 6, 500.0

Weight = Callable[[np.ndarray], np.ndarray]


def along(start: float, end: float, cells: int, fine: str) -> np.ndarray:
    """Return grid lines whose cells grow by 1/0.6 away from the fine end, "start" or "end"."""
    side = 0.6 ** -np.arange(cells)
    lines = np.append(0, np.cumsum(side if fine == "start" else side[::-1]))
    return start + (end - start) * lines / lines[-1]


@dataclass(frozen=True)
class Line:
    """Gauss points of a cell of [0, 1], their weights, and values and slopes (points, DEGREE + 1) of its polynomials,
    one at one of equally distant nodes each."""

    point: np.ndarray
    weight: np.ndarray
    value: np.ndarray
    slope: np.ndarray


def _line() -> Line:
    at, weight = np.polynomial.legendre.leggauss(DEGREE + 2)
    point, power = (at + 1) / 2, np.arange(DEGREE + 1)
    polynomial = np.linalg.inv(np.vander(power / DEGREE, increasing=True))
    slope = power * point[:, None] ** np.maximum(power - 1, 0)
    return Line(point, weight / 2, point[:, None] ** power @ polynomial, slope @ polynomial)


LINE = _line()


def _nodes(lines: np.ndarray) -> np.ndarray:
    return np.append(lines[:-1, None] + np.diff(lines)[:, None] * np.arange(DEGREE) / DEGREE, lines[-1])


class Solid:
    """Plate, z from 0 to t, r to `rim`, and rod, z from -LENGTH to 0, r to 1; unknowns u_r, u_phi, u_z of the nodes."""

    def __init__(self, thickness: float, rim: float, nu: float, rod_modulus: float, harmonic: int, fine: int = 1):
        m = 5 * fine
        lines_r = np.append(along(0, 1, m, "end"), along(1, rim, m + 3, "start")[1:])
        below, above = along(-LENGTH, 0, m + 3, "end"), along(0, thickness, m + min(4, int(np.ceil(thickness))), "start")
        self.lines_z = np.append(below, above[1:])
        cells = [(i, j) for i in range(len(lines_r) - 1) for j in range(len(self.lines_z) - 1)
                 if j >= len(below) - 1 or i < m]
        i, j = np.array(cells).T
        step, across = np.arange(DEGREE + 1), DEGREE * (len(self.lines_z) - 1) + 1
        node = (DEGREE * i[:, None, None] + step[:, None]) * across + DEGREE * j[:, None, None] + step
        used, number = np.unique(node.reshape(len(i), -1), return_inverse=True)
        self.size, self.node = len(used), number.reshape(len(i), -1)
        self.r, self.z = _nodes(lines_r)[used // across], _nodes(self.lines_z)[used % across]
        self.law = np.where((j < len(below) - 1)[:, None, None], _law(rod_modulus, nu), _law(1.0, nu))
        self.stiffness = self._assembled(harmonic, lines_r[i], np.diff(lines_r)[i], np.diff(self.lines_z)[j])

    def _assembled(self, n: int, start: np.ndarray, side_r: np.ndarray, side_z: np.ndarray) -> sp.csc_array:
        """Strains: r, phi, z, rz, r phi, phi z."""
        count, k = self.node.shape
        local = np.zeros((count, 3 * k, 3 * k))
        for p, q in itertools.product(range(len(LINE.point)), repeat=2):
            r = (start + side_r * LINE.point[p])[:, None]
            value = np.outer(LINE.value[p], LINE.value[q]).ravel() / r
            by_r = np.outer(LINE.slope[p], LINE.value[q]).ravel() / side_r[:, None]
            by_z = np.outer(LINE.value[p], LINE.slope[q]).ravel() / side_z[:, None]
            strain = np.zeros((count, 6, 3, k))
            strain[:, 0, 0], strain[:, 1, 0], strain[:, 1, 1], strain[:, 2, 2] = by_r, value, n * value, by_z
            strain[:, 3, 0], strain[:, 3, 2], strain[:, 4, 0] = by_z, by_r, -n * value
            strain[:, 4, 1], strain[:, 5, 1], strain[:, 5, 2] = by_r - value, by_z, -n * value
            b = strain.reshape(count, 6, -1)
            weight = LINE.weight[p] * LINE.weight[q] * side_r * side_z * r[:, 0] * (2 * np.pi if n == 0 else np.pi)
            local += b.transpose(0, 2, 1) @ (self.law * weight[:, None, None]) @ b
        unknown = (np.arange(3)[:, None] * self.size + self.node[:, None, :]).reshape(count, -1)
        rows, columns = np.repeat(unknown, 3 * k, axis=1), np.tile(unknown, (1, 3 * k))
        return sp.csc_array((local.ravel(), (rows.ravel(), columns.ravel())), shape=2 * (3 * self.size,))

    def integral(self, axis: int, weight: Weight, r: float | None = None, z: float = 0.0) -> np.ndarray:
        """Return the row (3 size,) of the integral of u_axis times a weight along a line r, over z, or z, over r."""
        on = np.flatnonzero(np.isclose(self.z, z, atol=1e-9) if r is None else np.isclose(self.r, r))
        at = (self.r if r is None else self.z)[on]
        on, at = on[np.argsort(at)], np.sort(at)
        row = np.zeros(3 * self.size)
        for k in range(0, len(at) - 1, DEGREE):
            points = at[k] + (at[k + DEGREE] - at[k]) * LINE.point
            moments = (LINE.weight * (at[k + DEGREE] - at[k]) * weight(points)) @ LINE.value
            row[axis * self.size + on[k : k + DEGREE + 1]] += moments
        return row

    def response(self, loads: list[np.ndarray], held: np.ndarray, thickness: float, rim: float,
                 clamped: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Return displacements (3 size, loads), and the force (loads,) of the rim, whose mean u_z, weighted by the shear
        stress, is held too; of a clamped rim also the mean and the turn of u_r and u_phi, as in a plate's theory."""
        free = np.setdiff1d(np.arange(3 * self.size), held)
        means = [self.integral(2, lambda z: 1.5 / thickness * (1 - 4 * (z / thickness - 0.5) ** 2), r=rim)]
        if clamped:
            means += [self.integral(axis, weight, r=rim) for axis in (0, 1)
                      for weight in (np.ones_like, lambda z: z / thickness - 0.5)]
        row = sp.csc_array(np.array(means)[:, free])
        bordered = sp.block_array([[self.stiffness[free][:, free], row.T], [row, None]], format="csc")
        response = np.zeros((3 * self.size, len(loads)))
        found = splu(bordered).solve(np.vstack([np.array(loads).T[free], np.zeros((len(means), len(loads)))]))
        response[free] = found[: len(free)]
        return response, found[len(free)]


class Column(Solid):
    """A rod alone, z from 0, where all of it is held, to its length."""

    def __init__(self, length: float, nu: float, harmonic: int, fine: int = 1):
        m = 5 * fine
        lines_r, self.lines_z = along(0, 1, m, "end"), along(0, length, m + 5, "start")
        i, j = (axis.ravel() for axis in np.mgrid[:m, : m + 5])
        step, across = np.arange(DEGREE + 1), DEGREE * (m + 5) + 1
        self.node = ((DEGREE * i[:, None, None] + step[:, None]) * across + DEGREE * j[:, None, None] + step).reshape(len(i), -1)
        self.size = (DEGREE * m + 1) * across
        self.r, self.z = (axis.ravel() for axis in np.meshgrid(_nodes(lines_r), _nodes(self.lines_z), indexing="ij"))
        self.law = np.tile(_law(1.0, nu), (len(i), 1, 1))
        self.stiffness = self._assembled(harmonic, lines_r[i], np.diff(lines_r)[i], np.diff(self.lines_z)[j])
        self.harmonic = harmonic

    def moved(self, load: np.ndarray) -> np.ndarray:
        """Displacements (3 size,) under a load."""
        n, axis = self.size, np.flatnonzero(self.r == 0)
        foot = np.flatnonzero(self.z == 0)
        held = [foot, n + foot, 2 * n + foot, *([axis, n + np.arange(n)] if self.harmonic == 0 else [2 * n + axis])]
        free = np.setdiff1d(np.arange(3 * n), np.concatenate(held))
        moved = np.zeros(3 * n)
        moved[free] = splu(sp.csc_array(self.stiffness[free][:, free])).solve(load[free])
        return moved


def _law(modulus: float, nu: float) -> np.ndarray:
    shear = modulus / 2 / (1 + nu)
    law = np.diag([2.0, 2.0, 2.0, 1.0, 1.0, 1.0]) * shear
    law[:3, :3] += modulus * nu / (1 + nu) / (1 - 2 * nu)
    return law


class Theory:
    """The plate along its radius: w, theta_r ~ cos n phi and theta_phi ~ sin n phi, and in its plane u_r and u_phi."""

    def __init__(self, harmonic: int, thickness: float, rim: float, nu: float, kappa: float, stub: float,
                 stub_twist: float = 0.0, cells: int = 24):
        lines = np.append(along(0, 1, cells // 3, "end"), along(1, rim, cells * 2 // 3, "start")[1:])
        n, self.size = harmonic, DEGREE * (len(lines) - 1) + 1
        self.bent, self.stretched = np.zeros(2 * (3 * self.size,)), np.zeros(2 * (2 * self.size,))
        self.mean_w, self.mean_e, self.mean_turn, self.mean_shear = np.zeros((4, 3 * self.size))
        bending, shear = thickness**3 / 12 / (1 - nu**2), kappa * thickness / 2 / (1 + nu)
        bowl, saddle = np.array([[[1, 1, 0], [1, 1, 0], [0, 0, 0]], [[1, -1, 0], [-1, 1, 0], [0, 0, 1]]])
        plane, disc = ((1 + nu) / 2 * factor * bowl + (1 - nu) / 2 * more * saddle
                       for factor, more in ((1.0, 1.0), (1 + stub, 1 + stub_twist)))
        for k, (r0, side) in enumerate(zip(lines[:-1], np.diff(lines), strict=True)):
            w = np.arange(DEGREE * k, DEGREE * k + DEGREE + 1)
            turns, inside = np.append(w, w + self.size), r0 < 1 - 1e-9
            for p in range(len(LINE.point)):
                r, f, by_r = r0 + side * LINE.point[p], LINE.value[p], LINE.slope[p] / side
                area, none = LINE.weight[p] * side * r, 0 * f
                e = np.array([np.append(by_r, none), np.append(f, n * f) / r, np.append(-n * f / r, by_r - f / r)])
                gamma = np.array([[*by_r, *-f, *none], [*(-n * f / r), *none, *-f]])
                weight = area * (2 * np.pi if n == 0 else np.pi)
                every, both = np.append(w, self.size + turns), np.ix_(self.size + turns, self.size + turns)
                self.stretched[np.ix_(turns, turns)] += thickness / (1 - nu**2) * weight * e.T @ plane @ e
                self.bent[both] += bending * weight * e.T @ (disc if inside else plane) @ e
                self.bent[np.ix_(every, every)] += (1 + stub * inside) * shear * weight * gamma.T @ gamma
                if inside:
                    self.mean_w[w] += 2 * area * f
                    self.mean_e[self.size + turns] += 2 * area * (e[0] + e[1])
                    self.mean_turn[self.size + turns] += area * np.append(f, -f)
                    self.mean_shear[w] += area * (by_r + f / r)
        self.mean_shear -= self.mean_turn

    def of_rise(self) -> np.ndarray:
        """Compliances (3, 3) of the disc's mean w, its mean tr e, and the turn of the rim, where w is held."""
        n, turn = self.size, np.zeros(3 * self.size)
        turn[2 * n - 1] = 1.0
        held = np.concatenate([[n, n - 1], 2 * n + np.arange(n)])
        return _compliance(self.bent, held, [self.mean_w, self.mean_e, turn])

    def of_twist(self) -> float:
        """Compliance of the turn of a free rim under the moments of a saddle (harmonic 2)."""
        n, turn = self.size, np.zeros(3 * self.size)
        turn[[2 * n - 1, 3 * n - 1]] = 1.0, -1.0
        return float(_compliance(self.bent, np.array([0, n, 2 * n]), [turn])[0, 0])

    def of_lift(self) -> np.ndarray:
        """The disc's mean turn and mean shear where the rim is lifted by cos phi, and not turned."""
        n = self.size
        held, free = np.array([0, n - 1, 2 * n - 1, 3 * n - 1]), np.ones(3 * n, bool)
        free[held] = False
        moved = np.zeros(3 * n)
        moved[n - 1] = 1.0
        moved[free] = -np.linalg.solve(self.bent[np.ix_(free, free)], self.bent[free, n - 1])
        return np.array([self.mean_turn, self.mean_shear]) @ moved

    def of_push(self, thickness: float, sheared: np.ndarray) -> np.ndarray:
        """Compliances (2, 2) of the head sideways and of its turn; the rim is held."""
        n = self.size
        head = np.outer([thickness / 2, 1], self.mean_turn) + np.outer(sheared, self.mean_shear)
        found = _compliance(self.bent, np.array([0, n - 1, 2 * n - 1, 3 * n - 1]), list(head))
        found[0, 0] += _compliance(self.stretched, np.array([n - 1, 2 * n - 1]), [self.mean_turn[n:]])[0, 0]
        return found


def _compliance(stiffness: np.ndarray, held: np.ndarray, rows: list[np.ndarray]) -> np.ndarray:
    free = np.setdiff1d(np.arange(len(stiffness)), held)
    loads = np.array(rows)[:, free]
    return np.asarray(loads @ np.linalg.solve(stiffness[np.ix_(free, free)], loads.T))


def pulled_and_bent(thickness: float, rim: float, nu: float, rod_modulus: float, fine: int = 1) -> np.ndarray:
    """Compliances (2, 2) of the solid: rise of the rod, less its own, and turn of the rim."""
    solid = Solid(thickness, rim, nu, rod_modulus, 0, fine)
    held = np.concatenate([np.flatnonzero(solid.r == 0), solid.size + np.arange(solid.size)])
    look = solid.lines_z[abs(solid.lines_z + LOOK).argmin()]
    head, foot = (solid.integral(2, lambda r: 2 * r, z=z) for z in (look, -LENGTH))
    turn = solid.integral(0, lambda z: -12 / thickness**3 * (z - thickness / 2), r=rim)
    found = np.array([head, turn]) @ solid.response([foot, turn], held, thickness, rim)[0]
    found[0, 0] += look / (rod_modulus * np.pi)
    return np.asarray(found)


def twisted(thickness: float, rim: float, nu: float, rod_modulus: float, fine: int = 1) -> float:
    """Compliance of the solid as Theory.of_twist gives it."""
    solid = Solid(thickness, rim, nu, rod_modulus, 2, fine)
    turn_r, turn_phi = (solid.integral(axis, lambda z: -12 / thickness**3 * (z - thickness / 2), r=rim) for axis in (0, 1))
    axis_or_foot = np.flatnonzero((solid.r == 0) | (solid.z == -LENGTH))
    held = (np.arange(3)[:, None] * solid.size + axis_or_foot).ravel()
    free = np.setdiff1d(np.arange(3 * solid.size), held)
    turn = (turn_r - turn_phi)[free]
    return float(turn @ splu(sp.csc_array(solid.stiffness[free][:, free])).solve(turn))


def pushed(thickness: float, rim: float, nu: float, rod_modulus: float, fine: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Compliances (2, 2) of the solid: side and turn of the rod's head, from forces there; the rim is held. And both
    motions where the rim is lifted by cos phi instead: by Betti's theorem less the force on it."""
    solid = Solid(thickness, rim, nu, rod_modulus, 1, fine)
    look = solid.lines_z[abs(solid.lines_z + LOOK).argmin()]

    def motion(z: float) -> list[np.ndarray]:
        side = solid.integral(0, lambda r: r, z=z) - solid.integral(1, lambda r: r, z=z)
        return [side, solid.integral(2, lambda r: 4 * r**2, z=z)]

    held = 2 * solid.size + np.flatnonzero(solid.r == 0)
    response, lifted = solid.response(motion(-LENGTH), held, thickness, rim, clamped=True)
    found = np.array(motion(look)) @ response
    found[:, 0] -= (LENGTH + look) * found[:, 1]  # from force and moment at the foot to those at the section
    s, bending = -look, rod_modulus * np.pi / 4
    shear = 6 * (1 + nu) / (7 + 6 * nu) * rod_modulus / 2 / (1 + nu) * np.pi
    found -= np.array([[s**3 / 3 / bending + s / shear, s**2 / 2 / bending], [s**2 / 2 / bending, s / bending]])
    to_head = np.array([[1, -s], [0, 1]])
    found = to_head @ found @ to_head.T
    return (found + found.T) / 2, lifted - np.array([LENGTH * lifted[1], 0.0])  # the rod itself is not bent then


def joint(radius_over_thickness: float, nu: float, rod_modulus: float, fine: int = 1, rim: float = 4.0) -> dict[str, float]:
    """What the module's text says, of a rod whose modulus is `rod_modulus` times the plate's; `rim` times the radius and
    thickness is the radius of the plate."""
    t = 1 / radius_over_thickness
    rim *= 1 + t
    rise = pulled_and_bent(t, rim, nu, rod_modulus, fine)
    push, lifted = pushed(t, rim, nu, rod_modulus, fine)

    def theory(stub: float) -> np.ndarray:
        return Theory(0, t, rim, nu, REISSNER, stub).of_rise()

    stub = brentq(lambda stub: theory(stub)[2, 2] / rise[1, 1] - 1, -0.9, 500, xtol=1e-6)
    twist = twisted(t, rim, nu, rod_modulus, fine)
    stub_twist = brentq(lambda saddle: Theory(2, t, rim, nu, REISSNER, stub, saddle).of_twist() / twist - 1,
                        -0.9, 500, xtol=1e-6)
    of = theory(stub)
    offset = (rise[0, 1] - of[0, 2]) / of[1, 2]
    found = {"stub": stub, "stub_twist": stub_twist, "offset": offset / t**2,
             "axial": rise[0, 0] - of[0, 0] - 2 * offset * of[0, 1] - offset**2 * of[1, 1]}
    turn, shear = Theory(1, t, rim, nu, REISSNER, stub, stub_twist).of_lift()
    sheared = (lifted - turn * np.array([t / 2, 1])) / shear if t >= 1 else np.zeros(2)
    for name, kappa in (("", REISSNER), ("kirchhoff_", RIGID_IN_SHEAR)):
        more = push - Theory(1, t, rim, nu, kappa, stub, stub_twist).of_push(t, sheared)
        found |= {f"{name}side": more[0, 0], f"{name}side_turn": more[0, 1], f"{name}turn": more[1, 1]}
    return found | {"sheared_side": sheared[0] / t, "sheared_turn": sheared[1]}


def foot(nu: float, fine: int = 1) -> tuple[float, float]:
    """By how many radii a rod is as if shorter in tension, and in bending, whose foot is held at all points: it cannot
    contract there. The rod is a plate of its own radius, held below and loaded above."""
    shorter = []
    for harmonic, height in ((0, lambda r: 2 * r), (1, lambda r: 4 * r**2)):
        rod = Column(LENGTH, nu, harmonic, fine)
        look = rod.lines_z[abs(rod.lines_z - LOOK).argmin()]
        top, at = (rod.integral(2, height, z=z) for z in (LENGTH, look))
        stiff = np.pi if harmonic == 0 else np.pi / 4
        shorter.append(float(look - stiff * at @ rod.moved(top)))
    return shorter[0], shorter[1]


def rod_joint(out: Path) -> Iterator[Row]:
    """A row a geometry and pair of materials."""
    for a, nu, modulus in itertools.product(RADIUS_OVER_THICKNESS, POISSON_RATIO, ROD_OVER_PLATE):
        yield Row({"radius_over_thickness": a, "poisson_ratio": nu, "rod_over_plate": modulus},
                  partial(joint, a, nu, modulus))


def rod_joint_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    rows.to_csv(JOINTS, index=False, float_format="%.5g")
    return rows
