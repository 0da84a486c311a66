"""A sweep goes on where it was stopped, and a ratio's directory appears whole or not at all."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest
from scenes_of_tests import SCENES

from common.scene.scene import changed_scene
from dem.__main__ import main
from dem.batch.sweep import is_finished, sweep


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Two small stones on a rigid plate: three ratios of a few seconds."""
    text = (SCENES.parent / "tests" / "single.toml").read_text()
    rigid = (SCENES / "hertz_coal.toml").read_text()
    text = text[:text.index("[plate]")] + rigid[rigid.index("[plate]"):]
    for old, new in [("count = 1\n", "count = 2\n"), ("gangue_order = [1]", "gangue_order = [2, 1]"),
                     ("[0.1, 0.0]", "[0.1, 0.0], [-0.1, 0.0]"),
                     ("subspheres = 500", "subspheres = 200"), ("duration_s = 6e-3", "duration_s = 9e-3")]:
        assert old in text
        text = text.replace(old, new)
    scene = tmp_path_factory.mktemp("sweep") / "small.toml"
    scene.write_text(text)
    return scene


@pytest.mark.slow
def test_a_killed_sweep_goes_on_with_what_is_missing(small):
    out = small.parent / "runs"
    command = [sys.executable, "-m", "dem", "sweep", str(small), "--out", str(out), "--jobs", "1"]
    process = subprocess.Popen(command, cwd=SCENES.parent, start_new_session=True)
    deadline = time.monotonic() + 120
    while not (out / "ratio_000" / "run.json").exists():
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert not (out / "ratio_100").exists()
    before = (out / "ratio_000" / "run.json").stat().st_mtime_ns

    found = sweep(small, out, jobs=2)
    assert found.exit_code == 0 and [run.gangue_ratio for run in found.runs] == [0.0, 0.5, 1.0]
    for name in ("ratio_000", "ratio_050", "ratio_100"):
        assert json.loads((out / name / "run.json").read_text())["status"] == "finished"
    assert not list(out.glob("*.partial"))
    assert (out / "ratio_000" / "run.json").stat().st_mtime_ns == before  # not run again

    half = {"stones.gangue_ratio": 0.5}
    changed = small.with_name("changed.toml")
    changed.write_text(small.read_text().replace("speed_m_s = 3.0", "speed_m_s = 2.0"))
    assert is_finished(out / "ratio_050", changed_scene(small, half))
    assert not is_finished(out / "ratio_050", changed_scene(changed, half))  # which would be run again


@pytest.mark.slow
def test_a_sweep_changes_keys_of_the_scene(tmp_path, capsys):
    """Three spheres of the paper's ten, in the order that its scene gives them; each ratio is the run that `run`
    makes."""
    scene, out = SCENES / "paper.toml", tmp_path / "runs"
    changes = ["stones.count=3", "time.duration_s=3e-4", "time.free_flight_tolerance=0.0",
               "plate.max_frequency_Hz=1500.0", "stones.agglomerate.subspheres=8",
               "stones.agglomerate.contact='sub_spheres'"]
    settings = [word for change in changes for word in ("--set", change)]
    assert main(["sweep", str(scene), "--out", str(out), *settings]) == 0
    assert "4 runs, 4 to run" in capsys.readouterr().out
    assert sorted(p.name for p in out.iterdir() if p.is_dir() and p.name != ".modes") == [
        "ratio_000", "ratio_033", "ratio_067", "ratio_100"]
    found = json.loads((out / "ratio_033" / "run.json").read_text())
    assert found["materials"] == ["coal", "gangue", "coal"] and found["scene"]["stones"]["gangue_order"] == [2, 3, 1]
    assert main(["sweep", str(scene), "--out", str(out), *settings]) == 0
    assert "4 runs, 0 to run" in capsys.readouterr().out
    assert main(["sweep", str(scene), "--out", str(out), "--set", "stones.gangue_ratio=0.5"]) == 2
    assert "every ratio" in capsys.readouterr().err


def test_ratios_that_share_a_name_are_refused(tmp_path, capsys):
    """Of 101 stones 0 and 1 of gangue are 0 and 1 %, but 50 and 51 both are 50 %."""
    words = ["sweep", str(SCENES / "paper.toml"), "--out", str(tmp_path / "runs"), "--set", "stones.count=101"]
    assert main(words) == 2
    assert "stones.count = 101" in capsys.readouterr().err and not (tmp_path / "runs").exists()
