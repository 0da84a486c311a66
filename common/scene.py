"""The scene file: what falls on what, in SI units. Unknown keys, wrong signs and NaN are refused by name."""

from __future__ import annotations

import hashlib
import json
import math
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from common.error_laws import least_tolerance
from common.plate import PlateTable
from common.tables import InputError, Refused, Table, check, read_toml

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
LEAST_MODULUS_Pa = 5e6  # LIGGGHTS refuses less
PLATE = "plate"  # the name under which `contacts` speaks of the plate


class TimeTable(Table):
    """How long the run is, and in which steps."""

    duration_s: Positive
    sample_interval_s: Positive
    gravity_m_s2: NotNegative = 0.0
    time_step_s: Positive | None = None  # default: the largest that every limit allows
    co_step: Annotated[int, Field(ge=1)] | None = None  # DEM steps; default from the shortest contact
    # A body in free flight is left out of the force loops when its inner motion has less than this share of the kinetic
    # energy of the impact; 0: never (docs/free_flight.md).
    free_flight_tolerance: NotNegative = 1e-4

    @model_validator(mode="after")
    def _one_sample_at_least(self) -> Self:
        if self.duration_s < self.sample_interval_s:
            raise Refused("duration_s", self.duration_s,
                          f"must be at least sample_interval_s = {self.sample_interval_s:g}")
        return self


class AgglomerateTable(Table):
    """How a stone is made of bonded sub-spheres."""

    subspheres: Annotated[int, Field(ge=2, le=100_000)]
    damping_ratio: NotNegative = 0.05
    unbreakable: bool = False
    # How a stone touches the plate: with its sub-spheres, each alone, or as the smooth sphere that it stands for
    # (docs/contact.md).
    contact: Literal["sub_spheres", "smooth"] = "sub_spheres"


class StonePosition(Table):
    """Centre of a stone in the plane of the plate."""

    x_m: float
    y_m: float


class StonesTable(Table):
    """The stones, where they are, and how they arrive."""

    count: Annotated[int, Field(ge=1, le=1000)]
    radius_m: Positive
    circle_radius_m: Positive | None = None
    positions: tuple[StonePosition, ...] | None = None  # instead of the circle
    speed_m_s: NotNegative
    gap_m: Positive
    coal: str
    gangue: str
    gangue_order: tuple[int, ...]  # which stone turns into gangue first
    gangue_ratio: Annotated[float, Field(ge=0, le=1)]
    arrival_s: tuple[NotNegative, ...] | None = None  # how much later than at once each stone arrives, by lying higher
    strength_factor: tuple[Positive, ...] | None = None  # on the strengths of each stone's bonds
    seed: Annotated[int, Field(ge=0, lt=2**63)]
    agglomerate: AgglomerateTable | None = None  # absent: each stone is one unbonded sphere

    @model_validator(mode="after")
    def _one_position_each(self) -> Self:
        if (self.circle_radius_m is None) == (self.positions is None):
            raise Refused("circle_radius_m", self.circle_radius_m, "either this or positions must be given")
        if self.positions is not None and len(self.positions) != self.count:
            raise Refused("positions", f"{len(self.positions)} places", f"must be {self.count}, one a stone")
        for key in ("arrival_s", "strength_factor"):
            values = getattr(self, key)
            if values is not None and len(values) != self.count:
                raise Refused(key, f"{len(values)} values", f"must be {self.count}, one a stone")
        if self.strength_factor is not None and self.agglomerate is None:
            raise Refused("strength_factor", self.strength_factor, "needs stones.agglomerate, whose bonds it is for")
        if sorted(self.gangue_order) != list(range(1, self.count + 1)):
            raise Refused("gangue_order", self.gangue_order, f"must hold each stone 1..{self.count} once")
        return self


class BondTable(Table):
    """The bonds of a material."""

    youngs_modulus_Pa: Positive
    stiffness_ratio: Positive  # k_n / k_s
    tensile_strength_Pa: Positive
    shear_strength_Pa: NotNegative
    friction_angle_deg: Annotated[float, Field(ge=0, lt=90)] = 0.0  # 0: no Mohr-Coulomb
    # Modulus of the sub-spheres' dilatation over that of the bonds: it sets Poisson's ratio. 0: no such energy.
    volumetric_ratio: Annotated[float, Field(ge=0, le=0.6)] = 0.0  # beyond, it would limit the time step
    # What the tensile strength gains with the mean pressure, per pressure above the threshold. 0: nothing.
    pressure_strengthening: NotNegative = 0.0
    pressure_threshold_Pa: NotNegative = 0.0

    @model_validator(mode="after")
    def _threshold_of_something(self) -> Self:
        if self.pressure_threshold_Pa > 0 and self.pressure_strengthening == 0:
            raise Refused("pressure_threshold_Pa", self.pressure_threshold_Pa,
                          "must be left out where pressure_strengthening is 0")
        return self

    @property
    def feels_dilatation(self) -> bool:
        """Does the engine have to find the change of volume at each sub-sphere?"""
        return self.volumetric_ratio > 0 or self.pressure_strengthening > 0


class MaterialTable(Table):
    """A material of stones."""

    density_kg_m3: Positive
    youngs_modulus_Pa: Annotated[float, Field(ge=LEAST_MODULUS_Pa)]
    poisson_ratio: Annotated[float, Field(ge=0, lt=0.5)]
    # Pressure in the middle of a contact with the plate at which the stone crushes; absent: it stays elastic.
    contact_strength_Pa: Positive | None = None
    bond: BondTable | None = None


class ContactTable(Table):
    """The contact of two materials."""

    restitution: Annotated[float, Field(gt=0.05, le=1)]  # LIGGGHTS refuses 0.05 and less
    friction: NotNegative


class OutputTable(Table):
    """What is written besides the signals."""

    view_interval_s: Positive | None = None  # absent: no pictures


class EngineTable(Table):
    """How the engine runs."""

    np: Annotated[int, Field(ge=1, le=256)] = 1  # MPI ranks of a run; docs/campaigns.md says where they stop paying


class Scene(Table):
    """A scene file."""

    # Names go into the deck and into names of columns: nothing that LIGGGHTS, a shell or a path could take for more.
    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", max_length=64)]
    assumptions: tuple[str, ...] = ()
    # Relative error that time step, co-step and modes together may make; it takes the place of their own keys.
    tolerance: Annotated[float, Field(gt=0, le=0.1)] | None = None
    time: TimeTable
    stones: StonesTable
    materials: dict[Annotated[str, Field(pattern=r"^[a-z][a-z0-9]*$", max_length=32)], MaterialTable]
    contacts: dict[str, ContactTable]
    plate: PlateTable
    output: OutputTable = OutputTable()
    engine: EngineTable = EngineTable()

    @model_validator(mode="after")
    def _names_agree(self) -> Self:
        for part in ("coal", "gangue"):
            name = getattr(self.stones, part)
            if name not in self.materials:
                raise Refused(f"stones.{part}", name, f"unknown material; materials here are {sorted(self.materials)}")
            if self.stones.agglomerate and self.materials[name].bond is None:
                raise Refused(f"materials.{name}.bond", None, "must be given, as stones.agglomerate needs it")
        if self.plate.youngs_modulus_Pa < LEAST_MODULUS_Pa:
            raise Refused("plate.youngs_modulus_Pa", self.plate.youngs_modulus_Pa,
                          f"must be at least {LEAST_MODULUS_Pa:g}")
        if self.stones.speed_m_s == 0 and self.time.gravity_m_s2 == 0:
            raise Refused("stones.speed_m_s", 0.0,
                          "must be above 0 where there is no time.gravity_m_s2: nothing would move")
        if PLATE in self.materials:
            raise Refused("materials", PLATE, "must be another name, this one is the plate's")
        self._check_contacts()
        return self

    def bond_of(self, material: str) -> BondTable:
        """The bonds of a material. Where stones are agglomerates, the checks above see that there are any."""
        bond = self.materials[material].bond
        assert bond is not None
        return bond

    @property
    def has_smooth_contact(self) -> bool:
        """Do stones touch the plate as the smooth spheres that they stand for?"""
        table = self.stones.agglomerate
        return table is not None and table.contact == "smooth"

    @property
    def agglomerate(self) -> AgglomerateTable:
        """How stones are made, for what is asked only of bonded ones."""
        assert self.stones.agglomerate is not None
        return self.stones.agglomerate

    @model_validator(mode="after")
    def _one_way_to_set_accuracy(self) -> Self:
        keys = {"time.time_step_s": self.time.time_step_s, "time.co_step": self.time.co_step}
        if self.plate.model == "flexible":
            modes = {"plate.max_frequency_Hz": self.plate.max_frequency_Hz,
                     "plate.truncation_tolerance": self.plate.truncation_tolerance}
            if self.tolerance is None and set(modes.values()) == {None}:
                raise Refused("plate.max_frequency_Hz", None,
                              "it, plate.truncation_tolerance or tolerance must be given")
            keys |= modes
        if self.tolerance is None:
            return self
        least = least_tolerance(self.stones.agglomerate is not None)
        if self.tolerance < least:
            raise Refused("tolerance", self.tolerance, f"must be at least {least:.2g}, the limit of what was measured "
                          "(common/error_laws.toml)")
        for key, value in keys.items():
            if value is not None:
                raise Refused(key, value, "must be left out where tolerance is given")
        return self

    def _check_contacts(self) -> None:
        names = sorted({self.stones.coal, self.stones.gangue})
        needed = {contact_key(a, b) for a in names for b in [*names, PLATE]}
        known = {contact_key(a, b) for a in self.materials for b in [*self.materials, PLATE]}
        for key in self.contacts:
            if key not in known:
                raise Refused(f"contacts.{key}", key, f"unknown pair of materials; possible are {sorted(known)}")
        alone = self.stones.count == 1 and self.stones.agglomerate is None
        for key in sorted(needed - set(self.contacts)):
            if key.endswith("_" + PLATE) or not alone:
                raise Refused(f"contacts.{key}", None, "must be given with restitution and friction")


def contact_key(first: str, second: str) -> str:
    """Name of a pair in `contacts`: alphabetic, the plate last."""
    return "_".join([*sorted({first, second} - {PLATE}), PLATE]) if PLATE in (first, second) else "_".join(
        sorted([first, second]))


def read_scene(path: str | Path, gangue_ratio: float | None = None) -> Scene:
    """The checked scene of a TOML file; `gangue_ratio` (0..1) replaces the scene's own.

    Raises common.tables.InputError, one line with file, key, value and what is allowed.
    """
    data = read_toml(path)
    if gangue_ratio is not None and isinstance(data.get("stones"), dict):
        data["stones"]["gangue_ratio"] = gangue_ratio
    return check(Scene, data, path)


def changed_scene(path: str | Path, changes: dict[str, Any]) -> Scene:
    """The scene of a file with dotted keys changed ("stones.speed_m_s": 2.0; None leaves the key out), for studies that
    vary one. Raises InputError as `read_scene` does."""
    data = read_toml(path)
    for key, value in changes.items():
        *tables, last = key.split(".")
        table = data
        for name in tables:
            table = table.setdefault(name, {})
            if not isinstance(table, dict):
                raise InputError(f"{path}: {key}: {name} is no table")
        if value is None:
            table.pop(last, None)
        else:
            table[last] = value
    return check(Scene, data, path)


def scene_hash(scene: Scene) -> str:
    """Hash of everything that the scene says, whatever the order and layout of the file."""
    text = json.dumps(scene.model_dump(mode="json"), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def ratio_name(ratio: float) -> str:
    """Directory of a ratio in a sweep: ratio_030 for 0.3."""
    return f"ratio_{math.floor(ratio * 100 + 0.5):03d}"
