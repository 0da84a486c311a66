"""A run that is killed or stopped goes on from its last checkpoint and gives what the undisturbed one gives."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from itertools import count
from pathlib import Path

import pandas as pd
import pytest
from scenes_of_tests import SCENES, changed
from test_stream import scene_of

import dem.coupling.pipes
import dem.deck.render
import dem.run.directory
from common.files.output_directory import Busy
from common.tables import InputError
from dem.__main__ import main
from dem.run.directory import RunDirectory, latest
from dem.run.run import Stopped, resume, run_scene

DEM = [sys.executable, "-m", "dem"]
SIGNALS = ("signals", "fast", "breakage", "energy", "contacts")


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """One breaking stone on the flexible plate, friction and dampers on, never out of the force loops: a few seconds of
    the engine, so that it takes checkpoints on a fast machine too."""
    text = (SCENES.parent / "tests" / "single.toml").read_text()
    for old, new in [("max_frequency_Hz = 20000.0", "max_frequency_Hz = 1000.0"), ("subspheres = 500", "subspheres = 300"),
                     ("view_interval_s = 1.5e-4", "view_interval_s = 1.5e-3"),
                     ("duration_s = 6e-3", "duration_s = 30e-3\nfree_flight_tolerance = 0.0")]:
        assert old in text
        text = text.replace(old, new)
    file = tmp_path_factory.mktemp("survive") / "stone.toml"
    file.write_text(text)
    return file


@pytest.fixture(scope="module")
def undisturbed(scene):
    out = scene.parent / "undisturbed"
    assert main(["--quiet", "run", str(scene), "--out", str(out)]) == 0
    return out


def start(*arguments, **options):
    return subprocess.Popen([*DEM, *map(str, arguments)], cwd=SCENES.parent, stdin=subprocess.DEVNULL,
                            stdout=subprocess.DEVNULL, **options)


def children(pid):
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def engine_of(process):
    """The engine's pid as soon as there is one, None if the run ends first."""
    while process.poll() is None:
        for child in children(process.pid):
            try:
                if "liggghts" in os.readlink(f"/proc/{child}/exe"):
                    return child
            except OSError:
                pass  # gone meanwhile
        time.sleep(0.01)
    return None


def gone(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except OSError:
        return True


def check_same(out, undisturbed):
    """Every number of every signal, and every picture, bit by bit."""
    for name in SIGNALS:
        pd.testing.assert_frame_equal(pd.read_parquet(out / f"{name}.parquet"),
                                      pd.read_parquet(undisturbed / f"{name}.parquet"), check_exact=True)
    for file in undisturbed.glob("view/*"):
        assert (out / "view" / file.name).read_bytes() == file.read_bytes(), file.name
    summary, expected = (json.loads((d / "run.json").read_text()) for d in (out, undisturbed))
    for key in ("wall_time_s", "resumed_at_s"):
        summary.pop(key), expected.pop(key)
    assert summary == expected


def kill_and_go_on(scene, undisturbed, kills, rng, not_before_checkpoint):
    """Kill the run, the engine, or both, by turns, at random moments of the time that the engine takes, counted from its
    start or from when there is a checkpoint; go on each time, and begin again when it is finished. Returns at how many
    checkpoints a run was taken up."""
    length_s = json.loads((undisturbed / "run.json").read_text())["wall_time_s"]["engine and plate"]
    out = undisturbed.with_name("killed")
    done = resumed = 0
    while done < kills:
        shutil.rmtree(out, ignore_errors=True)
        while not out.exists():
            process = start("run", scene, "--out", out, stderr=subprocess.PIPE, text=True)
            engine = engine_of(process)
            moment = rng.uniform(0, length_s)
            while not_before_checkpoint and process.poll() is None and not latest(
                    RunDirectory(out).path / "deck" / "checkpoint", flexible=True):
                time.sleep(0.01)
            if engine and done < kills:
                try:
                    process.wait(timeout=moment)
                except subprocess.TimeoutExpired:
                    victims = [[process.pid], [engine], [process.pid, engine]][done % 3]
                    living = [pid for pid in victims if not gone(pid)]  # the engine ends before the run does
                    for pid in living:
                        with suppress(ProcessLookupError):
                            os.kill(pid, signal.SIGKILL)
                    done += bool(living)
            error = process.communicate(timeout=600)[1]
            if process.returncode == 1:
                assert error.splitlines()[-1].startswith(str(scene)) and "LIGGGHTS stopped" in error, error
            assert process.returncode in (0, 1, -signal.SIGKILL), error
            deadline = time.monotonic() + 60  # of a busy machine
            while engine and not gone(engine):
                assert time.monotonic() < deadline, "the engine outlived the run"
                time.sleep(0.01)
            assert not out.exists() or (out / "run.json").exists()  # whole or absent
        check_same(out, undisturbed)
        resumed += len(json.loads((out / "run.json").read_text())["resumed_at_s"])
    return resumed


@pytest.mark.slow
def test_a_run_killed_at_three_moments_gives_the_undisturbed_result(scene, undisturbed):
    assert kill_and_go_on(scene, undisturbed, 3, random.Random(3), not_before_checkpoint=True) > 0


@pytest.mark.validate
def test_a_run_killed_at_twenty_moments_gives_the_undisturbed_result(scene, undisturbed):
    assert kill_and_go_on(scene, undisturbed, 20, random.Random(20), not_before_checkpoint=False) > 0


@pytest.mark.slow
def test_walltime_stops_at_a_checkpoint_and_resume_goes_on(scene, undisturbed):
    out = undisturbed.with_name("stopped")
    process = start("run", scene, "--out", out, "--walltime", 0, stderr=subprocess.PIPE, text=True)
    error = process.communicate(timeout=600)[1]
    assert process.returncode == 75
    assert "stopped at the checkpoint" in error and "gangue resume" in error and not out.exists()
    assert start("resume", out.with_name("stopped.partial")).wait(timeout=600) == 0
    check_same(out, undisturbed)
    assert not list(out.glob("deck/checkpoint*")) and not (out / "started.json").exists()
    assert main(["--quiet", "resume", str(out)]) == 0  # nothing left to do


def stopped_again_and_again(scene, out):
    """Run a scene, stopped at each checkpoint that it may take; returns how many these are."""
    for stops in count():
        try:
            run_scene(scene, "scene", out, walltime_s=0.0)
        except Stopped as stopped:
            assert "at the checkpoint" in str(stopped)
        else:
            return stops


@pytest.mark.slow
def test_a_run_in_which_all_flies_is_taken_up(tmp_path, monkeypatch):
    """Two bodies of different rock have left the plate, and meet in the air later: without them nothing in memory tells
    that there are such spheres, and how near they may come."""
    monkeypatch.setattr(dem.deck.render, "CHECKPOINT_SAMPLES", 24)
    one = {"place_m": [0.0, 0.0], "velocity_m_s": 0.5}
    scene = scene_of([one, {"material": "gangue", "place_m": [0.05, 0.0], "velocity_m_s": (-3.0, 0.0, -0.5)}], 0.018)
    run_scene(scene, "scene", tmp_path / "whole")
    assert stopped_again_and_again(scene, tmp_path / "parts") == 4
    energy = pd.read_parquet(tmp_path / "whole" / "energy.parquet")
    pairs = energy.groupby("t_s")["contact_damping_J"].sum()
    assert pairs[pairs.index > 0.012].max() > pairs[pairs.index < 0.004].max() > 0
    check_same(tmp_path / "parts", tmp_path / "whole")


@pytest.mark.slow
def test_an_engine_that_has_little_left_to_do_waits_for_the_plate(tmp_path, monkeypatch):
    """Nothing touches the plate any more: the engine is done in milliseconds, and a plate on a busy machine opens its pipe
    later."""

    class SlowToWrite:
        def __getattr__(self, name):
            return getattr(os, name)

        def open(self, file, flags):
            time.sleep(0.5 if flags & os.O_WRONLY else 0.0)
            return os.open(file, flags)

    scene = changed("elastic_plate", {"plate.max_frequency_Hz": 500.0})
    run_scene(scene, "scene", tmp_path / "whole")
    with pytest.raises(Stopped, match="at the checkpoint"):
        run_scene(scene, "scene", tmp_path / "parts", walltime_s=0.0)
    monkeypatch.setattr(dem.coupling.pipes, "os", SlowToWrite())
    resume(tmp_path / "parts", show_progress=False)
    check_same(tmp_path / "parts", tmp_path / "whole")


def test_there_must_be_something_to_resume(tmp_path):
    with pytest.raises(InputError, match="no run was started here"):
        resume(tmp_path / "nothing")
    assert not list(tmp_path.iterdir())


def test_two_processes_do_not_work_on_one_run(scene, undisturbed, monkeypatch):
    monkeypatch.setattr(dem.run.directory, "LOCK_WAIT_s", 0.2)
    first, second = (RunDirectory(scene.parent / "both").claimed() for _ in range(2))
    with first, pytest.raises(Busy, match="another process"), second:
        pass
