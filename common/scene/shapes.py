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
    corners: Annotated[int, Field(ge=6, le=200), about("corners of a polyhedron")] = 16
    file: Annotated[str | None, about(
        "closed mesh, such as an STL file, beside the scene; without other keys")] = None

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        for key, field in type(self).model_fields.items():
            if self.file is not None and key != "file" and getattr(self, key) != field.default:
                raise Refused(key, getattr(self, key), "must be left out where file is given")
        return self
