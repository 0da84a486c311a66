"""The plate of a run as stones strike it: its modes, its mobility, the energy that the modes leave out, and warnings of
what they are not to be trusted for.

A short impact puts the energy |F(omega)|^2 / 2 into each mode of unit mass at the point of impact, F being the
spectrum of the force. A plate has equally many modes in all bands of equal width. The share of the energy that
belongs to modes above a frequency is therefore the share of the spectrum |F|^2 above it, whatever the plate.
"""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from common.scene.plate import FlexiblePlate, PlateTable
from common.tables import InputError
from plate_fem.elements import mesh, system
from plate_fem.elements.rods import joint_range
from plate_fem.modes import PlateModes, modes_for_loads
from plate_fem.motion import RecordedMotion

TOGETHER_s = 0.1  # stones that arrive within this time are taken to touch at once
COARSER = 1.01  # than the mesh that the highest mode needs
LEAST_SPAN = 10  # the shorter side in thicknesses
MOST_LEFT_OUT = 0.05  # of the plate's energy above its modes
MOST_DEFLECTION = 0.5  # over the thickness: beyond, a plate stretches as it bends (von Karman)


class StruckPlate(NamedTuple):
    """What a run needs of its plate: the modes, their mobility where stones push at once, and the share of energy that
    would belong to modes above them."""

    modes: PlateModes
    mobility_1_kg: float
    energy_left_out: float


def struck_plate(plate: FlexiblePlate, place_m: np.ndarray, arrival_s: np.ndarray, contact_time_s: float,
                 cache_dir: Path | None, tell: Callable[[list[str]], object]) -> StruckPlate:
    """The plate on which stones arrive at places (k, 2) at times (k,), the shortest contact of which lasts
    `contact_time_s`. Before its modes are sought, `tell` gets the warnings. Raises Refused as `plate_modes` does."""
    left_out = energy_left_out(mesh.highest_frequency_Hz(plate), contact_time_s)
    tell(warnings_of_plate(plate, left_out))
    modes = modes_for_loads(plate, cache_dir, place_m)
    return StruckPlate(modes, mobility_of_stones_1_kg(modes, place_m, arrival_s), left_out)


def plate_mobility_1_kg(modes: PlateModes, place_m: np.ndarray) -> float:
    """How much the plate under a stone accelerates at once for a force of 1 N on every stone, at most: the largest row
    sum of |phi phi^T| over the stones' places (k, 2)."""
    shape = modes.shape_at(place_m)
    return float(np.abs(shape @ shape.T).sum(axis=1).max())


def mobility_of_stones_1_kg(modes: PlateModes, place_m: np.ndarray, arrival_s: np.ndarray) -> float:
    """`plate_mobility_1_kg` of the stones that arrive within TOGETHER_s of each other, at most. What fell long before
    lies still or has left."""
    order = np.argsort(arrival_s, kind="stable")
    arrival, place = arrival_s[order], place_m[order]
    ends = np.searchsorted(arrival, arrival + TOGETHER_s, side="right")
    starts = np.flatnonzero(np.diff(ends, prepend=0) > 0)  # of windows that hold a stone that no one before does
    return max(plate_mobility_1_kg(modes, place[k:ends[k]]) for k in starts)


def warnings_of_plate(plate: FlexiblePlate, left_out: float) -> list[str]:
    """One line for each reason for which the plate's modes are not to be trusted; `left_out` is the share of energy
    above max_frequency_Hz, which is known."""
    shorter, highest_Hz = min(plate.size_m), mesh.highest_frequency_Hz(plate)
    lines = []
    if shorter < LEAST_SPAN * plate.thickness_m:
        lines.append(f"plate.thickness_m = {plate.thickness_m:g}: the shorter side is "
                     f"{shorter / plate.thickness_m:.3g} of it; theories of plates are for {LEAST_SPAN} and more")
    if system.first_is_low(plate) and not system.sways(plate):
        lines.append(f"plate.max_frequency_Hz = {highest_Hz:g}: modes within the plane, from about "
                     f"{system.first_Hz_of(plate):.2g} Hz on, are left out, since no rod ties them to bending; the "
                     f"first is among the lowest {system.LOWEST}")
    if (plate.mesh_size_m or 0.0) > COARSER * mesh.default_mesh_size(plate):
        lines.append(f"plate.mesh_size_m = {plate.mesh_size_m:g}: above {mesh.default_mesh_size(plate):.3g}, which "
                     f"modes up to {highest_Hz:.4g} Hz need")
    if mesh.choose_theory(plate) == "kirchhoff" and mesh.kirchhoff_error(plate) > mesh.SHEAR_ERROR_ALLOWED:
        lines.append(f"plate.theory = 'kirchhoff': without shear the highest frequency is "
                     f"{mesh.kirchhoff_error(plate):.2g} too high; 'auto' allows {mesh.SHEAR_ERROR_ALLOWED:g}")
    if left_out > MOST_LEFT_OUT:
        lines.append(f"plate.max_frequency_Hz = {highest_Hz:.4g}: {left_out:.2g} of the plate's energy belongs to "
                     f"modes above it; at most {MOST_LEFT_OUT:g} leaves forces and motion right")
    return lines + [line for number in range(len(plate.rods)) for line in _unknown_joint(plate, number)]


def deflection_warnings(plate: PlateTable, motion: RecordedMotion | None) -> list[str]:
    """Of a plate that, deflected so far, would stretch."""
    if motion is None or not isinstance(plate, FlexiblePlate):
        return []
    largest_m = motion.deflection_m(plate.edges == "free", MOST_DEFLECTION * plate.thickness_m)
    return [f"plate.thickness_m = {plate.thickness_m:g}: deflects by {largest_m / plate.thickness_m:.2g} of it; linear "
            f"theory, without stretching, is for {MOST_DEFLECTION:g} and less"] if largest_m else []


def _unknown_joint(plate: FlexiblePlate, number: int) -> list[str]:
    """A joint is that of a rod far from edges, and its table ends."""
    rod, name, lines = plate.rods[number], f"plate.rods.{number}", []
    to_edge = min(side / 2 - abs(x) for side, x in zip(plate.size_m, rod.place_m, strict=True))
    if to_edge < rod.diameter_m:
        lines.append(f"{name}: stands {to_edge:.2g} m from an edge, less than its diameter; its joint is that of a rod "
                     "far from edges")
    ratios = {"diameter_m": ("half of it over the plate's thickness", rod.diameter_m / 2 / plate.thickness_m),
              "youngs_modulus_Pa": ("over the plate's it", rod.youngs_modulus_Pa / plate.youngs_modulus_Pa)}
    for (key, (words, ratio)), (least, most) in zip(ratios.items(), joint_range(), strict=True):
        if not 0.999 * least <= ratio <= 1.001 * most:
            lines.append(f"{name}.{key} = {getattr(rod, key):g}: {words} is {ratio:.2g}; joints are known from "
                         f"{least:.2g} to {most:.2g}, and the nearest is taken")
    return lines


def energy_left_out(max_frequency_Hz: float, contact_time_s: float) -> float:
    """Return the share of a plate's impact energy that would go into modes above max_frequency_Hz.

    It holds for an undamped Hertz contact that lasts contact_time_s, to first order in the plate's motion. Raises
    InputError for what is negative or no number.

    >>> f"{energy_left_out(max_frequency_Hz=10e3, contact_time_s=2e-4):.1e}"
    '9.4e-04'
    """
    if not (max_frequency_Hz >= 0 and contact_time_s >= 0):
        raise InputError(f"{max_frequency_Hz:g} Hz, {contact_time_s:g} s: must be numbers from 0 on")
    cut_off, share = _pulse_share()
    return float(np.interp(max_frequency_Hz * contact_time_s, cut_off, share))


@cache
def _pulse_share() -> tuple[np.ndarray, np.ndarray]:
    """Return cut-off frequencies times contact time, ascending, and the share of a Hertz pulse's energy above each.

    At the depth d = 1 - v^2 of the largest, v from 1 to 0, a sphere moves by dd = sqrt(1 - d^2.5) dt: the time is an
    integral of a smooth function of v. The contact opens as it closed.
    """
    n, padding, v = 4096, 64, np.linspace(1, 0, 20_001)
    middle = (v[1:] + v[:-1]) / 2
    time = np.append(0, np.cumsum(middle / np.sqrt(-np.expm1(2.5 * np.log1p(-(middle**2))))))
    closing = np.interp(np.arange(n // 2 + 1) / n, time / (2 * time[-1]), (1 - v**2) ** 1.5)
    power = abs(np.fft.rfft(np.append(closing, closing[-2:0:-1]), n * padding)) ** 2
    below = np.cumsum(power) - (power + power[0]) / 2  # trapezoidal rule
    cut_off = np.arange(len(power)) / padding
    kept = cut_off <= 20
    return cut_off[kept], (1 - below / below[-1])[kept]
