"""The lab sheet of a rock, E, nu, Brazilian strength, UCS and K, and the scene whose bonds are to be like it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from common.resources import resource
from common.scene.file import scene_tables
from common.scene.scene import Scene
from common.tables import InputError, check, read_toml

TARGETS = resource("scenes/materials/targets.toml")
OF_ANY_SHEET = "tensile_strength_Pa"  # by which a sheet is told from a file of several
ELASTIC = ("density_kg_m3", "youngs_modulus_Pa", "poisson_ratio")


@dataclass(frozen=True)
class Sheet:
    """A table of TargetTable, not checked yet, the file and the key that it stands under, and the name of its rock."""

    table: dict[str, Any]
    file: Path
    where: str
    rock: str


def find_sheet(material: str, scene_file: str | Path, rock: str | None = None, targets: Path | None = None) -> Sheet:
    """The sheet of a material: the file `targets`, or its table of the rock's or the material's name; without that
    [targets.MATERIAL] of the scene; without that the shipped one of the rock's or the material's name. Raises
    InputError."""
    _tables(material, scene_file)
    name = rock or named_in(scene_file, material) or material
    if not name.isidentifier():
        raise InputError(f"--rock = {name!r}: must be a name of letters and digits, which a file gets")
    if targets is not None:
        tables = read_toml(targets)
        if OF_ANY_SHEET in tables:
            return Sheet(tables, targets, "", name)
        return _of(tables, targets, (name, material), name)
    own = read_toml(scene_file).get("targets")
    if rock is None and isinstance(own, dict) and material in own:
        return _of(own, Path(scene_file), (material,), name, "targets.")
    return _of(read_toml(TARGETS), TARGETS, (rock or material, name), name)


def _of(tables: dict[str, Any], file: Path, names: tuple[str, ...], rock: str, above: str = "") -> Sheet:
    name = next((name for name in names if isinstance(tables.get(name), dict)), None)
    if name is None:
        raise InputError(f"{file}: {above}{names[0]} is missing: a table with the strengths of the rock must be given")
    return Sheet(tables[name], file, f"{above}{name}", rock)


def named_in(scene_file: str | Path, material: str) -> str | None:
    """The name of the file, in materials/, that a scene takes a material from, None if it says all itself."""
    materials = read_toml(scene_file).get("materials")
    name = materials.get(material) if isinstance(materials, dict) else None
    return name if isinstance(name, str) else None


def scene_with(material: str, scene_file: str | Path, sheet: dict[str, Any]) -> Scene:
    """The scene, whose material need not have its bonds, which are sought, nor what the sheet gives. Raises
    InputError."""
    data = _tables(material, scene_file)
    if isinstance(table := data["materials"][material], dict):
        elastic = {key: sheet[key] for key in ELASTIC if key in sheet}
        # Any bonds will do: the fit begins without them.
        bond = {"youngs_modulus_Pa": 1e9, "stiffness_ratio": 1.0, "tensile_strength_Pa": 1e6, "shear_strength_Pa": 1e6}
        data["materials"][material] = {"bond": bond, **table, **elastic}
    return check(Scene, data, scene_file)


def _tables(material: str, scene_file: str | Path) -> dict[str, Any]:
    """The tables of a scene. Raises InputError where it has no such material."""
    data = scene_tables(scene_file, sought=material)
    materials = data.get("materials")
    named = sorted(materials) if isinstance(materials, dict) else []
    if material not in named:
        raise InputError(f"MATERIAL = {material!r}: must be one of {named}, the materials of {scene_file}")
    return data
