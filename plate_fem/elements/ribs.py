"""Ribs: beams of the plate's material below it, along x or y, whose cross-sections follow the plate.

At the depth z of a rib's axis, below the mid-plane, a point of the cross-section moves along the rib by u - z theta, u
of the mid-plane. With A, I the area and second moment of the section about its own axis, and J of torsion, the energy
per length is

    E A (u' - z theta')^2/2 + E I theta'^2/2 + kappa G A (w' - theta)^2/2 + G J psi'^2/2,

with theta the turn along the rib and psi the one across it. That u' counts is why a plate with ribs stretches: the
neutral axis of both is found by itself. Across a rib the plate bends less: stress spreads into the rib at 45 degrees,
so that d from its side the plate is as stiff as one that is thicker by d. Bending of a rib sideways is left to the
plate.
"""

import numpy as np
import scipy.sparse as sp

from common.scene.plate import FlexiblePlate, Rib
from plate_fem.elements.mesh import bending_stiffness, gauss_points
from plate_fem.elements.system import PlateSystem

SHEAR_FACTOR = 5 / 6  # of a rectangle


def torsion_constant_m4(rib: Rib, plate_m: float) -> float:
    """Return J of a rectangle with its short side on a plate of a thickness, and of the joint of both (Roark's Formulas
    for Stress and Strain, T section).

    >>> alone = Rib(axis=0, at_m=0.0, section_m=(0.01, 0.1))
    >>> torsion_constant_m4(alone, 1e-3) / (0.1 * 0.01**3 / 3) > 1  # more than the rectangle's
    True
    """
    width, height = rib.section_m
    thin = width / height
    rectangle = height * width**3 * (1 / 3 - 0.105 * thin * (1 - thin**4 / 192))
    circle_m = (plate_m**2 + width**2 / 4) / plate_m  # the largest in the joint
    return rectangle + 0.15 * min(plate_m, width) / max(plate_m, width) * circle_m**4


def stiffness_across_N_m2(rib: Rib, plate: FlexiblePlate) -> float:
    """Return by how much a rib raises the bending stiffness across it, times its width: from D to 1/C, C the mean
    of the compliances t^3/(D (t + d)^3), d from 0 at its sides to half its width."""
    deep = rib.section_m[0] / (2 * plate.thickness_m)
    stiffer = 2 * deep / (1 - (1 + deep) ** -2)
    return rib.section_m[0] * bending_stiffness(plate) * (stiffer - 1)


def matrices(system: PlateSystem) -> tuple[sp.csr_array, sp.csr_array]:
    """Return stiffness and mass of all ribs, sparse (system.size, system.size)."""
    stiffness, mass = sp.csr_array((system.size, system.size)), sp.csr_array((system.size, system.size))
    for rib in system.plate.ribs:
        both = _of_rib(system, rib)
        stiffness, mass = stiffness + both[0], mass + both[1]
    return stiffness, mass


def momentum(system: PlateSystem) -> np.ndarray:
    """Return the integral (system.size,) of each unknown's deflection over the mass of all ribs, in kg."""
    total = np.zeros(system.size)
    for rib in system.plate.ribs:
        points_m, weight_m = _points(system, rib)
        total += system.plate.density_kg_m3 * rib.area_m2 * (weight_m @ system.deflection(points_m))
    return total


def _points(system: PlateSystem, rib: Rib) -> tuple[np.ndarray, np.ndarray]:
    """Return Gauss points (k, 2) on a rib and their weights (k,) in m."""
    along_m, weight_m = gauss_points((system.lines_x_m, system.lines_y_m)[rib.axis])
    points_m = np.full((len(along_m), 2), rib.at_m)
    points_m[:, rib.axis] = along_m
    return points_m, weight_m


def _of_rib(system: PlateSystem, rib: Rib) -> tuple[sp.csr_array, sp.csr_array]:
    plate, along, across = system.plate, rib.axis, 1 - rib.axis
    modulus, density, (width, height) = plate.youngs_modulus_Pa, plate.density_kg_m3, rib.section_m
    shear_modulus, area = modulus / (2 * (1 + plate.poisson_ratio)), rib.area_m2
    points_m, weight_m = _points(system, rib)
    z_m = -(plate.thickness_m + height) / 2
    once = (1, 0) if along == 0 else (0, 1)
    second_moment, sideways = area * height**2 / 12, area * width**2 / 12
    theta, psi = system.rotation(points_m, along), system.rotation(points_m, across)
    half_m = np.array([0.0, width / 2] if along == 0 else [width / 2, 0.0])
    sides = [system.rotation(points_m + side * half_m, across) for side in (-1, 1)]
    stiff = [(modulus * area, system.lateral(points_m, along, z_m, once)),
             (modulus * second_moment, system.rotation(points_m, along, once)),
             (SHEAR_FACTOR * shear_modulus * area, system.deflection(points_m, once) - theta),
             (shear_modulus * torsion_constant_m4(rib, plate.thickness_m), system.rotation(points_m, across, once)),
             (stiffness_across_N_m2(rib, plate), (sides[1] - sides[0]) / width)]
    heavy = [(density * area, rows) for rows in (system.deflection(points_m), system.lateral(points_m, along, z_m),
                                                 system.lateral(points_m, across, z_m))]
    heavy += [(density * second_moment, theta), (density * (second_moment + sideways), psi)]
    stiffness, mass = (sum(rows.T @ sp.diags_array(of * weight_m) @ rows for of, rows in terms)
                       for terms in (stiff, heavy))
    return sp.csr_array(stiffness), sp.csr_array(mass)
