"""A scene that begins from another, and materials by name."""

from pathlib import Path

import pytest

from common.scene import changed_scene, read_scene
from common.tables import InputError
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


def test_a_way_of_saying_what_falls_takes_the_place_of_the_bases(tmp_path):
    each = '[[stones.each]]\nmaterial = "coal"\nradius_m = 0.02\nx_m = 0.0\ny_m = 0.0\nspeed_m_s = 1.0\n'
    scene = read_scene(written(tmp_path, f'base = "paper.toml"\nname = "x"\n{each}'))
    assert scene.stones.count is None and len(stones_of(scene, "x")) == 1
    over = read_scene(written(tmp_path, 'base = "scene.toml"\nname = "y"\n[stones.drawn]\ncount = 2\nsize_m = 0.02\n'
                                        "speed_m_s = 1.0\n[stones]\ngangue_ratio = 0.5\n", "over.toml"))
    assert over.stones.each is None and len(stones_of(over, "y")) == 2


def test_a_material_by_its_name_is_that_of_its_file(tmp_path):
    text = (SCENES / "paper.toml").read_text()
    start, end = text.index("[materials.coal]"), text.index("[materials.gangue]")
    named = text[:start] + text[end:] + '\n[materials]\ncoal = "coal"\n'
    assert read_scene(written(tmp_path, named)).materials["coal"] == read_scene(SCENES / "paper.toml").materials["coal"]
    (tmp_path / "materials").mkdir()
    other = "density_kg_m3 = 1500.0\nyoungs_modulus_Pa = 4e9\npoisson_ratio = 0.25\n"
    written(tmp_path / "materials", other, "coal.toml")
    with pytest.raises(InputError, match="materials.coal.bond"):
        read_scene(tmp_path / "scene.toml")  # the one beside the scene comes first, and has no bonds


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
