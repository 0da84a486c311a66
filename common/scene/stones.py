"""The `[stones]` table of a scene: what falls.

There are three ways to say it: a volley of equal stones (`count`, `radius_m`, ...), one by one (`[[stones.each]]`), or
drawn from distributions (`[stones.drawn]`), which are a stream where they come at a rate. dem/stones/arrangement.py
makes one list of them.
"""

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag, ValidationInfo, field_validator, model_validator

from common.scene.distribution import Spread, one_value, refuse_outside
from common.tables import NotNegative, Positive, Refused, Table, about

Seed = Annotated[int, Field(ge=0, lt=2**63)]
Kind = Literal["coal", "gangue"]  # what a stone counts as in the mixing ratio
COAL, GANGUE = KINDS = ("coal", "gangue")  # also their materials, but of stones one by one
By = Literal["mass", "number"]
SPHERE = "sphere"
MOST_STONES = 10_000
LARGEST_SIZE_m = 10.0
FASTEST_m_s, MOST_SPIN_rad_s = 1e3, 1e5
Speed = Annotated[float, Field(ge=0, le=FASTEST_m_s)]
Radius = Annotated[float, Field(gt=0, le=LARGEST_SIZE_m / 2)]
Pair = Annotated[tuple[float, float], BeforeValidator(lambda pair: tuple(pair) if isinstance(pair, list) else pair)]
VOLLEY = ("count", "radius_m", "speed_m_s", "positions_m", "gangue_ratio")
ONLY_VOLLEY = ("radius_m", "speed_m_s", "positions_m", "gangue_order")
WAYS = ("each", "drawn")
Extent = Annotated[float, Field(ge=0.2, le=1)]
Velocity = Annotated[
    Annotated[Speed, Tag("speed")] | Annotated[tuple[float, float, float], Tag("velocity")],
    Discriminator(lambda value: "velocity" if isinstance(value, (list, tuple)) else "speed")]


class AgglomerateTable(Table):
    """How a stone is made of bonded sub-spheres."""

    subspheres: Annotated[int, Field(ge=2, le=100_000), about("sub-spheres of a stone")]
    damping_ratio: Annotated[float, Field(ge=0, le=1), about("damping ratio of the bonds (docs/bonds.md)")] = 0.05
    unbreakable: Annotated[bool, about("bonds never break")] = False
    contact: Annotated[Literal["sub_spheres", "smooth", "faces"] | None, about(
        "how a stone touches the plate (docs/contact.md); absent: \"smooth\" where all stones are spheres, else "
        "\"faces\"")] = None


class EachStone(Table):
    """One stone."""

    material: Annotated[str, about("name of its table in materials")]
    radius_m: Annotated[Radius, about("radius of the sphere of equal volume")]
    shape: Annotated[str, about("\"sphere\", or the name of a table in shapes")] = SPHERE
    place_m: Annotated[Pair, about("place of its centre at touch, along length and width")]
    velocity_m_s: Annotated[Velocity, about(
        "velocity at touch, along length, width and upwards from the plate; a number alone: straight down")]
    spin_rad_s: Annotated[tuple[float, float, float], about("rate of turn about the same axes")] = (0.0, 0.0, 0.0)
    arrival_s: Annotated[NotNegative, about("when it touches; 0: it starts gap_m above the plate")] = 0.0
    attitude: Annotated[tuple[float, float, float, float] | None, about(
        "unit quaternion (w, x, y, z) of its rotation; absent: none")] = None

    @model_validator(mode="after")
    def _moves(self) -> Self:
        velocity = self.velocity_m_s if isinstance(self.velocity_m_s, tuple) else (0.0, 0.0, -self.velocity_m_s)
        if velocity[2] > 0:
            raise Refused("velocity_m_s", velocity, "must not go upwards, its third value must be at most 0")
        if max(map(abs, velocity)) > FASTEST_m_s:
            raise Refused("velocity_m_s", velocity, f"each value must be from -{FASTEST_m_s:g} to {FASTEST_m_s:g}")
        if max(map(abs, self.spin_rad_s)) > MOST_SPIN_rad_s:
            raise Refused("spin_rad_s", self.spin_rad_s, f"each value must be from -{MOST_SPIN_rad_s:g} to "
                          f"{MOST_SPIN_rad_s:g}")
        if self.attitude is not None and abs(sum(q * q for q in self.attitude) - 1) > 1e-6:
            raise Refused("attitude", self.attitude, "must be a unit quaternion, its squares add up to 1")
        return self


class DrawnTable(Table):
    """Stones that are drawn: stones.count, or a stream at a steady rate. Quantities are numbers or distributions."""

    rate_1_s: Annotated[Positive | None, about("stones a second, while stones arrive; a rate makes a stream")] = None
    rate_kg_s: Annotated[Positive | None, about("the same by mass")] = None
    arrival_s: Annotated[Spread, about(
        "when a stone touches; 0: all start gap_m above the plate; of a rate [begin, end]",
    )] = one_value(0.0)
    size_m: Annotated[Spread, about("diameter of the sphere of equal volume")]
    speed_m_s: Annotated[Spread | None, about("speed at touch, straight down")] = None
    drop_height_m: Annotated[Spread | None, about(
        "height of fall until touch; or speed_m_s")] = None
    footprint_m: Annotated[tuple[Pair, Pair] | None, about(
        "from and to of the centres, along length and width; absent: the plate less half the largest size")] = None
    spin_rad_s: Annotated[Spread, about("rate of turn, about a random axis")] = one_value(0.0)
    least_fragment: Annotated[Annotated[int, Field(ge=2)] | None, about(
        "fragments of fewer sub-spheres are taken out and counted as they fly; absent: none")] = None

    @model_validator(mode="after")
    def _within_bounds(self) -> Self:
        if (self.speed_m_s is None) == (self.drop_height_m is None):
            raise Refused("speed_m_s", None, "either this or drop_height_m must be given")
        refuse_outside("size_m", self.size_m, 1e-6, LARGEST_SIZE_m, f"must be from 1e-6 to {LARGEST_SIZE_m:g}")
        refuse_outside("speed_m_s", self.speed_m_s, 0, FASTEST_m_s, f"must be from 0 to {FASTEST_m_s:g}")
        refuse_outside("drop_height_m", self.drop_height_m, 0, 1e4, "must be from 0 to 10000")
        refuse_outside("spin_rad_s", self.spin_rad_s, 0, MOST_SPIN_rad_s, f"must be from 0 to {MOST_SPIN_rad_s:g}")
        refuse_outside("arrival_s", self.arrival_s, 0, 1e6, "must be from 0 to 1e6")
        if self.footprint_m is not None and any(end < begin for begin, end in self.footprint_m):
            raise Refused("footprint_m", self.footprint_m, "each pair must ascend")
        return self

    @model_validator(mode="after")
    def _how_many(self) -> Self:
        if self.rate_1_s is not None and self.rate_kg_s is not None:
            raise Refused("rate_kg_s", self.rate_kg_s, "must be left out where rate_1_s is given")
        if self.is_stream and (not self.arrival_s.is_even or not self.lasts_s > 0):
            raise Refused("arrival_s", self.arrival_s.bounds, "must be [begin, end], some time apart, "
                          "where a rate is given")
        return self

    @property
    def is_stream(self) -> bool:
        """Do stones come at a rate?"""
        return self.rate_1_s is not None or self.rate_kg_s is not None

    @property
    def gangue_by(self) -> By:
        """What the mixing ratio is a share of."""
        return "mass" if self.is_stream else "number"

    @property
    def lasts_s(self) -> float:
        """From the first to the last arrival that may be."""
        begin, end = self.arrival_s.bounds
        return end - begin


class StonesTable(Table):
    """The stones, where they are, and how they arrive."""

    count: Annotated[Annotated[int, Field(ge=1, le=MOST_STONES)] | None, about(
        "number of stones of a volley (docs/stones.md), or drawn", paper="10")] = None
    radius_m: Annotated[Radius | None, about("radius of a stone of a volley", paper="0.025")] = None
    speed_m_s: Annotated[Speed | None, about("impact speed of a volley, downwards", paper="3.0")] = None
    positions_m: Annotated[tuple[Pair, ...] | None, about(
        "place of the centre of each stone; a number alone: radius of their circle, stone 1 on the x axis",
        paper="0.1")] = None
    gap_m: Annotated[float, Field(gt=0, le=100), about("gap to the plate at the start; gravity adds speed")] = 2e-5
    gangue_order: Annotated[tuple[Annotated[int, Field(ge=1)], ...], Field(validate_default=True), about(
        "which stone turns into gangue first; those not named follow in ascending order")] = ()
    gangue_ratio: Annotated[Annotated[float, Field(ge=0, le=1)] | None, about(
        "share of gangue by number, in a stream by mass; in a volley a multiple of 1/count",
        paper="0 to 1 in steps of 0.1")] = None
    seed: Annotated[Seed, about("seed of draws and packings; stone k of up to ten that are not drawn has seed + k - 1")]
    each: Annotated[tuple[EachStone, ...] | None, Field(min_length=1, max_length=MOST_STONES), about(
        "stones one by one, instead of a volley")] = None
    drawn: Annotated[DrawnTable | None, about("stones drawn from distributions, instead of a volley")] = None
    agglomerate: Annotated[AgglomerateTable | None, about(
        "how a stone is made; absent: each stone is one unbonded sphere")] = None

    @field_validator("positions_m", mode="before", json_schema_input_type=Positive | tuple[Pair, ...])
    @classmethod
    def _on_a_circle(cls, places: Any, info: ValidationInfo) -> Any:
        """A radius stands for places at equal angles."""
        if isinstance(places, bool) or not isinstance(places, (int, float)):
            return places
        if not places > 0:
            raise ValueError("must be above 0, the radius of a circle, or a list of places")
        angle = 2 * np.pi * np.arange(count := info.data.get("count") or 1) / count
        return tuple(map(tuple, (places * np.column_stack([np.cos(angle), np.sin(angle)])).tolist()))

    @field_validator("gangue_order")
    @classmethod
    def _each_once(cls, order: tuple[int, ...]) -> tuple[int, ...]:
        if len(set(order)) < len(order):
            raise ValueError("must name each stone at most once")
        return order

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        ways = [way for way in WAYS if getattr(self, way) is not None]
        if len(ways) > 1:
            raise Refused(ways[1], "...", f"must be left out where stones.{ways[0]} is given")
        if ways:
            no = ONLY_VOLLEY + (("count", "gangue_ratio") if ways == ["each"] else ())
            for key in no:
                if getattr(self, key) not in (None, ()):
                    raise Refused(key, getattr(self, key), f"must be left out where stones.{ways[0]} is given")
            if self.gangue_ratio is None and ways != ["each"]:
                raise Refused("gangue_ratio", None, f"must be given where stones.{ways[0]} is")
            if self.drawn is not None and (self.count is None) != self.is_stream:
                raise Refused("count", self.count, "one of this, drawn.rate_1_s and drawn.rate_kg_s must be given")
            return self
        for key in VOLLEY:
            if getattr(self, key) is None:
                raise Refused(key, None, "a value must be given, unless each or drawn says what falls")
        stones = range(1, (self.count or 0) + 1)
        if self.positions_m is not None and len(self.positions_m) != len(stones):
            raise Refused("positions_m", f"{len(self.positions_m)} places", f"must be {len(stones)}, one a stone")
        whole = (*(k for k in self.gangue_order if k in stones), *(k for k in stones if k not in self.gangue_order))
        object.__setattr__(self, "gangue_order", whole)  # as the scene is run
        return self

    @property
    def volley(self) -> tuple[int, float]:
        """Number and radius of the stones of a volley. Raises Refused where there is none."""
        if self.count is None or self.radius_m is None:
            raise Refused("count", None, "must be given with radius_m: this needs a volley of equal stones")
        return self.count, self.radius_m

    @property
    def is_stream(self) -> bool:
        """Do stones come one after another, at a rate?"""
        return self.drawn is not None and self.drawn.is_stream

    @property
    def shares_gangue(self) -> bool:
        """Does `gangue_ratio` decide which stones are gangue?"""
        return self.each is None


class ShapeTable(Table):
    """A kind of stone: random convex polyhedra, each by its seed."""

    extent_ratios: Annotated[tuple[Extent, Extent], about(
        "elongation and flatness: middle over longest extent, shortest over middle")] = (1.0, 1.0)
    corners: Annotated[int, Field(ge=6, le=200), about("corners of a polyhedron")] = 16


Shape = ShapeTable | str
