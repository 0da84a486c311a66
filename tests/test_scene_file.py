"""A scene that begins from another, and materials by name."""

from pathlib import Path

import pytest

from common.scene.scene import changed_scene, read_scene
from common.tables import InputError, read_toml
from dem.stones.arrangement import stones_of

ROOT = Path(__file__).resolve().parents[1]
SCENES = ROOT / "scenes"


def test_the_short_scene_is_the_one_written_out():
    assert read_scene(SCENES / "single.toml") == read_scene(ROOT / "tests" / "single.toml")
    lines = [line for line in (SCENES / "single.toml").read_text().splitlines() if line and not line.startswith("#")]
    assert len(lines) <= 10


def written(directory, text, name="scene.toml"):
    (directory / name).write_text(text)
    return directory / name


def test_a_base_is_merged_table_by_table_and_what_is_left_out_is_gone(tmp_path):
    text = 'base = "paper.toml"\nwithout = ["plate.sensors"]\nname = "x"\nplate.tilt_deg = 5.0\n'
    scene = read_scene(written(tmp_path, text))
    paper = read_scene(SCENES / "paper.toml")
    assert scene.plate.sensors == () and scene.plate.rods == paper.plate.rods and scene.plate.tilt_deg == 5.0
    assert scene.stones == paper.stones and scene.name == "x"


def _numbers(table, names=()):
    """Dotted names and values of all numbers that stand in tables of tables."""
    for name, value in table.items():
        if isinstance(value, dict):
            yield from _numbers(value, (*names, name))
        elif isinstance(value, float):
            yield ".".join((*names, name)), value


@pytest.mark.parametrize("name", ["paper", "stream", "wide"])
def test_a_changed_key_of_any_table_leaves_the_others_as_the_base_has_them(tmp_path, name):
    scene = read_scene(SCENES / f"{name}.toml").model_dump(exclude_unset=True)
    changed = dict(_numbers(scene))
    assert {key.split(".")[0] for key in changed} >= {"time", "stones", "materials", "contacts", "plate"}
    for key in {key.rpartition(".")[0]: key for key in changed}.values():  # one of each table
        value = changed[key]
        over = read_scene(written(tmp_path, f'base = "{name}.toml"\nname = "{name}"\n{key} = {value * 0.99}\n'))
        found = dict(_numbers(over.model_dump(exclude_unset=True)))
        assert found == changed | {key: value * 0.99}, key


def test_a_way_of_saying_what_falls_takes_the_place_of_the_bases(tmp_path):
    each = '[[stones.each]]\nmaterial = "coal"\nradius_m = 0.02\nplace_m = [0.0, 0.0]\nvelocity_m_s = 1.0\n'
    scene = read_scene(written(tmp_path, f'base = "paper.toml"\nname = "x"\n{each}'))
    assert scene.stones.count is None and len(stones_of(scene, "x")) == 1
    over = read_scene(written(tmp_path, 'base = "scene.toml"\nname = "y"\n[stones.drawn]\nsize_m = 0.02\n'
                                        "speed_m_s = 1.0\n[stones]\ncount = 2\ngangue_ratio = 0.5\n", "over.toml"))
    assert over.stones.each is None and len(stones_of(over, "y")) == 2


def test_a_table_of_the_same_way_is_merged_key_by_key(tmp_path):
    base = read_scene(SCENES / "stream.toml").stones.drawn
    over = read_scene(written(tmp_path, 'base = "stream.toml"\nname = "x"\nstones.drawn.rate_1_s = 7.0\n'))
    assert over.stones.drawn == base.model_copy(update={"rate_1_s": 7.0}) != base
    written(tmp_path, 'base = "stream.toml"\nname = "y"\nwithout = ["stones.drawn.rate_1_s"]\nstones.count = 3\n',
            "counted.toml")
    changed = written(tmp_path, 'base = "counted.toml"\nname = "z"\nstones.drawn.drop_height_m = 0.3\n', "changed.toml")
    assert read_scene(changed).stones.count == 3  # as the base has it, of which no other way takes the place


def test_a_material_by_its_name_is_that_of_its_file(tmp_path):
    bond = read_toml(SCENES / "materials" / "coal.toml")["bond"]
    assert read_scene(SCENES / "paper.toml").materials["coal"].bond.model_dump(exclude_defaults=True) == bond
    text = (SCENES / "paper.toml").read_text()
    (tmp_path / "materials").mkdir()
    other = "density_kg_m3 = 1500.0\nyoungs_modulus_Pa = 4e9\npoisson_ratio = 0.25\n"
    written(tmp_path / "materials", other, "coal.toml")
    with pytest.raises(InputError, match="materials.coal.bond"):
        read_scene(written(tmp_path, text))  # the one beside the scene comes first, and has no bonds


@pytest.mark.parametrize("material, of_table_1", [("coal", (1380.0, 5.12e9, 0.3)), ("gangue", (2400.0, 9.966e9, 0.28))])
def test_density_and_elastic_constants_are_those_of_the_paper(material, of_table_1):
    for name in ("paper", "small"):
        found = read_scene(SCENES / f"{name}.toml").materials[material]
        assert (found.density_kg_m3, found.youngs_modulus_Pa, found.poisson_ratio) == of_table_1


def test_materials_of_a_base_are_changed_key_by_key_or_replaced_as_a_whole(tmp_path):
    paper = read_scene(SCENES / "paper.toml").materials["coal"]
    (tmp_path / "deep" / "materials").mkdir(parents=True)
    written(tmp_path / "deep", 'base = "paper.toml"\nname = "x"\n[materials]\nslate = "slate"\n'
                               "[materials.coal]\ncontact_strength_Pa = 1e7\n")
    coal = (SCENES / "materials" / "coal.toml").read_text()
    written(tmp_path / "deep" / "materials", coal.replace("1380", "2700"), "slate.toml")
    over = read_scene(written(tmp_path, 'base = "deep/scene.toml"\nname = "y"\nmaterials.coal.poisson_ratio = 0.2\n'))
    assert over.materials["coal"] == paper.model_copy(update={"contact_strength_Pa": 1e7, "poisson_ratio": 0.2})
    assert over.materials["slate"] == paper.model_copy(update={"density_kg_m3": 2700.0})  # from beside the base
    hard = read_scene(written(tmp_path, 'base = "deep/scene.toml"\nname = "y"\nmaterials.coal = "hard_coal"\n'))
    assert hard.materials["coal"].contact_strength_Pa is None
    assert hard.materials["coal"].bond.fracture_energy_J_m2 == 8.133


def test_changes_name_materials_and_shapes_as_a_scene_does(tmp_path):
    begin, said = 'base = "paper.toml"\nname = "x"\n', 'materials.coal = "hard_coal"\nshapes.block = "x.stl"\n'
    said_in_file = read_scene(written(tmp_path, begin + said))
    scene = written(tmp_path, begin)
    assert changed_scene(scene, {"materials.coal": "hard_coal", "shapes.block": "x.stl"}) == said_in_file
    softer = changed_scene(scene, {"materials.coal": "hard_coal", "materials.coal.poisson_ratio": 0.25})
    assert softer.materials["coal"] == said_in_file.materials["coal"].model_copy(update={"poisson_ratio": 0.25})
    with pytest.raises(InputError, match="scene.toml: materials.coal = 'slate': .*/slate.toml: cannot be read"):
        changed_scene(scene, {"materials.coal": "slate"})


@pytest.mark.parametrize("text, said", [
    ('base = "none.toml"\n', "none.toml: cannot be read"),
    ('base = "scene.toml"\n', "must not lead back"),
    ("base = 3\n", "base = 3: must be the name"),
    ('base = "paper.toml"\nwithout = ["plate.sensor"]\n', "without = 'plate.sensor': must name a key"),
    ('without = ["plate"]\n', "must be left out where there is no base"),
    ('base = "paper.toml"\nmaterials.coal = "../x"\n', "materials.coal = '../x'"),
    ('base = "paper.toml"\nmaterials.coal = "slate"\n', "slate.toml: cannot be read"),
])
def test_bad_input_is_refused_in_one_line(tmp_path, text, said):
    with pytest.raises(InputError, match=said) as refused:
        read_scene(written(tmp_path, text))
    assert "\n" not in str(refused.value)
    with pytest.raises(InputError, match="must stand in the file"):
        changed_scene(SCENES / "paper.toml", {"base": "small.toml"})


def test_assumptions_name_keys_of_the_scene():
    """A key that is not given counts, and one of another kind of plate or way of saying what falls."""
    file = SCENES / "paper.toml"
    keys = ["plate.rods", "stones.radius_m", "stones.drawn.size_m", "materials.*.bond", "materials.coal.density_kg_m3"]
    assert changed_scene(file, {"assumptions": keys}).assumptions == tuple(keys)
    rigid = {"assumptions": ["plate.rods"], **{f"plate.{key}": None for key in read_toml(file)["plate"] if key not in
             ("size_m", "density_kg_m3", "youngs_modulus_Pa", "poisson_ratio")}}
    assert changed_scene(file, rigid).assumptions == ("plate.rods",)
    for key in ("plate.thicknes_m", "", "materials.slate", "stones.radius_m.x", "plate.rods: four screws"):
        with pytest.raises(InputError, match="assumptions = .*: must name keys of this scene"):
            changed_scene(file, {"assumptions": [key]})
