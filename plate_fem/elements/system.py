"""Stiffness and mass matrices of the plate, for thin (Kirchhoff) and shear-flexible (Mindlin) theory.

In both the deflection w is of splines along both sides, with all derivatives but the highest continuous, which take far
fewer unknowns for a wavelength than elements with continuous slopes (isogeometric analysis: Cottrell, Reali, Bazilevs
and Hughes 2006, Comput. Methods Appl. Mech. Eng. 195:5257). Mindlin's rotations are the spaces of its two derivatives,
of one degree less along that side. The thin limit theta = grad w is therefore reached without any loss of freedom, and
the plate cannot lock, although every integral is exact (Beirao da Veiga, Buffa, Lovadina, Martinelli and Sangalli 2012,
Comput. Methods Appl. Mech. Eng. 209-212:45).

In its plane it sways and yaws as a rigid body, or stretches (plane stress, bicubics). A plate that nothing but rods
holds stretches where its first mode within the plane is among its lowest; the elements have a grid of their own then,
far coarser than that of bending. With ribs it stretches wherever it bends, on the same grid.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from common.scene.plate import FlexiblePlate
from plate_fem.elements import mesh
from plate_fem.elements.mesh import Products, integral

CELLS_PER_WAVELENGTH, LEAST_CELLS = 12, 6  # of shear; along a side
LOWEST = 25  # modes of plate and rods, among which one within the plane counts
EDGE = 1.7  # of Weyl's law for bending waves at free edges, nu = 0.3 (Bogomolny and Hugues 1998, Phys. Rev. E 57:5404)


@dataclass(frozen=True)
class InPlane:
    """Unknowns of the motion in the plane: sway along x and y (m) and yaw (rad), or the coefficients of u_x, then u_y.

    `functions` are those of u_x and of u_y, none of a plate that is rigid in its plane.
    """

    plate: FlexiblePlate
    functions: tuple[Products, Products] | None

    @property
    def size(self) -> int:
        return 3 if self.functions is None else sum(one.size for one in self.functions)

    def displacement(self, points_m: np.ndarray, axis: int, derivative: tuple[int, int] = (0, 0)) -> sp.csr_array:
        """Return the sparse matrix (k, size) of the mid-plane's displacement along x or y (axis) at points (k, 2), or
        of a derivative of it where the plate stretches."""
        if self.functions is not None:
            return self._derived(points_m, axis, derivative)
        arm = -points_m[:, 1] if axis == 0 else points_m[:, 0]
        return sp.csr_array(np.column_stack([0 * arm + (axis == 0), 0 * arm + (axis == 1), arm]))

    def turn(self, points_m: np.ndarray) -> sp.csr_array:
        """Return the sparse matrix (k, size) of the turn about the normal (rad) at points (k, 2)."""
        if self.functions is None:
            return sp.csr_array(np.tile([0.0, 0.0, 1.0], (len(points_m), 1)))
        return sp.csr_array((self._derived(points_m, 1, (1, 0)) - self._derived(points_m, 0, (0, 1))) / 2)

    def _derived(self, points_m: np.ndarray, axis: int, derivative: tuple[int, int]) -> sp.csr_array:
        assert self.functions is not None
        rows = self.functions[axis].values(points_m, derivative)
        return sp.csr_array((rows.data, rows.indices + axis * self.functions[0].size, rows.indptr),
                            shape=(len(points_m), self.size))

    def matrices(self) -> tuple[sp.csr_array, sp.csr_array]:
        """Return stiffness and mass: the energies are E t/(1 - nu^2) [(1 - nu) e:e + nu (tr e)^2]/2, e = sym grad u,
        and rho t |u'|^2/2."""
        plate, u = self.plate, self.functions
        mass, stiff = plate.density_kg_m3 * plate.thickness_m, plate.youngs_modulus_Pa * plate.thickness_m
        if u is None:
            whole = mass * math.prod(plate.size_m)
            inertia = whole * (plate.size_m[0]**2 + plate.size_m[1]**2) / 12
            return sp.csr_array((3, 3)), sp.diags_array([whole, whole, inertia], format="csr")
        stiffness = stiff / (1 - plate.poisson_ratio**2) * strain_energy(*u, plate.poisson_ratio)
        return sp.csr_array(stiffness), one_after_the_other([mass * integral(one, one) for one in u])


def strain_energy(u: Products, v: Products, poisson_ratio: float) -> sp.csr_array:
    """Return the matrix (u.size + v.size, the same) of the integral of (1 - nu) e:e + nu (tr e)^2, e = sym grad (u, v),
    for two components with functions u and v: the displacement in the plane, or the rotations in bending."""
    u_x, u_y, v_x, v_y = (integral(one, one, by, by) for one in (u, v) for by in ((1, 0), (0, 1)))
    twist = (1 - poisson_ratio) / 2  # times (u_y + v_x)^2
    mixed = poisson_ratio * integral(u, v, (1, 0), (0, 1)) + twist * integral(u, v, (0, 1), (1, 0))
    return _joined(u_x + twist * u_y, mixed, v_y + twist * v_x)


def in_plane(plate: FlexiblePlate) -> InPlane:
    """Return the motion in its plane that the plate has: it stretches if it has ribs, or sways and its first mode there
    is low."""
    if plate.ribs:
        return InPlane(plate, mesh.rotations(*mesh.mesh_lines(plate)))
    if not (sways(plate) and first_is_low(plate)):
        return InPlane(plate, None)
    shear_modulus = plate.youngs_modulus_Pa / (2 * (1 + plate.poisson_ratio))
    wavelength = math.sqrt(shear_modulus / plate.density_kg_m3) / mesh.highest_frequency_Hz(plate)
    lines = [np.linspace(-side / 2, side / 2, 1 + max(LEAST_CELLS, math.ceil(CELLS_PER_WAVELENGTH * side / wavelength)))
             for side in plate.size_m]
    return InPlane(plate, mesh.rotations(*lines))


def sways(plate: FlexiblePlate) -> bool:
    """Return whether the plate can move in its plane: it stands on rods, which bend, and on nothing else."""
    return bool(plate.rods) and plate.edges == "free"


def first_is_low(plate: FlexiblePlate) -> bool:
    """Return whether the first mode within the plane is below `max_frequency_Hz` and among the LOWEST, by Weyl's law
    for bending waves and three modes of sway and yaw."""
    first_Hz = first_Hz_of(plate)
    if first_Hz >= mesh.highest_frequency_Hz(plate):
        return False
    wavenumber = mesh.bending_wavenumber(plate, first_Hz, mesh.choose_theory(plate))
    area, edges = math.prod(plate.size_m), 2 * sum(plate.size_m)
    return (area * wavenumber**2 + EDGE * edges * wavenumber) / (4 * math.pi) + 3 < LOWEST


def first_Hz_of(plate: FlexiblePlate) -> float:
    """Return about the lowest frequency of free modes within the plane: bending of the longer side as a beam, with the
    compliance in shear that a square needs (its first is at 2.32/(pi L) sqrt(E/(rho (1 - nu^2))) / 2)."""
    longer, shorter = max(plate.size_m), min(plate.size_m)
    speed = math.sqrt(plate.youngs_modulus_Pa / plate.density_kg_m3)
    return speed / longer / math.hypot(longer / (1.03 * shorter), 1 / 0.418)


@dataclass(frozen=True)
class PlateSystem:
    """All unknowns: those of w, then of Mindlin's theta_x and theta_y, and last of the motion in the plane.

    `fixed` holds the numbers of the unknowns that are held at zero: by the edges, and those of the motion in the plane
    unless the plate stands on rods alone.
    """

    plate: FlexiblePlate
    theory: str
    lines_x_m: np.ndarray
    lines_y_m: np.ndarray
    fixed: np.ndarray
    deflections: Products
    rotations: tuple[Products, Products] | None  # of theta_x and theta_y (Mindlin)
    in_plane: InPlane

    @property
    def size(self) -> int:
        return self.deflections.size + sum(one.size for one in self.rotations or ()) + self.in_plane.size

    def _placed(self, rows: sp.csr_array, start: int) -> sp.csr_array:
        """Return rows (k, n) over n unknowns from number `start` on as rows over all, (k, size)."""
        return sp.csr_array((rows.data, rows.indices + start, rows.indptr), shape=(rows.shape[0], self.size))

    def deflection(self, points_m: np.ndarray, derivative: tuple[int, int] = (0, 0)) -> sp.csr_array:
        """Return the sparse matrix (k, size) that evaluates w, or a derivative of it, at points (k, 2)."""
        return self._placed(self.deflections.values(points_m, derivative), 0)

    def rotation(self, points_m: np.ndarray, axis: int, derivative: tuple[int, int] = (0, 0)) -> sp.csr_array:
        """Return the sparse matrix (k, size) that evaluates theta_x (axis 0) or theta_y (axis 1), or a derivative
        of it, at points (k, 2)."""
        if self.rotations is None:
            return self.deflection(points_m, (derivative[0] + (axis == 0), derivative[1] + (axis == 1)))
        before = self.deflections.size + axis * self.rotations[0].size
        return self._placed(self.rotations[axis].values(points_m, derivative), before)

    def curvature(self, points_m: np.ndarray) -> tuple[sp.csr_array, sp.csr_array, sp.csr_array]:
        """Return the sparse matrices (k, size) of theta_x,x, theta_y,y and theta_x,y + theta_y,x at points (k, 2)."""
        x, y = ((1, 0), (0, 1))
        twist = self.rotation(points_m, 0, y) + self.rotation(points_m, 1, x)
        return self.rotation(points_m, 0, x), self.rotation(points_m, 1, y), sp.csr_array(twist)

    def stretch(self, points_m: np.ndarray) -> tuple[sp.csr_array, sp.csr_array, sp.csr_array]:
        """Return the sparse matrices (k, size) of the strain of the mid-plane at points (k, 2): xx, yy, 2 xy."""
        if self.in_plane.functions is None:
            return (sp.csr_array((len(points_m), self.size)),) * 3
        before = self.size - self.in_plane.size
        (x_x, x_y), (y_x, y_y) = ([self._placed(self.in_plane.displacement(points_m, axis, by), before)
                                   for by in ((1, 0), (0, 1))] for axis in (0, 1))
        return x_x, y_y, sp.csr_array(x_y + y_x)

    def lateral(self, points_m: np.ndarray, axis: int, z_m: float,
                derivative: tuple[int, int] = (0, 0)) -> sp.csr_array:
        """Return the sparse matrix (k, size) of the displacement along x (axis 0) or y (axis 1) at points (k, 2), z_m
        above the mid-plane, or of a derivative of it where the plate stretches: that of the mid-plane less z theta."""
        points = np.atleast_2d(np.asarray(points_m, float))
        middle = self._placed(self.in_plane.displacement(points, axis, derivative), self.size - self.in_plane.size)
        return sp.csr_array(middle - z_m * self.rotation(points, axis, derivative))

    def yaw(self, points_m: np.ndarray) -> sp.csr_array:
        """Return the sparse matrix (k, size) of the turn about the normal at points (k, 2)."""
        return self._placed(self.in_plane.turn(points_m), self.size - self.in_plane.size)


def assemble(plate: FlexiblePlate) -> tuple[PlateSystem, sp.csr_array, sp.csr_array]:
    """Return the unknowns of a plate without rods, and its stiffness and mass, sparse (size, size). Raises
    Refused for a mesh that is too large."""
    theory = mesh.choose_theory(plate)
    lines_x, lines_y = mesh.mesh_lines(plate)
    w = mesh.deflections(lines_x, lines_y)
    theta = None if theory == "kirchhoff" else mesh.rotations(lines_x, lines_y)
    stiffness, mass = _kirchhoff(plate, w) if theta is None else _mindlin(plate, w, theta)
    held = [_held_by_edges(w, theta, plate.edges)]
    inside = in_plane(plate)
    stiffness, mass = (one_after_the_other(both) for both in zip((stiffness, mass), inside.matrices(), strict=True))
    if not sways(plate):
        held.append(stiffness.shape[0] - inside.size + np.arange(inside.size))
    return (PlateSystem(plate, theory, w.along_x.lines_m, w.along_y.lines_m, np.concatenate(held), w, theta, inside),
            stiffness, mass)


def grown(matrix: sp.csr_array, size: int) -> sp.csr_array:
    """Append rows and columns of zeros to a square matrix."""
    start = np.append(matrix.indptr, np.full(size - matrix.shape[0], matrix.indptr[-1]))
    return sp.csr_array((matrix.data, matrix.indices, start), shape=(size, size))


def one_after_the_other(blocks: Sequence[sp.csr_array]) -> sp.csr_array:
    """Return the matrix of square blocks along its diagonal, in a fraction of the time that sp.block_diag takes."""
    end = list(itertools.accumulate(block.shape[0] for block in blocks))
    placed = [(block.data, block.indices + (last - block.shape[0]), block.indptr)
              for block, last in zip(blocks, end, strict=True)]
    return sp.csr_array(sp.vstack([sp.csr_array(one, shape=(len(one[2]) - 1, end[-1])) for one in placed]))


def _joined(first: sp.csr_array, mixed: sp.csr_array, second: sp.csr_array) -> sp.csr_array:
    """Return the symmetric matrix [[first, mixed], [mixed.T, second]]."""
    return sp.csr_array(sp.vstack([sp.hstack([first, mixed]), sp.hstack([mixed.T.tocsr(), second])]))


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


def _mindlin(plate: FlexiblePlate, w: Products, theta: tuple[Products, Products]) -> tuple[Any, Any]:
    """Return stiffness and mass.

    The energy is the integral of D [(1 - nu) e:e + nu (tr e)^2] / 2 + S |grad w - theta|^2 / 2, e = sym grad theta.
    """
    t, nu = plate.thickness_m, plate.poisson_ratio
    bending, shear, mass_per_area = mesh.bending_stiffness(plate), mesh.shear_stiffness(plate), plate.density_kg_m3 * t
    values = [integral(one, one) for one in theta]
    k_ww = shear * (integral(w, w, (1, 0), (1, 0)) + integral(w, w, (0, 1), (0, 1)))
    k_wt = -shear * sp.hstack([integral(w, one, by) for one, by in zip(theta, ((1, 0), (0, 1)), strict=True)])
    k_tt = bending * strain_energy(*theta, nu) + shear * one_after_the_other(values)
    rotary = [mass_per_area * t**2 / 12 * one for one in values]
    return _joined(k_ww, k_wt, k_tt), one_after_the_other([mass_per_area * integral(w, w), *rotary])


def _held_by_edges(w: Products, theta: tuple[Products, Products] | None, edges: str) -> np.ndarray:
    """Return the unknowns that edges hold. A simply supported one holds w and, in Mindlin's theory, the rotation along
    the edge (hard): theta_y on x = const, theta_x on y = const. A clamped one holds both rotations, or the slope."""
    if edges == "free":
        return np.array([], int)
    clamped, ends = edges == "clamped", [0, -1]
    if theta is None:
        ends = [0, 1, -2, -1] if clamped else ends
        return np.union1d(w.number[ends], w.number[:, ends])
    w_held = np.union1d(w.number[ends], w.number[:, ends])
    x, y = theta
    x_held = np.union1d(x.number[:, ends], x.number[ends] if clamped else [])
    y_held = np.union1d(y.number[ends], y.number[:, ends] if clamped else [])
    return np.concatenate([w_held, w.size + x_held, w.size + x.size + y_held]).astype(int)
