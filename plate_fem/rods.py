"""Rods below the plate: bars in tension and clamped beams in bending, tied to the plate over their disc."""

import math
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import skfem
from skfem.helpers import dd, ddot, dot, grad

CELLS_PER_WAVELENGTH = 8


def disc_quadrature(x_m, y_m, radius_m, n_radial=6, n_angular=24):
    """Points (k, 2) and weights (k,), of sum one, of the mean over a disc."""
    s, w = np.polynomial.legendre.leggauss(n_radial)
    r = radius_m * np.sqrt((s + 1) / 2)  # equal weight per area
    angle = 2 * math.pi * (np.arange(n_angular) + 0.5) / n_angular
    x = x_m + np.outer(r, np.cos(angle))
    y = y_m + np.outer(r, np.sin(angle))
    weights = np.repeat(w / 2 / n_angular, n_angular)
    return np.column_stack([x.ravel(), y.ravel()]), weights


@dataclass(frozen=True)
class Part:
    """A bar or beam over its own local unknowns.

    The unknown `top` follows `row` (sparse (1, n)) over the unknowns of the plate, those in `held` are
    zero, the others are its own.
    """

    stiffness: sp.csr_array
    mass: sp.csr_array
    top: int
    row: sp.csr_array
    held: tuple

    def tie(self):
        """Sparse matrix from [unknowns of the plate, own unknowns] to the local unknowns."""
        n_local = self.stiffness.shape[0]
        own = np.setdiff1d(np.arange(n_local), [self.top, *self.held])
        pick_top = sp.csr_array(([1.0], ([self.top], [0])), shape=(n_local, 1))
        pick_own = sp.csr_array((np.ones(len(own)), (own, np.arange(len(own)))), shape=(n_local, len(own)))
        return sp.csr_array(sp.hstack([pick_top @ self.row, pick_own]))


def attach(system, rod, max_frequency_Hz):
    """Return (bar, [beam in xz, beam in yz]), the parts that a rod adds to a PlateSystem.

    The top of the rod follows the mean deflection and the mean rotation of the plate over its disc. Its
    lateral displacement is zero there, since the model has none (stiffness 4EI/l instead of EI/l).
    """
    points, weights = disc_quadrature(rod.x_m, rod.y_m, rod.diameter_m / 2)
    mean = sp.csr_array(weights[None, :])
    stiffness, mass, top, base = _bar(rod, max_frequency_Hz)
    bar = Part(stiffness, mass, top[0], mean @ system.deflection(points), (base[0],))
    stiffness, mass, top, base = _beam(rod, max_frequency_Hz)
    held = (top[0], *base)
    beams = [Part(stiffness, mass, top[1], mean @ system.rotation(points, axis), held) for axis in (0, 1)]
    return bar, beams


def base_force_row(bar):
    """Sparse (1, n_local): axial force (N, tension positive) at the base of a bar."""
    return -sp.csr_array(bar.stiffness)[list(bar.held)]


def _line(rod, wavelength_m):
    n = max(2, math.ceil(CELLS_PER_WAVELENGTH * rod.length_m / wavelength_m))
    return skfem.MeshLine(np.linspace(0.0, rod.length_m, n + 1))  # from the plate down to the base


def _area(rod):
    return math.pi * rod.diameter_m**2 / 4


def _bar(rod, max_frequency_Hz):
    """Stiffness and mass of the bar, unknowns at its top and at its base."""
    speed = math.sqrt(rod.youngs_modulus_Pa / rod.density_kg_m3)
    basis = skfem.Basis(_line(rod, speed / max_frequency_Hz), skfem.ElementLineP2(), intorder=4)
    axial, inertia = rod.youngs_modulus_Pa * _area(rod), rod.density_kg_m3 * _area(rod)
    stiffness = skfem.BilinearForm(lambda u, v, _: axial * dot(grad(u), grad(v))).assemble(basis)
    mass = skfem.BilinearForm(lambda u, v, _: inertia * u * v).assemble(basis)
    return stiffness, mass, basis.nodal_dofs[:, 0], basis.nodal_dofs[:, -1]


def _beam(rod, max_frequency_Hz):
    """Stiffness and mass of the Euler-Bernoulli beam, unknowns (v, v') at its top and at its base."""
    bending = rod.youngs_modulus_Pa * math.pi * rod.diameter_m**4 / 64
    inertia = rod.density_kg_m3 * _area(rod)
    wavelength = 2 * math.pi * (bending / inertia) ** 0.25 / math.sqrt(2 * math.pi * max_frequency_Hz)
    basis = skfem.Basis(_line(rod, wavelength), skfem.ElementLineHermite(), intorder=6)
    stiffness = skfem.BilinearForm(lambda u, v, _: bending * ddot(dd(u), dd(v))).assemble(basis)
    mass = skfem.BilinearForm(lambda u, v, _: inertia * u * v).assemble(basis)
    return stiffness, mass, basis.nodal_dofs[:, 0], basis.nodal_dofs[:, -1]
