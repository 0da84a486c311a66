"""One stone that falls, and the path on which it comes.

Vectors are in the frame of the plate: x along its length, y along its width, z normal to it, upwards. Gravity g is a
vector in that frame, since the plate may be tilted. Between its entry and its touch a stone flies freely; with the
velocity v at the touch it was, tau seconds before,

    at   -v tau + g tau^2/2   from where it touches, with the velocity   v - g tau

A stone knows its substance, of which all else is asked that follows from the scene's materials and contacts. It is a
type of particle in the engine. Density and strength are not among its properties: sub-spheres have a mass each, and
bonds a factor each.
"""

import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.special import gamma, log_ndtr

from common import hertz
from common.scene.distribution import LEAST_RESTITUTION
from common.scene.plate import Plate
from common.scene.scene import PLATE, BondTable, ContactTable, MaterialTable, Scene
from common.scene.stones import SPHERE
from dem.stones.solids import solid_of

WAVES = 256  # of a field of flaws; with so many it is Gaussian within its statistical error


@dataclass(frozen=True, order=True)
class Substance:
    """A material of the scene with a factor on its Young's modulus, and its contacts, by the name of the other material
    or PLATE, as far as the scene gives them. `restitution` on the plate; 0: that of the contacts."""

    name: str
    youngs_modulus_factor: float
    restitution: float
    kind: str = field(compare=False)
    table: MaterialTable = field(compare=False)
    contacts: Mapping[str, ContactTable] = field(compare=False)
    plate: Plate = field(compare=False)

    @cached_property
    def material(self) -> MaterialTable:
        """With the substance's Young's modulus, that of the bonds too."""
        own, bond = {"youngs_modulus_Pa": self.table.youngs_modulus_Pa * self.youngs_modulus_factor}, self.table.bond
        if bond is not None:
            bond = bond.model_copy(update={"youngs_modulus_Pa": bond.youngs_modulus_Pa * self.youngs_modulus_factor})
        return self.table.model_copy(update=own | {"bond": bond})

    @property
    def bond(self) -> BondTable:
        """Of agglomerates, for which the scene sees that there are bonds."""
        assert self.material.bond is not None
        return self.material.bond

    @cached_property
    def modulus_on_plate_Pa(self) -> float:
        """E* of its contact with the plate."""
        return hertz.contact_modulus_Pa(self.material, self.plate)

    @cached_property
    def plate_contact(self) -> ContactTable:
        contact = self.contacts[PLATE]
        return contact.model_copy(update={"restitution": self.restitution}) if self.restitution else contact

    def contact_with(self, other: "Substance") -> ContactTable | None:
        """That of their materials, whose restitution changes by the geometric mean of what the restitutions of both on
        the plate have changed by. None where the scene gives none."""
        contact = self.contacts.get(other.name)
        if contact is None or self.restitution == other.restitution == 0:
            return contact
        gained = [one.plate_contact.restitution / one.contacts[PLATE].restitution for one in (self, other)]
        restitution = float(np.clip(contact.restitution * np.sqrt(gained[0] * gained[1]), LEAST_RESTITUTION, 1.0))
        return contact.model_copy(update={"restitution": restitution})


def substances_of(scene: Scene) -> dict[str, Substance]:
    """The materials that may fall, in alphabetic order."""
    return {name: Substance(name, 1.0, 0.0, scene.kind_of(name) or "", scene.materials[name], contacts, scene.plate)
            for name, contacts in scene.falling_contacts.items()}


def flaw_factors(modulus: float | None, length_m: float | None, seed: int, place_m: np.ndarray) -> np.ndarray:
    """Factors (m,) on the strengths of bonds at `place_m` (m, 3) from the centre of a stone that is not turned: a field
    of the seed alone, whatever the packing. They have a Weibull law of mean 1 and the correlation exp(-r^2/length^2);
    all are 1 without a modulus.

    The field is a sum of cosines of random waves, which is Gaussian with the correlation that their spectrum has, and
    each value takes the place in the Weibull law that it has in the normal one.
    """
    if modulus is None or length_m is None:
        return np.ones(len(place_m))
    rng = np.random.default_rng([seed, zlib.crc32(b"flaws")])
    wave, phase = rng.normal(0, np.sqrt(2) / length_m, (WAVES, 3)), rng.uniform(0, 2 * np.pi, WAVES)
    normal = np.sqrt(2 / WAVES) * np.cos(place_m @ wave.T + phase).sum(axis=1)
    return np.asarray((-log_ndtr(-normal)) ** (1 / modulus) / gamma(1 + 1 / modulus))


UPRIGHT = (1.0, 0.0, 0.0, 0.0)  # the attitude of a stone that is not turned
LOOKS = 100  # at the path of a stone


@dataclass(frozen=True)
class Stone:
    """One stone, as the scene gave it or as it was drawn.

    `radius_m`: of the sphere of equal volume; `place_m` (x, y) of its centre when it first touches the plate;
    `velocity_m_s` (3,) then; `spin_rad_s` (3,); `arrival_s`: when it touches. At 0 it starts `gap_m` above the plate.
    `attitude`: unit quaternion (w, x, y, z) that turns its packing; `strength_factor` on the strengths of its bonds,
    others on what the material has; `seed` of its packing; `flaw_seed` of its field of flaws, absent: `seed`.
    """

    substance: Substance
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
    flaw_seed: int | None = None

    @property
    def material(self) -> str:
        """Its name."""
        return self.substance.name

    @property
    def density_kg_m3(self) -> float:
        return self.substance.table.density_kg_m3 * self.density_factor

    @property
    def mass_kg(self) -> float:
        return self.density_kg_m3 * 4 / 3 * math.pi * self.radius_m**3

    def made_of(self, other: Substance) -> "Stone":
        """The stone, were it of another material; what it has of its own stays."""
        own = replace(other, youngs_modulus_factor=self.substance.youngs_modulus_factor,
                      restitution=self.substance.restitution)
        return replace(self, substance=own)

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


def entry_of(stone: Stone, gravity_m_s2: Sequence[float]) -> Entry:
    """Trace the path of a stone back from its touch, at most to its highest point, to the start of the simulation. A
    stone that arrives at 0 starts `gap_m` above the plate with its speed."""
    if stone.arrival_s == 0:
        return Entry(0.0, (0.0, 0.0, stone.gap_m), stone.velocity_m_s)
    tau = min(stone.arrival_s, apex_s(stone, gravity_m_s2))
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


@dataclass(frozen=True)
class Body:
    """A whole stone that hits the rigid plate as one Hertz sphere."""

    modulus_Pa: float  # E*
    restitution: float
    mass_kg: float
    radius_m: float
    speed_m_s: float

    @cached_property
    def stiffness_N_m32(self) -> np.float64:
        return np.float64(hertz.stiffness_N_m32(self.modulus_Pa, self.radius_m))

    @cached_property
    def depth_m(self) -> np.float64:
        """The largest approach."""
        return np.float64(hertz.largest_approach_m(self.stiffness_N_m32, self.mass_kg, self.speed_m_s))

    @property
    def contact_time_s(self) -> float:
        return float(hertz.contact_time_s(self.depth_m, self.speed_m_s))

    @property
    def peak_force_N(self) -> float:
        return float(self.stiffness_N_m32 * self.depth_m**1.5)


def body_of(stone: Stone, speed_m_s: float) -> Body:
    """A stone as it hits the plate."""
    return Body(stone.substance.modulus_on_plate_Pa, stone.substance.plate_contact.restitution, stone.mass_kg,
                stone.radius_m, speed_m_s)


class Flying:
    """Stones on their paths, one added after another. Where they are after their touch is not known here."""

    def __init__(self, scene: Scene):
        self._scene, self._gravity = scene, scene.gravity_vector_m_s2
        self._start: list[np.ndarray] = []  # centre where each enters
        self._rows: list[list[float]] = []  # entry_s, arrival_s, velocity (3), radius
        self._array = np.zeros((0, 9))

    def nearest(self, stone: Stone) -> tuple[int, float]:
        """Which of those that fly when a stone enters is nearest to it, and the gap between their spheres, m, negative
        where they overlap; -1 and infinity where none flies."""
        entry = entry_of(stone, self._gravity)
        rows = self._table()
        at_once = (rows[:, 0] == 0) & (entry.entry_s == 0)
        there = np.flatnonzero((rows[:, 0] <= entry.entry_s) & ((rows[:, 1] > entry.entry_s) | at_once))
        if not len(there):
            return -1, float("inf")
        flown = (entry.entry_s - rows[there, 0])[:, None]
        center = rows[there, 6:9] + rows[there, 2:5] * flown + 0.5 * np.array(self._gravity) * flown**2
        gap = np.linalg.norm(center - _center_m(stone, entry), axis=1) - rows[there, 5] - reach_m(self._scene, stone)
        return int(there[gap.argmin()]), float(gap.min())

    def add(self, stone: Stone) -> None:
        entry = entry_of(stone, self._gravity)
        self._rows.append([entry.entry_s, stone.arrival_s, *entry.velocity_m_s, reach_m(self._scene, stone),
                           *_center_m(stone, entry)])

    def _table(self) -> np.ndarray:
        """(stones, 9)."""
        if len(self._array) < len(self._rows):
            self._array = np.vstack([self._array, self._rows[len(self._array):]])
        return self._array


def gap_to_box_m(scene: Scene, stone: Stone, box_m: Sequence[float]) -> float:
    """How near the sphere that holds a stone comes to a box (XMIN XMAX YMIN YMAX ZMIN ZMAX) on its way from its entry
    to its touch, at LOOKS points of its path."""
    v, g = np.array(stone.velocity_m_s), np.array(scene.gravity_vector_m_s2)
    tau = np.linspace(0, min(stone.arrival_s, apex_s(stone, scene.gravity_vector_m_s2)), LOOKS)[:, None]
    center = np.array([*stone.place_m, stone.radius_m]) - v * tau + 0.5 * g * tau**2
    low, high = np.array(box_m).reshape(3, 2).T
    return float(np.linalg.norm(center - np.clip(center, low, high), axis=1).min()) - reach_m(scene, stone)


def reach_m(scene: Scene, stone: Stone) -> float:
    """Radius of the sphere about its centre that holds a stone."""
    return stone.radius_m * (1.0 if stone.shape == SPHERE else solid_of(scene.shapes[stone.shape], stone.seed).reach)


def _center_m(stone: Stone, entry: Entry) -> np.ndarray:
    """(3,) centre of a stone where it enters."""
    return np.array([*stone.place_m, stone.radius_m]) + entry.offset_m
