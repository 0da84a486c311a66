"""Every scene that is shipped sweeps to a report."""

import json
import shutil

import pytest

from common.scene import read_scene
from tests.robustness.small import SCENES, run

# Those of stones that are drawn or given one by one are run in tests/dem/test_falling_scenes.py.
SCENE_FILES = {file.stem: file for file in sorted(SCENES.glob("*.toml"))
               if "stones" in file.read_text() and file.stem not in ("campaign", "dataset", "streams")
               and read_scene(file).stones.count is not None}
FAST = ("elastic_plate", "hertz_coal", "hertz_gangue")
LIGHTER = {"paper": [("duration_s = 0.6 ", "duration_s = 0.01 "), ("subspheres = 500", "subspheres = 200")],
           "single": [("gangue_ratio = 0.0 }", "gangue_ratio = 0.0, agglomerate.subspheres = 200 }")]}


def sweeps_to_a_report(name, tmp_path):
    scene, out = tmp_path / f"{name}.toml", tmp_path / "runs of this scene"
    shutil.copy(SCENE_FILES[name], scene)
    for old, new in LIGHTER.get(name, []):
        text = scene.read_text()
        assert old in text
        scene.write_text(text.replace(old, new))
    code, _, errors = run("dem", "sweep", scene, "--out", out, "--jobs", "2")
    assert code == 0, errors
    code, _, errors = run("report", out)
    assert code == 0 and "Traceback" not in errors, errors
    assert (out / "report.html").stat().st_size > 10_000
    runs = [json.loads(file.read_text()) for file in sorted(out.glob("ratio_*/run.json"))]
    count = read_scene(scene).stones.count
    assert [run["gangue_ratio"] for run in runs] == [k / count for k in range(count + 1)]
    assert all(run["status"] == "finished" and abs(run["energy"]["closure"]) < 0.01 for run in runs)


@pytest.mark.parametrize("name", FAST)
def test_a_shipped_scene_sweeps_to_a_report(tmp_path, name):
    sweeps_to_a_report(name, tmp_path)


@pytest.mark.validate
@pytest.mark.parametrize("name", sorted(set(SCENE_FILES) - set(FAST)))
def test_a_larger_shipped_scene_sweeps_to_a_report(tmp_path, name):
    sweeps_to_a_report(name, tmp_path)
