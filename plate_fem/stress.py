"""Bending stress at the top surface of the plate in a state of its modes, and the largest one of a motion; and under
Hertz contacts."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from common.input_error import InputError
from common.scene.plate import Rod
from plate_fem.modes import PlateModes


def surface_stress(modes: PlateModes, amplitude: np.ndarray) -> np.ndarray:
    """Return the stress (n_nodes, 3, ...) in Pa at the top surface, sx, sy and txy, for modal amplitudes (n, ...).

    The bottom has the opposite sign. The local stress under a contact is not included. Raises InputError for amplitudes
    that are not finite, or of another number of modes.

    >>> modes = plate_modes(read_plate("scenes/small.toml").model_copy(update={"max_frequency_Hz": 500.0}))
    >>> surface_stress(modes, np.ones(modes.frequency_Hz.size)).shape == (len(modes.node_m), 3)
    True
    """
    amplitude, n = np.asarray(amplitude, np.float32), modes.surface_stress.shape[-1]
    if amplitude.shape[:1] != (n,) or not np.isfinite(amplitude).all():
        raise InputError(f"amplitude: has shape {amplitude.shape}; must be finite, one of each of {n} modes")
    return _stress(modes.surface_stress, amplitude)


def _stress(of_modes: np.ndarray, amplitude: np.ndarray) -> np.ndarray:
    """(k, 3, ...) from that of n modes (k, 3, n) and amplitudes (n, ...)."""
    *at, n = of_modes.shape
    return (of_modes.reshape(-1, n) @ amplitude).reshape(*at, *amplitude.shape[1:]).astype(float)


def von_mises(stress: np.ndarray) -> np.ndarray:
    """Return the von Mises stress (...,) of plane stress (..., 3) with columns sx, sy, txy. Raises InputError for
    what is not finite, or of other columns.

    >>> von_mises(np.array([[2e6, 0.0, 0.0], [1e6, 1e6, 0.0]])).tolist()  # along one axis, and along both
    [2000000.0, 1000000.0]
    """
    if np.shape(stress)[-1:] != (3,) or not np.isfinite(stress).all():
        raise InputError(f"stress: has shape {np.shape(stress)}; must be finite, with columns sx, sy, txy")
    sx, sy, txy = np.moveaxis(np.asarray(stress), -1, 0)
    return np.sqrt(sx**2 - sx * sy + sy**2 + 3 * txy**2)


class StressPeak:
    """Largest von Mises stress of bending over a motion, at the nodes away from the rods and at those near a rod.

    A node is near a rod when it lies within a diameter of its axis. There the stress is only indicative.
    """

    PATCH = 256  # nodes that follow each other, for which is found at once whether a motion could bring the peak

    def __init__(self, modes: PlateModes, rods: Sequence[Rod]) -> None:
        self._node_m, self._of_modes = modes.node_m, modes.surface_stress
        near = np.zeros(len(self._node_m), bool)
        for rod in rods:
            near |= np.hypot(*(self._node_m - (rod.x_m, rod.y_m)).T) < rod.diameter_m
        self._patches = [slice(k, k + self.PATCH) for k in range(0, len(near), self.PATCH)]
        self._nodes = [(np.flatnonzero(~near[patch]), np.flatnonzero(near[patch])) for patch in self._patches]
        self._best = np.zeros((2, 3))  # of both: von Mises stress squared, node, time
        # Von Mises stress is a norm, so that of a sum is at most the sum of those of the modes.
        units = (von_mises(np.moveaxis(part.surface_stress.astype(float), 1, 2)) for part in modes.parts())
        self._largest = np.concatenate([[[unit[patch][nodes].max(axis=0, initial=0.0) for nodes in both] for patch, both
                                         in zip(self._patches, self._nodes, strict=True)] for unit in units], axis=2)

    def add(self, t_s: np.ndarray, amplitude: np.ndarray) -> None:
        """Note the modal amplitudes (k, n) at the times t_s (k,)."""
        t_s, amplitude = np.asarray(t_s), np.asarray(amplitude)
        above = ((self._largest @ np.abs(amplitude).T) ** 2 > self._best[:, :1]).any(axis=1)  # (patches, k)
        for number in np.flatnonzero(above.any(axis=1)):
            patch, both, rows = self._patches[number], self._nodes[number], above[number]
            stress = _stress(self._of_modes[patch], np.asarray(amplitude[rows].T, np.float32))
            sx, sy, txy = np.moveaxis(stress, 1, 0)
            squared = sx * (sx - sy) + sy**2 + 3 * txy**2
            for best, nodes in zip(self._best, both, strict=True):
                if len(nodes):
                    node, k = np.unravel_index(squared[nodes].argmax(), (len(nodes), squared.shape[1]))
                    if squared[nodes[node], k] > best[0]:
                        best[:] = squared[nodes[node], k], patch.start + nodes[node], t_s[rows][k]

    def get_state(self) -> dict[str, np.ndarray]:
        return {"peak": self._best.copy()}

    def set_state(self, state: Mapping[str, np.ndarray]) -> None:
        self._best = np.array(state["peak"])

    def result(self, at_rods: bool = False) -> dict[str, float]:
        """Return the peak: "von_mises_Pa", where it is ("x_m", "y_m") and when ("t_s")."""
        squared, node, t_s = self._best[int(at_rods)]
        x, y = self._node_m[int(node)]
        return {"von_mises_Pa": float(np.sqrt(squared)), "x_m": float(x), "y_m": float(y), "t_s": float(t_s)}


YIELD_PRESSURE = 1.6  # peak pressure at first yield of a Hertz contact, over the yield stress (Johnson 1985, 6.1)
PATCH_RINGS, PATCH_SECTORS, PATCH_REACH = 8, 24, 4.0  # of the mesh about a contact


@dataclass(frozen=True)
class HertzContact:
    """A sphere of radius `radius_m` pressed on the plate at (x_m, y_m).

    `modulus_Pa` is the contact modulus E* of both bodies (common/hertz.py).
    """

    x_m: float
    y_m: float
    force_N: float
    radius_m: float
    modulus_Pa: float

    @property
    def contact_radius_m(self) -> float:
        """a = (3 F R / 4 E*)^(1/3), 0 where nothing is pressed."""
        return (0.75 * max(self.force_N, 0.0) * self.radius_m / self.modulus_Pa) ** (1 / 3)

    @property
    def peak_pressure_Pa(self) -> float:
        """p0 = 3 F / (2 pi a^2)."""
        return 1.5 * self.force_N / (math.pi * self.contact_radius_m**2) if self.force_N > 0 else 0.0


def contact_surface_stress(contact: HertzContact, points_m: np.ndarray, poisson_ratio: float) -> np.ndarray:
    """Return the stress (k, 4) of a contact at points (k, 2) of the surface, for the Poisson ratio of the plate.

    Columns are sx, sy, txy, sz in Pa, compression negative (Johnson 1985, Contact Mechanics, Eqs. 3.43 and 3.44).
    """
    offset = np.atleast_2d(np.asarray(points_m, float)) - (contact.x_m, contact.y_m)
    if contact.force_N <= 0:
        return np.zeros((len(offset), 4))
    a, p0 = contact.contact_radius_m, contact.peak_pressure_Pa
    offset[:, 0] += np.where(np.hypot(*offset.T) < 1e-9 * a, 1e-9 * a, 0.0)  # a direction for the centre
    distance = np.hypot(*offset.T)
    c, s = (offset / distance[:, None]).T
    x = (distance / a) ** 2
    inner = np.minimum(x, 1 - 1e-15)
    spread = -(1 - 2 * poisson_ratio) / 3 * np.expm1(1.5 * np.log1p(-inner)) / x  # (1 - (1 - x)^(3/2)) / x
    root = np.sqrt(np.clip(1 - x, 0, None))
    radial, hoop, normal = p0 * (spread - root), p0 * (-spread - 2 * poisson_ratio * root), -p0 * root
    sx, sy = radial * c**2 + hoop * s**2, radial * s**2 + hoop * c**2
    return np.column_stack([sx, sy, (radial - hoop) * c * s, normal])


def von_mises_3d(stress: np.ndarray) -> np.ndarray:
    """Return the von Mises stress (...,) of stress (..., 4) with columns sx, sy, txy, sz."""
    sx, sy, txy, sz = np.moveaxis(np.asarray(stress), -1, 0)
    return np.sqrt(0.5 * ((sx - sy) ** 2 + (sy - sz) ** 2 + (sz - sx) ** 2) + 3 * txy**2)


def total_stress(modes: PlateModes, amplitude: np.ndarray, contacts: Sequence[HertzContact], points_m: np.ndarray,
                 poisson_ratio: float) -> np.ndarray:
    """Return the stress (k, 4) at points (k, 2) of the top surface: bending plus the field of every contact.

    Amplitudes have shape (n,); columns are those of `contact_surface_stress`.
    """
    nodal = surface_stress(modes, amplitude).reshape(len(modes.lines_x_m), len(modes.lines_y_m), 3)
    bending = RegularGridInterpolator((modes.lines_x_m, modes.lines_y_m), nodal)(points_m)
    total = np.column_stack([bending, np.zeros(len(bending))])
    for contact in contacts:
        total += contact_surface_stress(contact, points_m, poisson_ratio)
    return total


def contact_patch(contact: HertzContact) -> tuple[np.ndarray, np.ndarray]:
    """Return points (k, 2) and cells (c, 4) of a mesh of the surface about a contact, out to PATCH_REACH contact radii.

    Half of the rings of cells lie within the contact, where the pressure is.
    """
    a, inside, sectors = contact.contact_radius_m, PATCH_RINGS // 2, PATCH_SECTORS
    beyond = np.geomspace(1, PATCH_REACH, PATCH_RINGS - inside + 1)[1:]
    radius = a * np.append(np.linspace(0, 1, inside + 1)[1:], beyond)
    angle = 2 * np.pi * np.arange(sectors) / sectors
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.vstack([[[0.0, 0.0]], (radius[:, None, None] * circle).reshape(-1, 2)])
    inner, after = np.arange(sectors), np.roll(np.arange(sectors), -1)
    cells = [np.column_stack([0 * inner, 1 + inner, 1 + after, 0 * inner])]  # triangles with a corner twice
    for ring in range(PATCH_RINGS - 1):
        first, second = 1 + ring * sectors, 1 + (ring + 1) * sectors
        cells.append(np.column_stack([first + inner, second + inner, second + after, first + after]))
    return points + (contact.x_m, contact.y_m), np.vstack(cells)
