"""The number of modes that a plate may have, and its least number, known before any is sought."""

from __future__ import annotations

import math

from common.scene.plate import FlexiblePlate
from common.tables import Refused
from plate_fem.elements.mesh import bending_wavenumber, choose_theory, highest_frequency_Hz

MODES_AT_MOST = 600  # four times those of the default scene; 538 take 72 s and 2.8 GB (docs/plate.md)


def refuse_too_many_modes(plate: FlexiblePlate, most: int) -> None:
    """Raises Refused where a plate has more modes than `most` for sure: more than Weyl's area k^2/(4 pi), the edges of
    which add some more. Raises ValueError for a table that leaves its frequency to a tolerance."""
    frequency_Hz = highest_frequency_Hz(plate)
    if least_modes(plate, frequency_Hz) <= most:
        return
    allowed_Hz = frequency_Hz
    while least_modes(plate, allowed_Hz) > 0.8 * most:  # the rest is left to edges and rods
        allowed_Hz *= 0.98
    more = f"more than {least_modes(plate, frequency_Hz):.0f} modes of so large a plate"
    raise Refused("max_frequency_Hz", frequency_Hz, f"{more} lie below it, the limit is {most}: must be "
                  f"at most about {allowed_Hz:.2g}, or the plate smaller or thicker")


def least_modes(plate: FlexiblePlate, frequency_Hz: float) -> float:
    """Weyl's law without its term for the edges: area k^2/(4 pi), k the wavenumber of bending waves."""
    wavenumber = bending_wavenumber(plate, frequency_Hz, choose_theory(plate))
    return plate.length_m * plate.width_m * wavenumber**2 / (4 * math.pi)
