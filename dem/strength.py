"""How the strength of bonds goes with the size of sub-spheres."""

from __future__ import annotations

import numpy as np


def strength_scale(subsphere_radius_m, reference_radius_m: float, exponent: float) -> np.ndarray:
    """Factor on both strengths of a bond: (R/R_ref)^-exponent, in the shape of `subsphere_radius_m`.

    A crack in a bonded packing is blunted by one sub-sphere, so the packing's toughness is set by the strength of its
    bonds and by their size (D. O. Potyondy and P. A. Cundall, Int. J. Rock Mech. Min. Sci. 41 (2004) 1329):

        K_Ic = beta sigma_t sqrt(pi alpha R)

    What breaks in an impact is the area for which there is energy, 2 gamma = K_Ic^2 (1 - nu^2)/E for each m2. Toughness
    is kept, whatever the size of sub-spheres, by sigma ~ R^(-1/2), exponent 0.5. At exponent 0 the strength of a large
    unnotched specimen is kept instead; both together would need one size, R = (K_Ic/(beta sigma_t))^2/(pi alpha).
    docs/calibration.md has the exponents that were measured.

    Raises ValueError where a radius is not positive.
    """
    radius = np.asarray(subsphere_radius_m, dtype=float)
    if not np.all(radius > 0) or not reference_radius_m > 0:
        raise ValueError(f"radii of sub-spheres must be positive, not {subsphere_radius_m} and {reference_radius_m}")
    return (radius / reference_radius_m) ** -exponent
