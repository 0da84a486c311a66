"""Motion of the plate in its plane: it sways and yaws as a rigid body, or stretches (plane stress, bicubics).

A plate that nothing but rods holds stretches where its first mode within the plane is among its lowest. The elements
have a grid of their own, far coarser than that of bending.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from common.scene.plate import FlexiblePlate
from plate_fem.elements import mesh, products
from plate_fem.elements.products import Products, integral

CELLS_PER_WAVELENGTH = 4  # of shear
LOWEST = 25  # modes of plate and rods, among which one within the plane counts
EDGE = 1.7  # of Weyl's law for bending waves at free edges, nu = 0.3 (Bogomolny and Hugues 1998, Phys. Rev. E 57:5404)


@dataclass(frozen=True)
class InPlane:
    """Unknowns of the motion in the plane: sway along x and y (m) and yaw (rad), or the coefficients of u_x, then u_y.

    `functions` are those of u_x and of u_y, none of a plate that is rigid in its plane.
    """

    plate: FlexiblePlate
    functions: Products | None

    @property
    def size(self) -> int:
        return 3 if self.functions is None else 2 * self.functions.size

    def displacement(self, points_m: np.ndarray, axis: int) -> sp.csr_array:
        """Return the sparse matrix (k, size) of the mid-plane's displacement along x or y (axis) at points (k, 2)."""
        if self.functions is not None:
            return self._derived(points_m, axis, (0, 0))
        arm = -points_m[:, 1] if axis == 0 else points_m[:, 0]
        return sp.csr_array(np.column_stack([0 * arm + (axis == 0), 0 * arm + (axis == 1), arm]))

    def turn(self, points_m: np.ndarray) -> sp.csr_array:
        """Return the sparse matrix (k, size) of the turn about the normal (rad) at points (k, 2)."""
        if self.functions is None:
            return sp.csr_array(np.tile([0.0, 0.0, 1.0], (len(points_m), 1)))
        return sp.csr_array((self._derived(points_m, 1, (1, 0)) - self._derived(points_m, 0, (0, 1))) / 2)

    def _derived(self, points_m: np.ndarray, axis: int, derivative: tuple[int, int]) -> sp.csr_array:
        assert self.functions is not None
        rows = self.functions.values(points_m, derivative)
        return sp.csr_array((rows.data, rows.indices + axis * self.functions.size, rows.indptr),
                            shape=(len(points_m), self.size))

    def matrices(self) -> tuple[sp.csr_array, sp.csr_array]:
        """Return stiffness and mass: the energies are E t/(1 - nu^2) [(1 - nu) e:e + nu (tr e)^2]/2, e = sym grad u,
        and rho t |u'|^2/2."""
        plate, u = self.plate, self.functions
        mass, stiff = plate.density_kg_m3 * plate.thickness_m, plate.youngs_modulus_Pa * plate.thickness_m
        if u is None:
            whole = mass * plate.length_m * plate.width_m
            inertia = whole * (plate.length_m**2 + plate.width_m**2) / 12
            return sp.csr_array((3, 3)), sp.diags_array([whole, whole, inertia], format="csr")
        stiffness = stiff / (1 - plate.poisson_ratio**2) * strain_energy(u, plate.poisson_ratio)
        return sp.csr_array(stiffness), sp.block_diag(2 * [mass * integral(u, u)], format="csr")


def strain_energy(u: Products, poisson_ratio: float) -> sp.csr_array:
    """Return the matrix (2 u.size, 2 u.size) of the integral of (1 - nu) e:e + nu (tr e)^2, e = sym grad u, for two
    components with functions u: the displacement in the plane, or the rotations in bending."""
    xx, yy = integral(u, u, (1, 0), (1, 0)), integral(u, u, (0, 1), (0, 1))
    xy, twist = integral(u, u, (1, 0), (0, 1)), (1 - poisson_ratio) / 2  # times e_xy + e_yx squared
    mixed = poisson_ratio * xy + twist * xy.T
    return sp.csr_array(sp.block_array([[xx + twist * yy, mixed], [mixed.T, yy + twist * xx]]))


def in_plane(plate: FlexiblePlate) -> InPlane:
    """Return the motion in its plane that the plate has: it stretches if it sways and its first mode there is low."""
    if not (sways(plate) and first_is_low(plate)):
        return InPlane(plate, None)
    shear_modulus = plate.youngs_modulus_Pa / (2 * (1 + plate.poisson_ratio))
    wavelength = math.sqrt(shear_modulus / plate.density_kg_m3) / mesh.highest_frequency_Hz(plate)
    lines = [np.linspace(-side / 2, side / 2, 1 + max(2, math.ceil(CELLS_PER_WAVELENGTH * side / wavelength)))
             for side in (plate.length_m, plate.width_m)]
    return InPlane(plate, products.rotations(*lines))


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
    area, edges = plate.length_m * plate.width_m, 2 * (plate.length_m + plate.width_m)
    return (area * wavenumber**2 + EDGE * edges * wavenumber) / (4 * math.pi) + 3 < LOWEST


def first_Hz_of(plate: FlexiblePlate) -> float:
    """Return about the lowest frequency of free modes within the plane: bending of the longer side as a beam, with the
    compliance in shear that a square needs (its first is at 2.32/(pi L) sqrt(E/(rho (1 - nu^2))) / 2)."""
    longer, shorter = max(plate.length_m, plate.width_m), min(plate.length_m, plate.width_m)
    speed = math.sqrt(plate.youngs_modulus_Pa / plate.density_kg_m3)
    return speed / longer / math.hypot(longer / (1.03 * shorter), 1 / 0.418)
