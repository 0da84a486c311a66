"""The tables of a scene file: what it takes from the scene that it begins from, and materials by their names."""

import os
from pathlib import Path
from typing import Any

from common.resources import resource
from common.scene.stones import ONLY_VOLLEY, WAYS
from common.tables import InputError, read_toml

MOST_BASES = 10  # one from another
OF_A_MATERIAL = ("kind", "density_kg_m3", "youngs_modulus_Pa", "poisson_ratio", "contact_strength_Pa", "bond")


def scene_tables(path: str | Path, through: tuple[Path, ...] = (), sought: str = "") -> dict[str, Any]:
    """The tables of a scene with those of its `base`, less the keys of `without`, under its own, table by table; with
    materials read from their files, and whole paths of shapes. Files are beside the scene that names them.

    through: scenes that begin from this one, one from another. sought: a material whose file need not be there yet.
    `targets`, what a calibration fits, is no part of a scene. Raises InputError.
    """
    data = _with_base(Path(path), through)
    data.pop("targets", None)
    read_named(data, Path(path), sought)
    return data


def read_named(data: dict[str, Any], path: Path, sought: str = "") -> None:
    """Put materials that are named in place of their names, and whole paths in place of those of shapes."""
    materials, shapes = data.get("materials"), data.get("shapes")
    if isinstance(materials, dict):
        data["materials"] = {key: _material(path, key, value, sought) if isinstance(value, str) else value
                             for key, value in materials.items()}
    if isinstance(shapes, dict):
        data["shapes"] = {key: os.path.abspath(path.parent / value) if isinstance(value, str) else value
                          for key, value in shapes.items()}


def _with_base(path: Path, seen: tuple[Path, ...]) -> dict[str, Any]:
    data = read_toml(path)
    base, without = data.pop("base", None), data.pop("without", [])
    if base is None:
        if without:
            raise InputError(f"{path}: without = {without}: must be left out where there is no base")
        return data
    if not isinstance(base, str) or "\0" in base:
        raise InputError(f"{path}: base = {base!r}: must be the name of a scene file")
    if not isinstance(without, list) or not all(isinstance(key, str) for key in without):
        raise InputError(f"{path}: without = {without!r}: must be a list of dotted keys of the base")
    if path.resolve() in seen or len(seen) >= MOST_BASES:
        raise InputError(f"{path}: base = {base!r}: must not lead back to this scene, nor through "
                         f"more than {MOST_BASES}")
    under = scene_tables(_found(path, base, "scenes"), (*seen, path.resolve()))
    for key in without:
        _leave_out(under, key, path)
    _make_way(under.get("stones"), data.get("stones"))
    return _merged(under, data)


def _make_way(under: Any, over: Any) -> None:
    """Another way of saying what falls takes the place of the base's."""
    if not isinstance(under, dict) or not isinstance(over, dict):
        return
    if any(way in over and way not in under for way in WAYS):
        for key in ("count", *ONLY_VOLLEY, *WAYS, *(["gangue_ratio"] if "each" in over else [])):
            under.pop(key, None)


def _found(path: Path, name: str, shipped: str) -> Path:
    """A file beside `path`, or else one that is shipped."""
    beside, own = path.parent / name, resource(shipped) / name
    # os.path tells no error of a name that no file can have: opening the file does.
    return beside if os.path.exists(beside) or not os.path.exists(own) else own


def _leave_out(data: dict[str, Any], dotted: str, path: Path) -> None:
    *tables, last = dotted.split(".")
    table: Any = data
    for name in tables:
        table = table.get(name) if isinstance(table, dict) else None
    if not isinstance(table, dict) or last not in table:
        raise InputError(f"{path}: without = {dotted!r}: must name a key that the base has")
    del table[last]


def _merged(under: Any, over: Any) -> Any:
    """Tables key by key; of anything else the one above."""
    if not isinstance(under, dict) or not isinstance(over, dict):
        return over
    return under | {key: _merged(under[key], value) if key in under else value for key, value in over.items()}


def _material(path: Path, key: str, name: str, sought: str) -> dict[str, Any]:
    if not name.isidentifier():
        raise InputError(f"{path}: materials.{key} = {name!r}: must be a table, or the name of a file in materials/")
    file = _found(path, f"materials/{name}.toml", "scenes")
    try:
        table = {} if key == sought and not os.path.exists(file) else read_toml(file)
    except InputError as error:
        raise InputError(f"{path}: materials.{key} = {name!r}: {error}") from None
    return {of: table[of] for of in OF_A_MATERIAL if of in table}
