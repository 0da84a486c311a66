"""The `[shapes.NAME]` tables of a scene: stones that are no spheres."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from common.tables import Refused, Table, about

Axis = Annotated[float, Field(ge=0.2, le=1)]


class ShapeTable(Table):
    """A kind of stone: random convex polyhedra, each by its seed, or the closed surface in a file."""

    elongation: Annotated[Axis, about("middle over longest extent of a polyhedron")] = 1.0
    flatness: Annotated[Axis, about("shortest over middle extent")] = 1.0
    corners: Annotated[Annotated[int, Field(ge=6, le=200)] | None, about(
        "corners of a polyhedron; or sphericity; without either 16")] = None
    sphericity: Annotated[Annotated[float, Field(ge=0.5, lt=1)] | None, about(
        "area of the sphere of equal volume over that of a polyhedron, as near as corners allow"),
    ] = None
    file: Annotated[str | None, about(
        "closed mesh, such as an STL file, beside the scene; without other keys")] = None

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if self.corners is not None and self.sphericity is not None:
            raise Refused("sphericity", self.sphericity, "must be left out where corners is given")
        if self.file is not None:
            for key in ("corners", "sphericity"):
                if getattr(self, key) is not None:
                    raise Refused(key, getattr(self, key), "must be left out where file is given")
            if (self.elongation, self.flatness) != (1.0, 1.0):
                raise Refused("elongation", self.elongation, "must be left out where file is given, as flatness must")
        return self
