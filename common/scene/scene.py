"""The scene file: what falls on what, in SI units. Unknown keys, wrong signs and NaN are refused by name.

A key is a field with its type, its bounds and, by `about`, its meaning and what the paper gives for it. The JSON schema
and docs/scene.md are written from that: `python -m lab.scene_schema`.
"""

import hashlib
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import AfterValidator, Field, model_validator

from common.input_error import MOST_DEEP
from common.scene.distribution import OF_DRAWN, ScatterTable
from common.scene.error_laws import DEFAULT_TOLERANCE, least_tolerance, settings_for
from common.scene.file import read_named, scene_tables
from common.scene.plate import ContactStrength, Density, FlexiblePlate, Modulus, PlateTable
from common.scene.stones import KINDS, SPHERE, AgglomerateTable, Kind, Shape, StonesTable
from common.tables import InputError, NotNegative, Positive, Refused, Table, about, check, refuse_monstrous

LEAST_STRENGTH_Pa = 100.0
MOST_FRICTION = 10.0
PLATE = "plate"  # the name under which `contacts` speaks of the plate


def _that_holds(strength_Pa: float) -> float:
    if strength_Pa < LEAST_STRENGTH_Pa:
        raise ValueError(f"must be at least {LEAST_STRENGTH_Pa:g}, the weight of half a centimetre of rock: anything "
                         "less is loose already")
    return strength_Pa


def _that_slips(friction: float) -> float:
    if friction > MOST_FRICTION:
        raise ValueError(f"must be at most {MOST_FRICTION:g}: rubber on rough ground has about 2, rock on steel less "
                         "than 1")
    return friction


Strength = Annotated[Positive, AfterValidator(_that_holds)]
Friction = Annotated[NotNegative, AfterValidator(_that_slips)]


class TimeTable(Table):
    """How long the run is, and in which steps."""

    duration_s: Annotated[Positive, about("simulated time", paper="0.6 s, of which recognition reads 0.04 s")]
    sample_interval_s: Annotated[Positive, about("time between two rows of signals.parquet", paper="1.5e-4, 6667 Hz")]
    anti_alias: Annotated[bool, about(
        "a low pass takes what is above half the sample rate; false: what is there folds back", paper="false")] = True
    gravity_m_s2: Annotated[float, Field(ge=0, le=1e4), about("gravity, downwards", paper="9.8")] = 0.0
    time_step_s: Annotated[Positive | None, about("DEM time step; absent: the largest that every limit allows")] = None
    co_step: Annotated[Annotated[int, Field(ge=1)] | None, about(
        "DEM steps of a co-step; absent: from the shortest contact")] = None
    free_flight_tolerance: Annotated[NotNegative, about(
        "share of the impact energy below which inner motion lets a body fly; 0: never (docs/free_flight.md)")] = 3e-4
    view_interval_s: Annotated[Positive | None, about(
        "time between two pictures for ParaView; 20 us during the first impact of a stone, but of a stream")] = None

    @model_validator(mode="after")
    def _one_sample_at_least(self) -> Self:
        for key in ("duration_s", "view_interval_s"):  # a picture lies on a row
            value = getattr(self, key)
            if value is not None and value < self.sample_interval_s:
                raise Refused(key, value, f"must be at least sample_interval_s = {self.sample_interval_s:g}")
        return self


class BondTable(Table):
    """The bonds of a material."""

    youngs_modulus_Pa: Annotated[Modulus, about("Young's modulus of the bonds")]
    stiffness_ratio: Annotated[Positive, about("normal over shear stiffness, k_n/k_s")]
    tensile_strength_Pa: Annotated[Strength, about("tensile strength")]
    shear_strength_Pa: Annotated[Strength, about("shear strength, the cohesion")]
    friction_angle_deg: Annotated[float, Field(ge=0, lt=90), about("friction angle; 0: no Mohr-Coulomb")] = 0.0
    volumetric_ratio: Annotated[float, Field(ge=0, le=0.6), about(  # beyond, it would limit the time step
        "modulus of dilatation over that of the bonds; 0: none")] = 0.0
    pressure_strengthening: Annotated[NotNegative, about(
        "gain of tensile strength per mean pressure")] = 0.0
    fracture_energy_J_m2: Annotated[Positive | None, about(
        "energy per section of a bond that softens; absent: bonds snap")] = None
    flaw_modulus: Annotated[Annotated[float, Field(ge=1, le=100)] | None, about(
        "Weibull modulus of strengths within a stone; absent: bonds are alike")] = None
    flaw_length_m: Annotated[Positive | None, about(
        "their correlation length, to 1/e; goes with flaw_modulus")] = None

    @model_validator(mode="after")
    def _whole_field(self) -> Self:
        if (self.flaw_modulus is None) != (self.flaw_length_m is None):
            raise Refused("flaw_length_m", self.flaw_length_m, "must be given with flaw_modulus, and only with it")
        return self


class MaterialTable(Table):
    """A material of stones."""

    kind: Annotated[Kind | None, about(
        "what its stones count as; absent: as its name says, coal or gangue")] = None
    density_kg_m3: Annotated[Density, about("density", paper="Table 1: coal 1380, gangue 2400")]
    youngs_modulus_Pa: Annotated[Modulus, about(
        "Young's modulus", paper="Table 1: coal 5.12e9, gangue 9.966e9")]
    poisson_ratio: Annotated[float, Field(ge=0, lt=0.5), about(
        "Poisson's ratio", paper="Table 1: coal 0.3, gangue 0.28")]
    contact_strength_Pa: Annotated[ContactStrength | None, about(
        "contact pressure at which the stone crushes; absent: elastic",
    )] = None
    bond: Annotated[BondTable | None, about("the bonds of agglomerates")] = None


class ContactTable(Table):
    """The contact of two materials."""

    # LIGGGHTS refuses a restitution of 0.05 and less.
    restitution: Annotated[float, Field(gt=0.05, le=1), about("coefficient of restitution")]
    friction: Annotated[Friction, about("coefficient of friction")]


class Scene(Table):
    """A scene file."""

    # Names go into the deck and into names of columns: nothing that LIGGGHTS, a shell or a path could take for more.
    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", max_length=64), about("name of the scene")]
    base: Annotated[str | None, about(
        "scene file, beside this one or shipped, whose keys count where this one has none, in all tables")] = None
    without: Annotated[tuple[str, ...], about("dotted keys of the base to leave out")] = ()
    assumptions: Annotated[tuple[str, ...], about(
        "keys whose values are assumed; run.json repeats them")] = ()
    tolerance: Annotated[Annotated[float, Field(gt=0, le=0.1)] | None, about(
        "relative error allowed; it chooses time_step_s, co_step and max_frequency_Hz (docs/accuracy.md)")] = None
    time: Annotated[TimeTable, about("how long the run is, and in which steps")]
    stones: Annotated[StonesTable, about("what falls")]
    shapes: Annotated[
        dict[Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=32)], Shape],
        about("shapes of stones that are no spheres, all of them drawn; a text names a closed mesh, such as an STL file"
              " beside the scene"),
    ] = {}
    materials: Annotated[
        dict[Annotated[str, Field(pattern=r"^[a-z][a-z0-9]*$", max_length=32)], MaterialTable],
        about(
            "materials of stones; a text names a file in materials/, beside the scene or shipped")]
    contacts: Annotated[dict[str, ContactTable], about(
        "contacts by pair of materials or kinds, alphabetic, the plate last: coal_gangue, coal_plate")]
    scatter: Annotated[ScatterTable, about("what each stone has of its own")] = ScatterTable()
    plate: Annotated[PlateTable, about("the plate")]
    ranks: Annotated[Annotated[int, Field(ge=1, le=256)], about("MPI ranks of a run (docs/campaigns.md)")] = 1

    @model_validator(mode="after")
    def _shape_chooses_contact(self) -> Self:
        table = self.stones.agglomerate
        if table is not None and table.contact is None:
            contact = "smooth" if self.falling_shapes == [SPHERE] else "faces"
            # The scene as it is run says which, in run.json as in its hash.
            object.__setattr__(self.stones, "agglomerate", table.model_copy(update={"contact": contact}))
        return self

    @model_validator(mode="after")
    def _names_agree(self) -> Self:
        for key, name in self._material_keys():
            if name not in self.materials:
                raise Refused(key, name, f"unknown material; materials here are {sorted(self.materials)}")
            if self.stones.agglomerate and self.materials[name].bond is None:
                raise Refused(f"materials.{name}.bond", None, "must be given, as stones.agglomerate needs it")
            if self.kind_of(name) is None:
                raise Refused(f"materials.{name}.kind", None, "must be given, \"coal\" or \"gangue\": stones of it "
                              "count in the mixing ratio")
        for kind in KINDS:
            if kind in self.materials and self.kind_of(kind) != kind:
                raise Refused(f"materials.{kind}.kind", self.materials[kind].kind,
                              f"must be \"{kind}\", as its name is")
        drawn = self.stones.drawn
        if drawn is not None and drawn.drop_height_m is not None and self.time.gravity_m_s2 == 0:
            raise Refused("stones.drawn.drop_height_m", drawn.drop_height_m.bounds,
                          "must be left out where there is no time.gravity_m_s2: nothing would fall")
        if PLATE in self.materials:
            raise Refused("materials", PLATE, "must be another name, this one is the plate's")
        self._check_shapes()
        self._check_contacts()
        self._check_scatter()
        return self

    @model_validator(mode="after")
    def _assumptions_are_keys(self) -> Self:
        tables = self.model_dump()
        tables["plate"] = dict.fromkeys(FlexiblePlate.model_fields) | tables["plate"]
        for key in self.assumptions:
            if not _is_key(key.split("."), tables):
                raise Refused("assumptions", key, "must name keys of this scene, such as stones.gap_m; "
                              "materials.*.bond is that of all materials")
        return self

    def kind_of(self, material: str) -> str | None:
        """What stones of a material count as; None of one that does not say."""
        return self.materials[material].kind or (material if material in KINDS else None)

    def contact_of(self, first: str, second: str) -> ContactTable | None:
        """The contact of two materials, or of one and the plate: their own, or else that of their kinds."""
        names = [(name,) if name == PLATE else (name, self.kind_of(name) or name) for name in (first, second)]
        keys = [contact_key(a, b) for a in names[0] for b in names[1]]
        return next((self.contacts[key] for key in keys if key in self.contacts), None)

    @property
    def falling_contacts(self) -> dict[str, dict[str, ContactTable]]:
        """Of each material that may fall the contacts that are given, by the other material that may, or PLATE."""
        names = self.falling_materials
        found = {name: {other: self.contact_of(name, other) for other in (*names, PLATE)} for name in names}
        return {name: {other: one for other, one in of.items() if one is not None} for name, of in found.items()}

    def _material_keys(self) -> list[tuple[str, str]]:
        """Keys that name materials of stones, with the names."""
        if self.stones.each is not None:
            return [(f"stones.each.{k}.material", one.material) for k, one in enumerate(self.stones.each)]
        return [(f"materials.{kind}", kind) for kind in KINDS]

    @property
    def falling_materials(self) -> list[str]:
        """Names of the materials that may fall, in alphabetic order."""
        each = self.stones.each
        return sorted({one.material for one in each} if each is not None else KINDS)

    @property
    def falling_shapes(self) -> list[str]:
        """"sphere", or names of tables in `shapes`, of the stones that may fall, in alphabetic order."""
        if self.stones.each is not None:
            return sorted({one.shape for one in self.stones.each})
        return sorted(self.shapes) if self.stones.drawn is not None and self.shapes else [SPHERE]

    def down(self, length: float) -> tuple[float, float, float]:
        """A vector straight down, in the frame of the plate."""
        tilt = math.radians(self.plate.tilt_deg)
        return (length * math.sin(tilt), 0.0, length * -math.cos(tilt))

    @property
    def gravity_vector_m_s2(self) -> tuple[float, float, float]:
        return self.down(self.time.gravity_m_s2)

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

    @property
    def settings(self) -> tuple[float, float, float]:
        """Time step, co-step and modes that keep the tolerance, as common/scene/error_laws.py measures them."""
        return settings_for(self.tolerance or DEFAULT_TOLERANCE, bonded=self.stones.agglomerate is not None)

    @model_validator(mode="after")
    def _one_way_to_set_accuracy(self) -> Self:
        if self.tolerance is None:
            return self
        keys = {"time.time_step_s": self.time.time_step_s, "time.co_step": self.time.co_step,
                "plate.max_frequency_Hz": getattr(self.plate, "max_frequency_Hz", None)}
        least = least_tolerance(self.stones.agglomerate is not None)
        if self.tolerance < least:
            raise Refused("tolerance", self.tolerance, f"must be at least {least:.2g}, the limit of what was measured "
                          "(common/scene/error_laws.toml)")
        for key, value in keys.items():
            if value is not None:
                raise Refused(key, value, "must be left out where tolerance is given")
        return self

    def _check_shapes(self) -> None:
        if SPHERE in self.shapes:
            raise Refused(f"shapes.{SPHERE}", SPHERE, "must have another name, this one is the sphere's")
        for k, one in enumerate(self.stones.each or ()):
            if one.shape not in (SPHERE, *self.shapes):
                raise Refused(f"stones.each.{k}.shape", one.shape,
                              f"unknown shape; shapes here are {sorted([SPHERE, *self.shapes])}")
        for name in self.falling_shapes:
            if name == SPHERE:
                continue
            if self.stones.agglomerate is None:
                raise Refused("stones.agglomerate", None, f"must be given: {name} is made of sub-spheres")
            if self.has_smooth_contact:
                raise Refused("stones.agglomerate.contact", "smooth", "must be \"faces\" or \"sub_spheres\" where "
                              "stones are no spheres: flat faces, edges and corners have no smooth sphere to stand for")
        if self.stones.agglomerate is not None and self.stones.agglomerate.contact == "faces":
            if self.falling_shapes == [SPHERE]:
                raise Refused("stones.agglomerate.contact", "faces", "must be \"smooth\" or \"sub_spheres\" where all "
                              "stones are spheres, which have no faces")
            if self.plate.yield_stress_Pa is not None:
                raise Refused("plate.yield_stress_Pa", self.plate.yield_stress_Pa, "must be left out where "
                              "stones.agglomerate.contact = 'faces': under faces the plate stays elastic")

    def _check_contacts(self) -> None:
        possible = {*self.materials, *KINDS}
        known = {contact_key(a, b) for a in possible for b in [*possible, PLATE]}
        for key in self.contacts:
            if key not in known:
                raise Refused(f"contacts.{key}", key, f"unknown pair of materials; possible are {sorted(known)}")
        count = self.stones.count if self.stones.each is None else len(self.stones.each)
        alone = count == 1 and self.stones.agglomerate is None
        missing = [contact_key(a, b) for a, given in self.falling_contacts.items()
                   for b in [*([] if alone else self.falling_materials), PLATE] if b not in given]
        if missing:
            raise Refused(f"contacts.{min(missing)}", None, "must be given with restitution and friction")

    def _check_scatter(self) -> None:
        scatter = self.scatter
        for key in OF_DRAWN if self.stones.drawn is not None else ():
            if getattr(scatter, key) is not None:
                raise Refused(f"scatter.{key}", "...", "must be left out where stones.drawn is given, which says it")
        if scatter.strength_factor is not None and self.stones.agglomerate is None:
            raise Refused("scatter.strength_factor", "...", "needs stones.agglomerate, whose bonds it is for")


def _is_key(names: Sequence[str], tables: Any) -> bool:
    """Is there a key below these tables, or within a table that a scene may have?"""
    if not names or tables is None:
        return True
    return isinstance(tables, dict) and any(
        _is_key(names[1:], below) for name, below in tables.items() if names[0] in (name, "*"))


def contact_key(first: str, second: str) -> str:
    """Name of a pair in `contacts`: alphabetic, the plate last."""
    return "_".join(sorted((first, second), key=lambda name: (name == PLATE, name)))


def read_scene(path: str | Path) -> Scene:
    """The checked scene of a TOML file. Raises common.tables.InputError, one line with file, key, value and what is
    allowed."""
    return changed_scene(path, {})


def changed_scene(path: str | Path, changes: dict[str, Any]) -> Scene:
    """The scene of a file with dotted keys changed ("stones.speed_m_s": 2.0; None leaves the key out), for studies that
    vary one. Raises InputError as `read_scene` does.

    >>> changed_scene("scenes/small.toml", {"stones.speed_m_s": 2.0}).stones.speed_m_s
    2.0
    """
    data = scene_tables(path)
    for key, value in changes.items():
        if key in ("base", "without"):
            raise InputError(f"{path}: {key}: must stand in the file itself")
        *tables, last = key.split(".")
        if len(tables) > MOST_DEEP:
            raise InputError(f"{path}: {key[:60]}...: must name a key of the scene, which has no tables so deep")
        table = data
        for name in tables:
            table = table.setdefault(name, {})
            if not isinstance(table, dict):
                raise InputError(f"{path}: {key}: {name} is no table")
        if value is None:
            table.pop(last, None)
        else:
            table[last] = value.tolist() if hasattr(value, "tolist") else value  # NumPy's
            read_named(data, Path(path))
    refuse_monstrous(path, changes)
    return check(Scene, data, path)


def scene_hash(scene: Scene) -> str:
    """Hash of everything that the scene says, whatever the order and layout of the file."""
    text = json.dumps(scene.model_dump(mode="json"), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def ratio_name(ratio: float) -> str:
    """Directory of a ratio in a sweep: ratio_030 for 0.3."""
    return f"ratio_{math.floor(ratio * 100 + 0.5):03d}"
