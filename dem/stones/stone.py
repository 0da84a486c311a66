"""One stone that falls, and the path on which it comes.

Vectors are in the frame of the plate: x along its length, y along its width, z normal to it, upwards. Gravity g is a
vector in that frame, since the plate may be tilted. Between its entry and its touch a stone flies freely; with the
velocity v at the touch it was, tau seconds before,

    at   -v tau + g tau^2/2   from where it touches, with the velocity   v - g tau
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from common.scene.stones import SPHERE
from dem.stones.substance import Substance

UPRIGHT = (1.0, 0.0, 0.0, 0.0)  # the attitude of a stone that is not turned


@dataclass(frozen=True)
class Stone:
    """One stone, as the scene gave it or as it was drawn.

    `radius_m`: of the sphere of equal volume; `place_m` (x, y) of its centre when it first touches the plate;
    `velocity_m_s` (3,) then; `spin_rad_s` (3,); `arrival_s`: when it touches. At 0 it starts `gap_m` above the plate.
    `attitude`: unit quaternion (w, x, y, z) that turns its packing; `strength_factor` on the strengths of its bonds,
    others on what the material has; `seed` of its packing.
    """

    material: str
    radius_m: float
    place_m: tuple[float, float]
    velocity_m_s: tuple[float, float, float]
    seed: int
    gap_m: float
    arrival_s: float = 0.0
    spin_rad_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    attitude: tuple[float, float, float, float] = UPRIGHT
    strength_factor: float = 1.0
    shape: str = SPHERE
    density_factor: float = 1.0
    youngs_modulus_factor: float = 1.0
    restitution: float = 0.0  # on the plate; 0: that of the scene's contacts

    @property
    def substance(self) -> Substance:
        """What it is made of."""
        return Substance(self.material, self.youngs_modulus_factor, self.restitution)

    @property
    def speed_m_s(self) -> float:
        """Of its centre when it touches."""
        return math.hypot(*self.velocity_m_s)


@dataclass(frozen=True)
class Entry:
    """When, where and how fast a stone enters the simulation. `offset_m` (3,): of its centre from where that is at
    the touch."""

    entry_s: float
    offset_m: tuple[float, float, float]
    velocity_m_s: tuple[float, float, float]

    @property
    def is_late(self) -> bool:
        """Does it enter later than at the start?"""
        return self.entry_s > 1e-12


def entry_of(stone: Stone, gravity_m_s2: Sequence[float], longest_s: float = math.inf) -> Entry:
    """Trace the path of a stone back from its touch, at most to its highest point, to the start of the simulation, and
    by `longest_s`. A stone that arrives at 0 starts `gap_m` above the plate with its speed."""
    if stone.arrival_s == 0:
        return Entry(0.0, (0.0, 0.0, stone.gap_m), stone.velocity_m_s)
    tau = min(stone.arrival_s, apex_s(stone, gravity_m_s2), longest_s)
    offset, velocity = path_before(stone.velocity_m_s, gravity_m_s2, tau)
    return Entry(stone.arrival_s - tau, offset, velocity)


def apex_s(stone: Stone, gravity_m_s2: Sequence[float]) -> float:
    """How long before its touch a stone was at its highest point above the plate; infinite without gravity."""
    down, pull = -stone.velocity_m_s[2], -gravity_m_s2[2]
    return max(0.0, down / pull) if pull > 0 else math.inf


def path_before(velocity_m_s: Sequence[float], gravity_m_s2: Sequence[float], tau_s: float) -> tuple[
        tuple[float, float, float], tuple[float, float, float]]:
    """Place from that of the touch, and velocity, `tau_s` before a touch with `velocity_m_s`."""
    v, g = velocity_m_s, gravity_m_s2
    x, y, z = (-v[k] * tau_s + 0.5 * g[k] * tau_s**2 for k in range(3))
    vx, vy, vz = (v[k] - g[k] * tau_s for k in range(3))
    return (x, y, z), (vx, vy, vz)


def places_m(stones: Sequence[Stone]) -> np.ndarray:
    """(stones, 2), where they touch."""
    return np.array([stone.place_m for stone in stones])


def impact_speed_m_s(stone: Stone, gravity_m_s2: Sequence[float]) -> float:
    """Speed with which a stone arrives. One that starts at rest is taken to arrive by gravity."""
    return float(max(stone.speed_m_s, np.sqrt(2 * -gravity_m_s2[2] * stone.gap_m), 1e-3))
