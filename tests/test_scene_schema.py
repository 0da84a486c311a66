"""The JSON schema of a scene and docs/scene.md say what the code says, and shipped scenes keep to them."""

import copy
import json
import tomllib
from pathlib import Path

import jsonschema
import pytest

from common.scene.file import scene_tables
from common.scene.scene import Scene
from common.tables import InputError, check
from lab.scene_schema import PAGE, SCHEMA, scene_page, scene_schema

ROOT = Path(__file__).resolve().parents[1]
NOT_SCENES = ("campaign.toml", "dataset.toml", "dataset_held_out.toml", "dataset_natural.toml",
              "streams.toml")  # plans of many runs
SCENES = sorted(file for file in (ROOT / "scenes").glob("*.toml") if file.name not in NOT_SCENES)
PAPER = scene_tables(ROOT / "scenes" / "paper.toml")


def validator():
    schema = json.loads((ROOT / SCHEMA).read_text())
    kind = jsonschema.validators.validator_for(schema)
    kind.check_schema(schema)
    return kind(schema)


@pytest.mark.parametrize("file, written", [(SCHEMA, lambda: json.dumps(scene_schema(), indent=1) + "\n"),
                                           (PAGE, scene_page)], ids=[SCHEMA, PAGE])
def test_what_is_written_from_the_code_is_up_to_date(file, written):
    assert (ROOT / file).read_text() == written(), "python -m lab.scene_schema writes it anew"


@pytest.mark.parametrize("file", SCENES, ids=lambda file: file.name)
def test_a_shipped_scene_keeps_to_the_schema_that_it_names(file):
    text = file.read_text()
    first = text.splitlines()[0]
    assert first.startswith("#:schema ") and (file.parent / first.split()[1]).resolve() == (ROOT / SCHEMA).resolve()
    validator().validate(tomllib.loads(text))


# (path of keys, value): each is refused by the schema and by the program that reads the scene.
MISTAKES = [
    (("stones", "cuont"), 3), (("stones", "count"), 0), (("stones", "count"), 2.5), (("stones", "radius_m"), -1.0),
    (("stones", "gangue_ratio"), 1.5), (("stones", "gangue_order"), [0]),
    (("stones", "agglomerate", "contact"), "soft"),
    (("time", "duration_s"), 0.0), (("time", "duration_s"), "long"),
    (("materials", "Coal"), PAPER["materials"]["coal"]),
    (("materials", "coal", "youngs_modulus_Pa"), 1e6), (("materials", "coal", "bond", "friction_angle_deg"), 90.0),
    (("contacts", "coal_coal", "restitution"), 0.05), (("plate", "model"), "rigid"), (("plate", "poisson_ratio"), 0.5),
    (("plate", "rods", 0, "length"), 1.0), (("plate", "sensors", 0, "name"), "a b"), (("time", "view"), 1e-3),
    (("engine", "np"), 257), (("name",), "../paper"), (("tolerance",), 0.2), (("stones", "unbreakable"), True),
]  # fmt: skip


@pytest.mark.parametrize("path, value", MISTAKES, ids=[".".join(map(str, path)) for path, _ in MISTAKES])
def test_the_schema_refuses_what_the_program_refuses(path, value):
    scene = copy.deepcopy(PAPER)
    table = scene
    for key in path[:-1]:
        table = table.setdefault(key, {}) if isinstance(table, dict) else table[key]
    table[path[-1]] = value
    with pytest.raises(InputError):
        check(Scene, scene, "x.toml")
    with pytest.raises(jsonschema.ValidationError):
        validator().validate(scene)
