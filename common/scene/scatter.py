"""The `[scatter]` table of a scene: what each stone has of its own."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from common.scene.distribution import Spread, refuse_outside
from common.tables import Positive, Table, about

LEAST_RESTITUTION = 0.051  # LIGGGHTS refuses 0.05 and less
FACTORS = ("radius_factor", "density_factor", "youngs_modulus_factor", "strength_factor", "speed_factor")
OF_DRAWN = ("radius_factor", "speed_factor", "place_m", "arrival_s")  # what drawn stones have in their own table


class ScatterTable(Table):
    """What each stone has of its own. A key is a number or a distribution; the mixing ratio changes nothing in it."""

    seed: Annotated[Annotated[int, Field(ge=0, lt=2**63)] | None, about(
        "seed of what is drawn; absent: stones.seed")] = None
    radius_factor: Annotated[Spread | None, about("factor on a stone's radius")] = None
    density_factor: Annotated[Spread | None, about("factor on its density")] = None
    youngs_modulus_factor: Annotated[Spread | None, about("factor on the Young's modulus of stone and bonds")] = None
    strength_factor: Annotated[Spread | None, about(
        "factor on the strengths of its bonds; their fracture energy has its square")] = None
    restitution: Annotated[Spread | None, about(
        "coefficient of restitution on the plate; on other stones: docs/stones.md")] = None
    speed_factor: Annotated[Spread | None, about("factor on its impact velocity")] = None
    place_m: Annotated[Positive | None, about(
        "radius of the disc about its place in which a stone is drawn, on the plate and free of others")] = None
    arrival_s: Annotated[Spread | None, about("what is added to its arrival")] = None

    @model_validator(mode="after")
    def _within_bounds(self) -> Self:
        for key in FACTORS:
            refuse_outside(key, getattr(self, key), 0.05, 20.0, "must be from 0.05 to 20")
        refuse_outside("restitution", self.restitution, LEAST_RESTITUTION, 1.0,
                       f"must be from {LEAST_RESTITUTION:g} to 1")
        refuse_outside("arrival_s", self.arrival_s, 0.0, 1e6, "must be from 0 to 1e6")
        return self

    @property
    def drawn(self) -> list[str]:
        """Names of the keys that are given, less the seed."""
        return [key for key in type(self).model_fields if key != "seed" and getattr(self, key) is not None]
