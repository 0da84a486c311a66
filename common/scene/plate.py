"""The `[plate]` table of a scene.

The origin is the centre of the plate, z is normal to it and points up, and z = 0 is its undeformed top surface. Gravity
turns with `tilt_deg`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Discriminator, Field, Strict, Tag, model_validator

from common.channels import SENSORS, SensorKind
from common.scene.file import scene_tables
from common.tables import InputError, Place, Positive, Refused, Table, about, check

ContactStrength = Annotated[float, Field(ge=1e5)]  # Pa: into a softer body a stone sinks whole
Edge = Literal["x_minus", "x_plus", "y_minus", "y_plus"]
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_]+$", max_length=32)]
PlaceAndSection = Annotated[tuple[float, Positive, Positive], Strict(False)]  # a list is as good as a tuple

Modulus = Annotated[float, Field(ge=5e6)]  # Pa: LIGGGHTS refuses less

WALL_FOOT_m = 0.01  # of a wall below the top face: no stone slips under it where the plate gives way
LEAST_DENSITY_kg_m3, MOST_DENSITY_kg_m3 = 0.1, 25_000.0


def _of_a_solid(density_kg_m3: float) -> float:
    if density_kg_m3 > MOST_DENSITY_kg_m3:
        raise ValueError(f"must be at most {MOST_DENSITY_kg_m3:g}: osmium, the densest solid, has 22 590")
    if density_kg_m3 < LEAST_DENSITY_kg_m3:
        raise ValueError(f"must be at least {LEAST_DENSITY_kg_m3:g}: aerographene, the lightest solid, has 0.16")
    return density_kg_m3


Density = Annotated[Positive, AfterValidator(_of_a_solid)]


def wall_box_m(edge: Edge, size_m: Sequence[float], height_m: float) -> tuple[float, ...]:
    """XMIN XMAX YMIN YMAX ZMIN ZMAX of a wall on an edge of a plate, flat along x or y."""
    x, y = size_m
    box = [-x / 2, x / 2, -y / 2, y / 2, -WALL_FOOT_m, height_m]
    at = ["x_minus", "x_plus", "y_minus", "y_plus"].index(edge)
    box[at // 2 * 2:at // 2 * 2 + 2] = 2 * [box[at]]
    return tuple(box)


class Rod(Place):
    """A vertical rod below the plate, welded to it over its disc, of its Poisson's ratio, clamped at its lower end."""

    diameter_m: Annotated[Positive, about("diameter")]
    length_m: Annotated[Positive, about("length from the plate to the clamped end")]
    youngs_modulus_Pa: Annotated[Positive, about("Young's modulus")]
    density_kg_m3: Annotated[Density, about("density")]


@dataclass(frozen=True)
class Rib:
    """A rib below the plate, welded to it along its whole side, of its material. axis: along which it runs, 0 for x, 1
    for y. at_m: place of its middle on the other. section_m: width and height."""

    axis: int
    at_m: float
    section_m: tuple[float, float]

    @property
    def area_m2(self) -> float:
        """Of its section."""
        return self.section_m[0] * self.section_m[1]


class Sensor(Place):
    """A sensor on the plate, by default an accelerometer."""

    name: Annotated[Name, about(f"name of its column: {', '.join(SENSORS.values())}")]
    # What is an accelerometer is written without it, so that hashes of such scenes do not depend on it.
    kind: Annotated[SensorKind, about("what it measures, vertically upwards"), Field(
        exclude_if=lambda kind: kind == "acceleration")] = "acceleration"


class Plate(Table):
    """What every plate has: its outline and its material."""

    size_m: Annotated[tuple[Positive, Positive], about("sides along x and y")]
    density_kg_m3: Annotated[Density, about("density", paper="Table 1: 7830")]
    youngs_modulus_Pa: Annotated[Modulus, about("Young's modulus", paper="Table 1: 2.07e11")]
    poisson_ratio: Annotated[float, Field(ge=0, lt=0.5), about("Poisson's ratio", paper="Table 1: 0.3")]
    tilt_deg: Annotated[float, Field(ge=0, lt=90), about(
        "tilt: the plate falls off towards +x")] = 0.0
    yield_stress_Pa: Annotated[ContactStrength | None, about(
        "yield stress (docs/plate.md); absent: the plate stays elastic",
    )] = None
    wall_height_m: Annotated[dict[Edge, Positive], about(
        "rigid walls (docs/stones.md) by edge: their height above the top face")] = {}

    @property
    def wall_boxes_m(self) -> dict[Edge, tuple[float, ...]]:
        """XMIN XMAX YMIN YMAX ZMIN ZMAX of each wall by its edge."""
        return {edge: wall_box_m(edge, self.size_m, height) for edge, height in self.wall_height_m.items()}


class RigidPlate(Plate):
    """A plate that does not move has no key but these."""


class FlexiblePlate(Plate):
    """A plate that bends, described by its modes up to `max_frequency_Hz`.

    The frequency is given, or follows from the scene's stones, and its tolerance if there is one.
    """

    thickness_m: Annotated[Positive, about("thickness, at most a fifth of the shorter side")]
    theory: Annotated[Literal["auto", "kirchhoff", "mindlin"], about("plate theory (docs/plate.md)")] = "auto"
    edges: Annotated[Literal["free", "simply_supported", "clamped"], about("how all four edges are held")] = "free"
    max_frequency_Hz: Annotated[Positive | None, about(
        "frequency up to which modes are kept; absent: by the shortest contact (docs/accuracy.md)")] = None
    damping_ratio: Annotated[float, Field(ge=0, lt=1), about("damping ratio of every mode")]
    mesh_size_m: Annotated[Positive | None, about(
        "side of a finite element; absent: from max_frequency_Hz and rods")] = None
    rods: Annotated[tuple[Rod, ...], about(
        "rods below the plate", paper="four screws, their size not given")] = ()
    ribs_m: Annotated[dict[Literal["x", "y"], Annotated[tuple[PlaceAndSection, ...], Strict(False)]], about(
        "ribs (docs/plate.md) by the side along which they run: place on the other side, width and height"),
        Field(exclude_if=lambda ribs: not ribs)] = {}  # hashes of plates without do not depend on it
    sensors: Annotated[tuple[Sensor, ...], about("sensors")] = ()

    @property
    def ribs(self) -> tuple[Rib, ...]:
        """The ribs along x, and after them those along y."""
        return tuple(Rib("xy".index(along), at_m, (width, height))
                     for along in ("x", "y") for at_m, width, height in self.ribs_m.get(along, ()))

    @property
    def accelerometers(self) -> tuple[Sensor, ...]:
        """The sensors of acceleration, which recognition takes."""
        return tuple(sensor for sensor in self.sensors if sensor.kind == "acceleration")

    @model_validator(mode="after")
    def _inside(self) -> Self:
        shortest = min(self.size_m)
        if self.thickness_m > 0.2 * shortest:
            raise Refused("thickness_m", self.thickness_m, f"must be at most a fifth of the side, {0.2 * shortest:g}")
        if self.mesh_size_m is not None and self.mesh_size_m > shortest:
            raise Refused("mesh_size_m", self.mesh_size_m, f"must be at most the shorter side, {shortest:g}")
        tables: list[tuple[str, tuple[Rod | Sensor, ...]]] = [("rods", self.rods), ("sensors", self.sensors)]
        for name, items in tables:
            for i, item in enumerate(items):
                margin = item.diameter_m / 2 if isinstance(item, Rod) else 0.0
                limits = [side / 2 - margin for side in self.size_m]
                if any(abs(x) > limit * (1 + 1e-12) for x, limit in zip(item.place_m, limits, strict=True)):
                    raise Refused(f"{name}.{i}.place_m", item.place_m,
                                  "must lie on the plate, within {:g} and {:g} of its centre".format(*limits))
        return self

    @model_validator(mode="after")
    def _ribs_fit(self) -> Self:
        if self.ribs and not (self.rods and self.edges == "free"):
            raise Refused("ribs_m", f"{len(self.ribs)} ribs", "needs a plate with free edges on rods")
        for i, rib in enumerate(self.ribs):
            before = [other for other in self.ribs[:i] if other.axis == rib.axis]
            limit = (self.size_m[1 - rib.axis] - rib.section_m[0]) / 2
            wrong = ""
            if rib.section_m[1] < rib.section_m[0]:
                wrong = "must be at least as high as wide"
            elif not abs(rib.at_m) <= limit * (1 + 1e-12):
                wrong = f"its place must be from {-limit:g} to {limit:g}: on the plate"
            elif any(abs(other.at_m - rib.at_m) < (other.section_m[0] + rib.section_m[0]) / 2 for other in before):
                wrong = "must not overlap another rib"
            for k, rod in enumerate(self.rods):
                if abs(rod.place_m[1 - rib.axis] - rib.at_m) < (rod.diameter_m + rib.section_m[0]) / 2:
                    wrong = wrong or f"must leave room for rods.{k}"
            if wrong:
                raise Refused(f"ribs_m.{'xy'[rib.axis]}.{len(before)}", (rib.at_m, *rib.section_m), wrong)
        return self

    @model_validator(mode="after")
    def _distinct(self) -> Self:
        for i, rod in enumerate(self.rods):
            for other in self.rods[:i]:
                gap = math.dist(rod.place_m, other.place_m)
                if gap < (rod.diameter_m + other.diameter_m) / 2:
                    raise Refused(f"rods.{i}.place_m", rod.place_m, "must not overlap another rod")
        names = [sensor.name for sensor in self.sensors]
        for i, name in enumerate(names):
            if name in names[:i]:
                raise Refused(f"sensors.{i}.name", name, "must differ from the other sensors' names")
        return self


def _kind(table: Any) -> str:
    more = isinstance(table, FlexiblePlate) or (isinstance(table, dict) and set(table) - RigidPlate.model_fields.keys())
    return "flexible" if more else "rigid"


PlateTable = Annotated[Annotated[FlexiblePlate, Tag("flexible")] | Annotated[RigidPlate, Tag("rigid")],
                       Discriminator(_kind)]


def read_plate(path: str | Path) -> FlexiblePlate | RigidPlate:
    """Return the checked `[plate]` table of a scene file. Raises InputError on any mistake in it."""
    data = scene_tables(path)
    if not isinstance(data.get("plate"), dict):
        raise InputError(f"{path}: plate is missing: a table [plate] must be given")
    plate: FlexiblePlate | RigidPlate = check(PlateTable, data["plate"], path, "plate")
    return plate
