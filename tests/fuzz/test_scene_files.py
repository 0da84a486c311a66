"""Whatever a scene file says: a run that is whole, or one line and exit code 2 with nothing written."""

import json
import shutil
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from common.scene.scene import read_scene
from common.tables import InputError, check as checked, read_toml
from dem.__main__ import main
from dem.calibration.calibrate import TargetTable
from dem.calibration.lab_sheet import TARGETS, find_sheet
from tests.fuzz.mutations import HOSTILE, as_toml, fuzz, many, mutated, outcome
from tests.fuzz.scenes import ALL, CUBE, SCENES, SMOOTH, VOLLEYS, small_scene

MOST_STEPS = 200_000  # that a fuzzed scene is run for; beyond, its deck is written only


def check(scene):
    """Run the scene, or render its deck where that is long."""
    here = Path(tempfile.mkdtemp())
    try:
        (here / "cube.stl").write_text(CUBE)
        file = here / "scene.toml"
        file.write_text(as_toml(scene), encoding="utf-8")
        out = here / "out"
        code, errors = outcome(main, ["deck", str(file), "--out", str(out)])
        if code == 0:
            deck = (out / "deck" / "deck.liggghts").read_text()
            steps = int(deck.rsplit("run ", 1)[1].split()[0])
            shutil.rmtree(out)
            if steps > MOST_STEPS:
                return
            code, errors = outcome(main, ["run", str(file), "--out", str(out)])
        if code == 0:
            info = json.loads((out / "run.json").read_text())
            assert info["status"] == "finished" and info["scene"]["name"] == read_scene(file).name
            assert np.isfinite(pd.read_parquet(out / "signals.parquet").to_numpy()).all()
        else:
            said = errors.splitlines()[-1:]  # after what a terminal shows of a run's progress
            assert code == 2 and len(said) == 1 and names_its_file(said[0], here, scene), (code, errors)
            assert not out.exists()
            assert {p.name for p in here.iterdir()} <= {"scene.toml", "cube.stl"}
    finally:
        shutil.rmtree(here)


def check_deck(scene):
    """Render the scene's deck, or be refused; nothing is run. Returns whether there is a deck."""
    here = Path(tempfile.mkdtemp())
    try:
        (here / "cube.stl").write_text(CUBE)
        (here / "scene.toml").write_text(as_toml(scene), encoding="utf-8")
        code, errors = outcome(main, ["deck", str(here / "scene.toml"), "--out", str(here / "out")])
        # A stage that lasts is named, "single: modes ...".
        said = [line for line in errors.splitlines() if not line.startswith("warning: ") and not line.endswith(" ...")]
        assert code == 0 and not said or code == 2 and len(said) == 1 and names_its_file(said[0], here, scene), (code, errors)
        assert {p.name for p in here.iterdir()} == {"scene.toml", "cube.stl", *(["out"] if code == 0 else [])}
        return code == 0
    finally:
        shutil.rmtree(here)


def names_its_file(line, here, scene):
    """The scene, or one that it takes something from: beside it, shipped, or where its base says."""
    base = scene["base"] if str(scene.get("base")).startswith("/") else str(here)
    return any(place in line for place in (str(here), base, "hertz_coal.toml", "materials/"))


each_volley = pytest.mark.parametrize("valid", VOLLEYS.values(), ids=VOLLEYS)
each_kind = pytest.mark.parametrize("valid", ALL.values(), ids=ALL)


@each_volley
def test_the_valid_scenes_run(valid):
    check(valid)


@each_volley
def test_some_changed_scenes(valid):
    fuzz(check, mutated(valid), 6)


@each_kind
def test_some_decks(valid):
    assert check_deck(valid)
    fuzz(check_deck, mutated(valid), 10)


@pytest.mark.validate
@each_kind
def test_many_changed_scenes(valid):
    fuzz(check, mutated(valid), many("RUNS", 100))


@pytest.mark.validate
@each_kind
def test_ten_thousand_decks(valid):
    fuzz(check_deck, mutated(valid), many("DECKS", 910))


@pytest.mark.validate
def test_decks_of_smooth_stones():
    assert check_deck(SMOOTH)
    fuzz(check_deck, mutated(SMOOTH), many("DECKS", 910) // 10)


@pytest.mark.parametrize("name", [name for name in HOSTILE if not name.isalnum() or not name.isascii() or len(name) > 100])
@pytest.mark.parametrize("path", ["name", "plate.sensors.0.name", "new material", "contacts key"])
def test_no_name_gets_into_a_deck(tmp_path, name, path):
    """Nothing that a shell, LIGGGHTS or a path could take for more than a name is taken for one."""
    scene = small_scene("sphere", "flexible")
    if path == "name":
        scene["name"] = name
    elif path == "plate.sensors.0.name":
        scene["plate"]["sensors"] = [{"name": name, "place_m": [0.0, 0.0]}]
    elif path == "new material":
        scene["materials"][name] = scene["materials"]["coal"]
    else:
        scene["contacts"][name] = scene["contacts"]["coal_coal"]
    (tmp_path / "scene.toml").write_text(as_toml(scene), encoding="utf-8")
    code, errors = outcome(main, ["deck", str(tmp_path / "scene.toml"), "--out", str(tmp_path / "out")])
    assert code == 2 and errors.count("\n") == 1
    assert [p.name for p in tmp_path.iterdir()] == ["scene.toml"]


@pytest.mark.parametrize("name", HOSTILE)
def test_free_text_among_the_assumptions_is_refused(tmp_path, name):
    scene = small_scene("bonded", "rigid") | {"assumptions": [name]}
    (tmp_path / "scene.toml").write_text(as_toml(scene), encoding="utf-8")
    code, errors = outcome(main, ["deck", str(tmp_path / "scene.toml"), "--out", str(tmp_path / "out")])
    assert code == 2 and errors.count("\n") == 1 and "assumptions" in errors
    assert [p.name for p in tmp_path.iterdir()] == ["scene.toml"]


def check_targets(tables):
    """Strengths of rocks for the calibration: a table, or one line."""
    here = Path(tempfile.mkdtemp())
    try:
        file = here / "targets.toml"
        file.write_text(as_toml(tables), encoding="utf-8")
        try:
            sheet = find_sheet("coal", SCENES / "paper.toml", targets=file)
            target = checked(TargetTable, sheet.table, sheet.file, where=sheet.where)
        except InputError as error:
            assert "\n" not in str(error) and str(file) in str(error)
        else:
            assert 0 < target.tensile_strength_Pa < np.inf and '"' not in target.strength_source
    finally:
        shutil.rmtree(here)


def test_some_targets_of_calibration():
    fuzz(check_targets, mutated(read_toml(TARGETS)), 30)


@pytest.mark.validate
def test_many_targets_of_calibration():
    fuzz(check_targets, mutated(read_toml(TARGETS)), 500)
