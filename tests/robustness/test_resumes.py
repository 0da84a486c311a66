"""Every shipped scene, stopped at each of twenty checkpoints and taken up again, gives the undisturbed result byte for
byte; and engines that start side by side start."""

import json
import os
import signal
import subprocess
import sys
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import pytest

import dem.deck.render
from common.files.cache import user_cache
from common.scene.plate import FlexiblePlate
from common.scene.scene import changed_scene, read_scene
from dem.coupling import launch
from dem.coupling.launch import engine_running
from dem.run.prepare import prepare
from dem.run.run import Stopped, run_prepared
from tests.robustness.small import ROOT, SCENES, below, wait_until
from tests.robustness.test_kills import check_same

STARTS = int(os.environ.get("STARTS", "2000"))
STOPS = 20
SAMPLES = 2 * (STOPS + 1)  # of a run, a checkpoint at every other one
NAMES = sorted(file.stem for file in SCENES.glob("*.toml") if "stones" in tomllib.loads(file.read_text()))
WALLS = {"plate.wall_height_m": {"y_plus": 0.3, "y_minus": 0.3}}


def made_short(scene):
    """Changes by key: few sub-spheres and modes, and a time in which something happens."""
    stones, changes = scene.stones, {}
    duration_s = min(0.008, scene.time.duration_s)
    if stones.agglomerate and scene.name != "small":
        changes["stones.agglomerate.subspheres"] = 200 if stones.agglomerate.contact == "smooth" else 100
    if stones.each:
        duration_s = 0.023  # the last stone of sizes.toml arrives at 0.02 s
    if stones.is_stream:
        rate = "rate_1_s" if stones.drawn.rate_1_s else "rate_kg_s"
        changes |= {f"stones.drawn.{rate}": 100.0, "stones.drawn.arrival_s": [0.0, 0.05]}
        duration_s = 0.06
    if isinstance(scene.plate, FlexiblePlate):
        changes["plate.max_frequency_Hz"] = 1000.0
    return changes | {"time.duration_s": duration_s, "time.sample_interval_s": duration_s / SAMPLES}


def cases():
    """Scene, ratio, with pictures or without, with walls or without."""
    for name in NAMES:
        scene = read_scene(SCENES / f"{name}.toml")
        walls = (False, True) if scene.stones.is_stream else (False,)
        for ratio in (0.0, 0.5, 1.0) if scene.stones.shares_gangue else (None,):
            if ratio == 0.5 and scene.stones.count == 1:
                continue
            for pictures in (True, False):
                yield from ((name, ratio, pictures, wall) for wall in walls)


def files_of(out):
    """What each file of a result holds, but for times, and so for the hashes of what holds them."""
    found = {str(file.relative_to(out)): file.read_bytes() for file in out.rglob("*") if file.is_file()}
    summary, contents = json.loads(found.pop("run.json")), json.loads(found["contents.json"])
    contents["files"] |= dict.fromkeys(("run.json", "started.json"))
    found["contents.json"] = contents
    return found, {key: value for key, value in summary.items() if key not in ("wall_time_s", "resumed_at_s")}


@pytest.mark.validate
@pytest.mark.parametrize(("name", "ratio", "pictures", "walls"), list(cases()))
def test_stopped_at_twenty_checkpoints(tmp_path, monkeypatch, name, ratio, pictures, walls):
    monkeypatch.setattr(dem.deck.render, "CHECKPOINT_SAMPLES", 2)
    file = SCENES / f"{name}.toml"
    changes = made_short(read_scene(file)) | (WALLS if walls else {})
    changes["time.view_interval_s"] = changes["time.duration_s"] / 7 if pictures else None
    if ratio is not None:
        changes["stones.gangue_ratio"] = ratio
    prepared = prepare(changed_scene(file, changes), str(file), user_cache())
    run_prepared(prepared, tmp_path / "whole")
    stops = 0
    while not (tmp_path / "parts").exists():
        try:
            run_prepared(prepared, tmp_path / "parts", stop_at=0.0)
        except Stopped:
            stops += 1
    assert stops == STOPS
    parts, whole = files_of(tmp_path / "parts"), files_of(tmp_path / "whole")
    assert parts[0].keys() == whole[0].keys() and parts[1] == whole[1]
    assert [file for file in whole[0] if parts[0][file] != whole[0][file]] == []


@pytest.mark.slow
def test_two_ranks_stop_at_a_checkpoint_and_go_on(tmp_path):
    """Asked before they listen."""
    scene = changed_scene(ROOT / "tests" / "single.toml", {
        "ranks": 2, "plate.max_frequency_Hz": 500.0, "time.view_interval_s": None,
        "stones.agglomerate": {"subspheres": 60, "contact": "sub_spheres"},
        "time.duration_s": 6e-4, "time.sample_interval_s": 3e-5})
    prepared = prepare(scene, "scene", user_cache())
    run_prepared(prepared, tmp_path / "whole")
    for _ in range(3):
        with pytest.raises(Stopped, match="at the checkpoint"):
            run_prepared(prepared, tmp_path / "parts", stop_at=0.0)
    run_prepared(prepared, tmp_path / "parts")
    check_same(tmp_path / "parts", tmp_path / "whole", 2)


def starts(directory, ranks):
    """Exit code of an engine that has nothing to do."""
    directory.mkdir()
    (directory / "deck.liggghts").write_text("units si\n")
    with engine_running(directory, ranks) as engine:
        return engine.wait(timeout=300), (directory / "engine.out").read_text(errors="replace")


@pytest.mark.validate
def test_engines_that_start_side_by_side_start(tmp_path):
    """Four at a time; every twentieth has two ranks."""
    with ThreadPoolExecutor(4) as pool:
        ended = list(pool.map(lambda k: starts(tmp_path / str(k), 2 if k % 20 == 0 else 1), range(STARTS)))
    assert [said for code, said in ended if code != 0] == []


@pytest.mark.parametrize("ranks", [1, 2])
def test_an_engine_needs_no_directory_that_others_share(tmp_path, monkeypatch, ranks):
    """The system's directory for temporary files is none here; nothing is left in the other one either."""
    (tmp_path / "no directory").touch()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "no directory"))
    monkeypatch.setattr(launch, "SHARED_MEMORY", tmp_path)
    assert starts(tmp_path / "deck", ranks) == (0, (tmp_path / "deck" / "engine.out").read_text(errors="replace"))
    assert {file.name for file in tmp_path.iterdir()} == {"deck", "no directory"}


TWO_RANKS = """
import sys
from pathlib import Path
from dem.coupling.launch import engine_running
with engine_running(Path(sys.argv[1]), 2) as engine:
    engine.wait()
"""


def test_what_killed_ranks_left_is_removed_by_the_next_ones(tmp_path):
    deck = tmp_path / "endless"
    deck.mkdir()
    (deck / "deck.liggghts").write_text("shell echo\nshell sleep 600\n")
    process = subprocess.Popen([sys.executable, "-c", TWO_RANKS, str(deck)], cwd=ROOT, stdin=subprocess.DEVNULL,
                               stderr=subprocess.PIPE, text=True)

    def place():
        return list(launch.SHARED_MEMORY.glob(f"{launch.PREFIX}{process.pid}-*"))

    wait_until(lambda: place() and list(place()[0].glob("vader_segment.*")), process, "segments of two ranks")
    everybody = [process.pid, *(pid for pid, _ in below(process.pid))]
    for pid in everybody:
        with suppress(ProcessLookupError):  # a child of one that was killed may be gone
            os.kill(pid, signal.SIGKILL)
    process.communicate()
    assert place()
    deadline = time.monotonic() + 60
    while place():  # until the last of them is gone
        assert time.monotonic() < deadline
        assert starts(tmp_path / str(time.monotonic()), 2)[0] == 0
