"""The highest frequency of a network of bonds, which bounds the stable time step."""

from __future__ import annotations

import numpy as np
from scipy.sparse import diags
from scipy.sparse.linalg import eigsh

from dem.stones.bonds import Bonds, stiffness_matrix


def highest_frequency_rad_s(bonds: Bonds, modulus_Pa: float, stiffness_ratio: float, mass_kg: np.ndarray,
                            radius_m: np.ndarray, volumetric_ratio: float = 0.0) -> float:
    """Of the network, sub-spheres with mass and radius (n,) and spin inertia 0.4 m R^2.

    The leapfrog scheme is stable below a time step of 2 over this frequency, where nothing damps.
    """
    inertia = np.column_stack([np.repeat(mass_kg[:, None], 3, axis=1),
                               np.repeat(0.4 * (mass_kg * radius_m**2)[:, None], 3, axis=1)]).ravel()
    scale = diags(1 / np.sqrt(inertia))
    matrix = stiffness_matrix(len(mass_kg), bonds, modulus_Pa, stiffness_ratio, volumetric_ratio)
    largest = eigsh(scale @ matrix @ scale, k=1, which="LA", tol=1e-6, return_eigenvectors=False,
                    v0=np.random.default_rng(1).normal(size=matrix.shape[0]))
    return float(np.sqrt(largest[0]))
