"""Bad input ends with exit code 2 and one line that names file, key, value and what is allowed; nothing is written."""

import subprocess
import sys

import pytest
from scenes_of_tests import SCENES

BEFORE, _, AFTER = (SCENES / "paper.toml").read_text().partition("[stones.agglomerate]")
PAPER = BEFORE + AFTER[AFTER.index("\n\n"):]  # of spheres, which need no packing

CASES = [
    ("unknown key", "count = 10 ", "cuont = 10 ", ["stones.cuont", "unknown key"]),
    ("negative size", "radius_m = 0.025", "radius_m = -0.025", ["stones.radius_m", "-0.025", "greater than 0"]),
    ("zero size", "radius_m = 0.025", "radius_m = 0.0", ["stones.radius_m", "0.0", "greater than 0"]),
    ("not a number", "radius_m = 0.025", "radius_m = nan", ["stones.radius_m", "nan"]),
    ("negative thickness", "thickness_m = 0.02 ", "thickness_m = -0.02 ", ["plate.thickness_m", "-0.02"]),
    ("stones overlap", "positions_m = 0.1 ", "positions_m = 0.05 ", ["stones.positions_m.1", "(0.0404508, 0.0293893)", "overlap"]),
    ("stones miss", "positions_m = 0.1 ", "positions_m = 0.3 ", ["stones.positions_m.0", "0.3", "misses"]),
    ("no circle", "positions_m = 0.1 ", "positions_m = -0.1 ", ["stones.positions_m = -0.1", "above 0, the radius"]),
    ("unknown material", 'gangue = "gangue"', 'shale = "gangue"', ["materials.gangue", "unknown", "shale"]),
    ("unknown pair", "coal_coal =", "coal_slate =", ["contacts.coal_slate", "coal_gangue"]),
    ("missing contact", "coal_coal = { restitution = 0.5, friction = 0.6 }", "", ["contacts.coal_coal", "must be given"]),
    ("time step", "duration_s = 0.6 ", "time_step_s = 1e-4\nduration_s = 0.6 ",
     ["time.time_step_s", "0.0001", "must not be above"]),
    ("co-step", "duration_s = 0.6 ", "co_step = 1000\nduration_s = 0.6 ", ["time.co_step", "1000", "at most"]),
    ("pictures between rows", "view_interval_s = 6e-3", "view_interval_s = 1e-4",
     ["time.view_interval_s", "0.0001", "at least sample_interval_s = 0.00015"]),
    ("restitution", "restitution = 0.9, friction = 0.4", "restitution = 1.5, friction = 0.4",
     ["contacts.coal_plate.restitution", "1.5", "less than or equal to 1"]),
    ("order", "gangue_order = [2, 10,", "gangue_order = [2, 2,", ["stones.gangue_order", "once"]),
    ("name leads outside", 'name = "paper"', 'name = "../paper"', ["name", "../paper"]),
]


@pytest.mark.parametrize("old, new, words", [c[1:] for c in CASES], ids=[c[0] for c in CASES])
def test_a_wrong_scene_is_refused_in_one_line(tmp_path, runs, capsys, old, new, words):
    from dem.__main__ import main

    assert PAPER.count(old) >= 1
    scene = tmp_path / "scene.toml"
    scene.write_text(PAPER.replace(old, new, 1))
    before = set(runs.iterdir())
    code = main(["run", str(scene), "--out", str(runs / "refused")])
    error = capsys.readouterr().err
    assert code == 2
    assert error.count("\n") == 1
    for word in [str(scene), *words]:
        assert word in error
    assert set(runs.iterdir()) <= before


@pytest.mark.parametrize("ratio, words", [("0.25", ["stones.gangue_ratio", "0.25", "1/10"]),
                                          ("1.2", ["stones.gangue_ratio", "1.2"])])
def test_a_ratio_that_the_stones_cannot_give_is_refused(tmp_path, capsys, ratio, words):
    from dem.__main__ import main

    code = main(["run", str(SCENES / "paper.toml"), "--gangue", ratio, "--out", str(tmp_path / "run")])
    error = capsys.readouterr().err
    assert code == 2 and error.count("\n") == 1
    assert all(word in error for word in words)
    assert not list(tmp_path.iterdir())


def test_a_missing_scene_and_no_toml_are_refused(tmp_path, capsys):
    from dem.__main__ import main

    (tmp_path / "bad.toml").write_text("[time\n")
    for name in ("none.toml", "bad.toml"):
        assert main(["run", str(tmp_path / name), "--out", str(tmp_path / "run")]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and name in error


def test_another_liggghts_is_told_and_none_is_refused(tmp_path, capsys, monkeypatch):
    import dem.coupling.launch
    from dem.__main__ import main

    scene = str(SCENES / "hertz_coal.toml")
    arguments = ["run", scene, "--out", str(tmp_path / "run")]
    dem.coupling.launch.library_version.cache_clear()
    with monkeypatch.context() as patch:
        patch.setattr(dem.coupling.launch, "LIGGGHTS_VERSION", "3.7.0")
        patch.setattr(dem.coupling.launch, "ENGINE", tmp_path / "nothing")
        assert main(arguments) == 2
        told, refused = capsys.readouterr().err.splitlines()
        assert "3.7.0" in told and told.startswith("note: LIGGGHTS") and "engine" in refused
    with monkeypatch.context() as patch:
        patch.setattr(dem.coupling.launch, "ENGINE", tmp_path / "nothing")
        assert main(arguments) == 2
        assert "engine" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_command_itself_gives_exit_code_2(tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(PAPER.replace("radius_m = 0.025", "radius_m = -1.0"))
    done = subprocess.run([sys.executable, "-m", "dem", "run", str(scene), "--out", str(tmp_path / "run")],
                          capture_output=True, text=True, cwd=SCENES.parent, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1 and "Traceback" not in done.stderr
