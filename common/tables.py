"""Scene tables: read a TOML file and check its values, with one line per mistake."""

import json
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator

from common.input_error import (
    InputError as InputError,
    refuse_monstrous as refuse_monstrous,
    refuse_unreadable as refuse_unreadable,
)

MOST_TOML_BYTES = 10e6  # the shipped scenes have some kB
#: What says the same as keys of earlier versions.
INSTEAD = {
    "circle_radius_m": "positions_m = RADIUS",
    "count": "stones.count",
    "elongation": "extent_ratios = [elongation, flatness]",
    "file": "shapes.NAME = \"FILE\"",
    "flatness": "extent_ratios = [elongation, flatness]",
    "gangue_by": "a rate for a share by mass, count for one by number",
    "length_m": "size_m = [x, y]",
    "model": "thickness_m and damping_ratio of a plate that bends, neither of one that does not move",
    "output": "time.view_interval_s, which takes each impact every 20 us",
    "poisson_ratio": "that of the plate or of the material",
    "pressure_threshold_Pa": "pressure_strengthening, from any pressure on",
    "point_supports": "edges, or short rods",
    "rosin_rammler": "rosin_rammler_m, exponent and within = [least, most]",
    "seed": "stones.seed",
    "shapes": "tables [shapes.NAME], all of which fall",
    "speed_m_s": "velocity_m_s = SPEED, straight down",
    "strength_factor": "scatter.strength_factor, or a material of its own",
    "uniform": "[least, most] alone",
    "value": "a number alone",
    "walls": "plate.wall_height_m = { EDGE = height }",
    "width_m": "size_m = [x, y]",
    "x_m": "place_m = [x, y]",
    "y_m": "place_m = [x, y]",
}


class Refused(ValueError):
    """Raised by a validator to refuse one value of its table.

    key is a path inside the table ("rods.0.place_m"), value what was given, allowed what would be accepted.
    """

    def __init__(self, key: str, value: object, allowed: str) -> None:
        super().__init__(f"{key} = {_short(value)}: {allowed}")
        self.key, self.value, self.allowed = key, value, allowed


class UnknownKey(Refused):
    """Of a table: what it may have is told before all else, since an unknown key often explains a missing one."""


class Table(BaseModel):
    """A table of a scene: no unknown keys, no coercion of types, finite numbers, immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _known_keys_and_tuples(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        for key, value in data.items():
            if key not in cls.model_fields:
                raise UnknownKey(key, value, f"unknown key{f'; use {INSTEAD[key]}' if key in INSTEAD else ''}; "
                                             f"allowed here: {', '.join(sorted(cls.model_fields))}")
        return {key: tuple(v) if isinstance(v, list) else v for key, v in data.items()}


def about(meaning: str, *, paper: str | None = None) -> Any:
    """Say what a key means and, if the paper gives it, what the paper gives: `Annotated[type, about("...")]`. Its unit
    follows from its name, its bounds and its default from the field."""
    return Field(description=meaning, json_schema_extra=None if paper is None else {"x-paper": paper})


Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]


class Place(Table):
    """A place in the plane of the plate."""

    place_m: Annotated[tuple[float, float], about("along the plate's length and width, from its centre")]

    @property
    def x_m(self) -> float:
        """Along the length."""
        return self.place_m[0]

    @property
    def y_m(self) -> float:
        """Along the width."""
        return self.place_m[1]


@contextmanager
def refused_in(file: str | Path, where: str) -> Iterator[None]:
    """Turn a `Refused` raised inside the block into an InputError that names the file and the table `where`."""
    try:
        yield
    except Refused as error:
        raise InputError(f"{file}: {where}.{error.key} = {_short(error.value)}: {error.allowed}") from None


def read_toml(path: str | Path) -> dict[str, Any]:
    """Return the content of a TOML file. Raises InputError if it cannot be read or is not TOML."""
    path = Path(path)
    refuse_unreadable(path, MOST_TOML_BYTES)
    try:
        with path.open("rb") as file:
            content = tomllib.load(file)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except RecursionError:
        raise InputError(f"{path}: not a TOML file: tables within tables, too deep") from None
    except ValueError as error:  # of TOML, UTF-8 or a number of too many digits
        raise InputError(f"{path}: not a TOML file: {str(error).partition('; use sys.')[0]}") from None
    refuse_monstrous(path, content)
    return content


def inline_toml(value: Any) -> str:
    """A value of a scene in TOML on one line, as `--set` reads it."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {inline_toml(v)}" for key, v in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(inline_toml, value)) + "]"
    return json.dumps(value) if isinstance(value, (str, bool)) else repr(value)


def check(model_class: Any, data: Mapping[str, Any], file: str | Path, where: str = "") -> Any:
    """`data`, as read from a file, as an instance of a `Table` or a union of tables. The names of the file and of the
    table, `where`, go into the message. Raises InputError for the first mistake, that of an unknown key if there is
    any."""
    try:
        return _adapter(model_class).validate_python(data)
    except ValidationError as error:
        mistakes = error.errors()
        unknown = [m for m in mistakes if isinstance(m.get("ctx", {}).get("error"), UnknownKey)]
        message = _describe((unknown or mistakes)[0], data, where)
        raise InputError(f"{file}: {message}") from None


@cache
def _adapter(model_class: Any) -> TypeAdapter[Any]:
    return TypeAdapter(model_class)


def _describe(mistake: Mapping[str, Any], data: Any, where: str) -> str:
    kind, context = mistake["type"], mistake.get("ctx", {})
    keys, value = _key_path(mistake["loc"], data, keep_last=kind == "missing")
    if kind == "value_error" and isinstance(context["error"], Refused):
        refused = context["error"]
        keys, value, allowed = [*keys, refused.key], refused.value, refused.allowed
    else:
        allowed = _allowed(mistake)
    path = ".".join([where, *map(_clip, keys)] if where else map(_clip, keys)) or "(top level)"
    if kind == "missing":
        return f"{path} is missing: a value must be given"
    return f"{path} = {_short(value)}: {allowed}"


def _allowed(mistake: Mapping[str, Any]) -> str:
    text = mistake["msg"].removeprefix("Value error, ").removeprefix("Input ")
    text = "must be a table" if mistake["type"] in ("model_type", "dict_type") else text[0].lower() + text[1:]
    return text.replace("should", "must").replace("tuple", "list").replace(" after validation", "")


def _key_path(location: Sequence[str | int], data: Any, keep_last: bool) -> tuple[list[str], Any]:
    """Return the keys as written in the file, and the value there. Tags of unions are left out: the file has none."""
    keys = []
    for depth, part in enumerate(location):
        try:
            data = data[part]
        except (LookupError, TypeError):  # a tag, or what is missing
            if not (keep_last and depth == len(location) - 1):
                continue
        keys.append(str(part))
    return keys, data


def _short(value: object) -> str:
    return _clip(repr(value).replace("\n", " "))


def _clip(text: str) -> str:
    return text if len(text) <= 60 else text[:57] + "..."
