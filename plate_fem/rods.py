"""Rods below the plate: bars in tension and clamped beams in bending, tied to the plate over their disc."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import skfem
from skfem.helpers import dd, ddot, dot, grad

from common.plate import Rod
from plate_fem.system import PlateSystem

CELLS_PER_WAVELENGTH = 8
RADII, ANGLES = 6, 24  # points of the quadrature over a disc


def disc_quadrature(x_m: float, y_m: float, radius_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return points (k, 2) in m and weights (k,) of sum one, for the mean over a disc."""
    s, w = np.polynomial.legendre.leggauss(RADII)
    r = radius_m * np.sqrt((s + 1) / 2)  # equal weight per area
    angle = 2 * math.pi * (np.arange(ANGLES) + 0.5) / ANGLES
    x = x_m + np.outer(r, np.cos(angle))
    y = y_m + np.outer(r, np.sin(angle))
    weights = np.repeat(w / 2 / ANGLES, ANGLES)
    return np.column_stack([x.ravel(), y.ravel()]), weights


@dataclass(frozen=True)
class Part:
    """A bar or beam over its own local unknowns.

    The unknown `top` is what `row`, sparse (1, n), gives from the unknowns of the plate. Those in `held` are zero,
    and the others belong to the part alone.
    """

    stiffness: sp.csr_array
    mass: sp.csr_array
    top: int
    row: sp.csr_array
    held: tuple[int, ...]

    def tie(self) -> sp.csr_array:
        """Return the sparse matrix that gives the local unknowns from those of the plate and the part's own."""
        n_local = self.stiffness.shape[0]
        own = np.setdiff1d(np.arange(n_local), [self.top, *self.held])
        pick_top = sp.csr_array(([1.0], ([self.top], [0])), shape=(n_local, 1))
        pick_own = sp.csr_array((np.ones(len(own)), (own, np.arange(len(own)))), shape=(n_local, len(own)))
        return sp.csr_array(sp.hstack([pick_top @ self.row, pick_own]))


def attach(system: PlateSystem, rod: Rod, max_frequency_Hz: float) -> tuple[Part, list[Part]]:
    """Return the bar and the two beams (in the planes xz and yz) that a rod adds to a plate.

    The top of the rod has the mean deflection and the mean rotation of the plate over its disc. Its lateral
    displacement is zero, since the plate has none, so that the beam's stiffness against rotation is 4EI/l instead of
    EI/l.
    """
    points, weights = disc_quadrature(rod.x_m, rod.y_m, rod.diameter_m / 2)
    mean = sp.csr_array(weights[None, :])
    stiffness, mass, top, base = _bar(rod, max_frequency_Hz)
    bar = Part(stiffness, mass, top[0], mean @ system.deflection(points), (base[0],))
    stiffness, mass, top, base = _beam(rod, max_frequency_Hz)
    held = (top[0], *base)
    beams = [Part(stiffness, mass, top[1], mean @ system.rotation(points, axis), held) for axis in (0, 1)]
    return bar, beams


def base_force_row(bar: Part) -> sp.csr_array:
    """Return the sparse row (1, n_local) that gives the axial force (N, tension positive) at the base of a bar."""
    return -sp.csr_array(bar.stiffness)[list(bar.held)]


def _line(rod: Rod, wavelength_m: float) -> skfem.MeshLine:
    n = max(2, math.ceil(CELLS_PER_WAVELENGTH * rod.length_m / wavelength_m))
    return skfem.MeshLine(np.linspace(0.0, rod.length_m, n + 1))  # from the plate down to the base


def _area(rod: Rod) -> float:
    return math.pi * rod.diameter_m**2 / 4


def _bar(rod: Rod, max_frequency_Hz: float) -> tuple[sp.csr_array, sp.csr_array, np.ndarray, np.ndarray]:
    """Return stiffness and mass of the bar, and the unknowns at its top and at its base."""
    speed = math.sqrt(rod.youngs_modulus_Pa / rod.density_kg_m3)
    basis = skfem.Basis(_line(rod, speed / max_frequency_Hz), skfem.ElementLineP2(), intorder=4)
    axial, inertia = rod.youngs_modulus_Pa * _area(rod), rod.density_kg_m3 * _area(rod)
    stiffness = skfem.BilinearForm(lambda u, v, _: axial * dot(grad(u), grad(v))).assemble(basis)
    mass = skfem.BilinearForm(lambda u, v, _: inertia * u * v).assemble(basis)
    return stiffness, mass, basis.nodal_dofs[:, 0], basis.nodal_dofs[:, -1]


def _beam(rod: Rod, max_frequency_Hz: float) -> tuple[sp.csr_array, sp.csr_array, np.ndarray, np.ndarray]:
    """Return stiffness and mass of the Euler-Bernoulli beam, and the unknowns (v, v') at its top and at its base."""
    bending = rod.youngs_modulus_Pa * math.pi * rod.diameter_m**4 / 64
    inertia = rod.density_kg_m3 * _area(rod)
    wavelength = 2 * math.pi * (bending / inertia) ** 0.25 / math.sqrt(2 * math.pi * max_frequency_Hz)
    basis = skfem.Basis(_line(rod, wavelength), skfem.ElementLineHermite(), intorder=6)
    stiffness = skfem.BilinearForm(lambda u, v, _: bending * ddot(dd(u), dd(v))).assemble(basis)
    mass = skfem.BilinearForm(lambda u, v, _: inertia * u * v).assemble(basis)
    return stiffness, mass, basis.nodal_dofs[:, 0], basis.nodal_dofs[:, -1]
