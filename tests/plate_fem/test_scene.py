"""The plate's table: every mistake is one line that names file, key, value and what is allowed."""

import math
import tomllib

import pytest
from plates import TABLE, plate, rod
from pydantic import Field

from common.resources import resource
from common.scene.plate import PlateTable, RigidPlate, read_plate
from common.scene.scene import read_scene
from common.tables import InputError, Refused, Table, check, read_toml
from plate_fem.__main__ import main

GOOD_ROD = rod(0.1, 0.1)


def message(changes, drop=()):
    table = {k: v for k, v in {**TABLE, **changes}.items() if k not in drop}
    with pytest.raises(InputError) as caught:
        check(PlateTable, table, "scenes/x.toml", "plate")
    text = str(caught.value)
    assert "\n" not in text
    return text


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"thickness_m": -0.02}, "scenes/x.toml: plate.thickness_m = -0.02: must be greater than 0"),
        ({"thickness_m": 0}, "scenes/x.toml: plate.thickness_m = 0: must be greater than 0"),
        ({"thickness_m": "0.02"}, "scenes/x.toml: plate.thickness_m = '0.02': must be a valid number"),
        ({"thickness_m": True}, "scenes/x.toml: plate.thickness_m = True: must be a valid number"),
        ({"size_m": [math.nan, 0.5]}, "scenes/x.toml: plate.size_m.0 = nan: must be a finite number"),
        ({"size_m": [0.5, math.inf]}, "scenes/x.toml: plate.size_m.1 = inf: must be a finite number"),
        ({"poisson_ratio": 0.5}, "scenes/x.toml: plate.poisson_ratio = 0.5: must be less than 0.5"),
        ({"damping_ratio": 1.0}, "scenes/x.toml: plate.damping_ratio = 1.0: must be less than 1"),
        ({"theory": "reissner"}, "plate.theory = 'reissner': must be 'auto', 'kirchhoff' or 'mindlin'"),
        ({"model": "rigid"}, "plate.model = 'rigid': unknown key; use thickness_m and damping_ratio of a plate"),
        ({"thickness_m": 0.2}, "plate.thickness_m = 0.2: must be at most a fifth of the side, 0.1"),
        ({"rods": [GOOD_ROD, GOOD_ROD]}, "plate.rods.1.place_m = (0.1, 0.1): must not overlap another rod"),
        ({"rods": [{**GOOD_ROD, "place_m": [0.1, 0.245]}]}, "plate.rods.0.place_m = (0.1, 0.245): must lie on"),
        ({"rods": [{**GOOD_ROD, "length": 1}]},
         "plate.rods.0.length = 1: unknown key; allowed here: density_kg_m3, dia"),
        ({"rods": [{"length_m": 0.1}]}, "plate.rods.0.place_m is missing: a value must be given"),
        ({"rods": [{**GOOD_ROD, "x_m": 0.1}]}, "plate.rods.0.x_m = 0.1: unknown key; use place_m = [x, y]"),
        ({"rods": 4}, "plate.rods = 4: must be a valid list"),
        ({"point_supports": []}, "plate.point_supports = []: unknown key; use edges, or short rods; allowed here"),
        ({"sensors": [{"name": "a b", "place_m": [0.0, 0.0]}]}, "plate.sensors.0.name = 'a b': string must match"),
        ({"sensors": [{"name": "a", "place_m": [0.0, 0.0]}] * 2}, "plate.sensors.1.name = 'a': must differ"),
        ({"thicknes_m": 1}, "plate.thicknes_m = 1: unknown key; allowed here: damping_ratio, density_kg_m3"),
    ],
)
def test_mistake(changes, expected):
    assert expected in message(changes)


def test_missing_keys():
    assert message({}, drop=["size_m"]) == "scenes/x.toml: plate.size_m is missing: a value must be given"
    assert message({}, drop=["thickness_m"]) == "scenes/x.toml: plate.thickness_m is missing: a value must be given"


def test_an_unknown_key_is_named_before_the_one_it_was_meant_for():
    assert "plate.width = 0.5: unknown key" in message({"width": 0.5}, drop=["size_m"])


def test_tables_inside_tables_and_maps():
    class Stone(Table):
        radius_m: float

    class Scene(Table):
        plate: PlateTable
        materials: dict[str, Stone] = Field(default_factory=dict)

    for materials, expected in (
        ({"coal": {"radius_m": math.nan}}, "f: materials.coal.radius_m = nan: must be a finite number"),
        ({"coal": {"radius_m": 1.0, "rho": 2}}, "f: materials.coal.rho = 2: unknown key; allowed here: radius_m"),
    ):
        with pytest.raises(InputError) as caught:
            check(Scene, {"plate": TABLE, "materials": materials}, "f")
        assert str(caught.value) == expected
    with pytest.raises(InputError, match="f: plate.rods.0.place_m = .9.0, 0.0.: must lie"):
        check(Scene, {"plate": {**TABLE, "rods": [{**GOOD_ROD, "place_m": [9.0, 0.0]}]}}, "f")


def test_a_validator_may_refuse_a_key_deep_inside():
    class Picky(Table):
        size_m: float

        def model_post_init(self, _):
            raise Refused("size_m", self.size_m, "must please")

    with pytest.raises(InputError, match="f: a.size_m = 1.0: must please"):
        check(Picky, {"size_m": 1.0}, "f", "a")


def test_files(tmp_path):
    missing = tmp_path / "none.toml"
    with pytest.raises(InputError, match="none.toml: cannot be read: No such file"):
        read_toml(missing)
    broken = tmp_path / "broken.toml"
    broken.write_text("[plate\n")
    with pytest.raises(InputError, match="broken.toml: not a TOML file"):
        read_toml(broken)
    broken.write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match="not a TOML file"):
        read_toml(broken)
    broken.write_text("plate = 3\n")
    with pytest.raises(InputError, match="plate is missing"):
        read_plate(broken)


def scene_file(tmp_path, **changes):
    lines = ["[plate]"]
    for key, value in {**TABLE, "max_frequency_Hz": 1500.0, "thickness_m": 0.01, **changes}.items():
        lines.append(f"{key} = {value!r}".replace("'", '"'))
    file = tmp_path / "scene.toml"
    file.write_text("\n".join(lines) + "\n")
    assert tomllib.loads(file.read_text())["plate"]["thickness_m"]
    return file


def test_command_prints_frequencies_and_writes_shapes(tmp_path, capsys):
    import meshio

    file, out = scene_file(tmp_path), tmp_path / "modes.vtu"
    assert main(["modes", str(file), "--out", str(out)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "plate" in lines[0]
    first = [float(v) for v in lines[2].split()]
    assert first == [1, 0.0, 0.01]
    mesh = meshio.read(out)
    assert len(mesh.point_data) == len(lines) - 2
    assert all(abs(abs(v).max() - 1) < 1e-12 for v in mesh.point_data.values())


@pytest.mark.parametrize(
    ("changes", "arguments", "expected"),
    [
        ({"size_m": [-1.0, 0.5]}, [], "plate.size_m.0 = -1.0: must be greater than 0"),
        ({}, ["--out", "x.png"], "must end in .vtu"),
        ({"colour": 1}, [], "plate.colour = 1: unknown key"),
    ],
)
def test_command_ends_with_2_and_one_line(tmp_path, capsys, changes, arguments, expected):
    assert main(["modes", str(scene_file(tmp_path, **changes)), *arguments]) == 2
    captured = capsys.readouterr()
    assert expected in captured.err
    assert len(captured.err.splitlines()) == 1
    assert captured.out == ""


@pytest.mark.slow
def test_where_rods_twist_below_a_plate_at_rest_its_shape_is_zero(tmp_path):
    """Four equal rods have three such modes, at the frequency of a shaft held at both ends; nothing is divided by."""
    import meshio

    text = (resource("scenes") / "small.toml").read_text()
    (tmp_path / "small.toml").write_text(text.replace("0.02, length_m = 0.1", "0.02, length_m = 0.4"))
    assert main(["modes", str(tmp_path / "small.toml"), "--out", str(tmp_path / "modes.vtu")]) == 0
    fields = meshio.read(tmp_path / "modes.vtu").point_data
    largest = {name: abs(field).max() for name, field in fields.items()}
    at_rest = [float(name.split("_")[2]) for name, value in largest.items() if value == 0]
    shaft_Hz = math.sqrt(2.07e11 / 2 / 1.3 / 7830) / 2 / 0.4
    assert at_rest == pytest.approx(3 * [shaft_Hz], rel=1e-3)
    assert all(abs(value - 1) < 1e-12 for value in largest.values() if value != 0)


def test_a_rigid_plate_has_no_modes(tmp_path, capsys):
    file = tmp_path / "rigid.toml"
    keys = ("size_m", "density_kg_m3", "youngs_modulus_Pa", "poisson_ratio")
    file.write_text('[plate]\n' + "".join(f"{k} = {TABLE[k]}\n" for k in keys))
    assert isinstance(read_plate(file), RigidPlate)
    assert main(["modes", str(file)]) == 2
    assert "plate.thickness_m is missing" in capsys.readouterr().err


def test_table_cannot_be_changed():
    table = plate()
    with pytest.raises(ValueError, match="frozen"):
        table.size_m = (1.0, 1.0)
    assert hash(table.rods) == hash(plate().rods)  # by which matrices are kept


def test_modes_are_of_a_plate_that_bends():
    from plate_fem import plate_modes

    for wrong in (read_scene(resource("scenes") / "hertz_coal.toml"), "scenes/paper.toml"):
        with pytest.raises(InputError, match="must be a FlexiblePlate"):
            plate_modes(wrong)
