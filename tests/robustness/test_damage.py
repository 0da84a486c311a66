"""A run whose directory was damaged while it stood still goes on to the undisturbed result, with the damage named, or
is refused in one line: never another result."""

import random
import shutil

import pytest

from dem.coupling.checkpoint import engine_file, last_whole, plate_file, steps_of
from tests.robustness.small import run, small_stone, what_was_said

SIGNALS = ("signals", "fast", "breakage", "energy", "contacts")
STREAMS = ["ledger.bin", "forces.bin", "contacts.bin", "events.csv", "pictures.bin"]  # in the deck's order


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """A run stopped at a checkpoint, and the undisturbed one."""
    here = tmp_path_factory.mktemp("damage")
    scene = small_stone(here)
    assert run("dem", "run", scene, "--out", here / "stopped", "--walltime", 0)[0] == 75
    assert run("dem", "run", scene, "--out", here / "whole")[0] == 0
    return here / "stopped.partial", here / "whole"


def flipped(file, place=0.5):
    data = bytearray(file.read_bytes())
    data[int(place * (len(data) - 1))] ^= 16
    file.write_bytes(data)


def copy_of(stopped, tmp_path):
    shutil.copytree(stopped[0], tmp_path / "run.partial")
    (stopped[0].parent / ".modes").is_dir() and shutil.copytree(stopped[0].parent / ".modes", tmp_path / ".modes")
    return tmp_path / "run.partial"


def check_goes_on(stopped, tmp_path, damaged):
    """Returns whether it went on; what is there then is the undisturbed result."""
    code, _, errors = run("dem", "resume", tmp_path / "run")
    said = what_was_said(errors)
    assert "Traceback" not in errors and code in (0, 2), errors
    if code == 2:
        assert len(said) == 1 and damaged in said[0] and not (tmp_path / "run").exists(), errors
        return False
    assert any(damaged in line for line in said), (damaged, errors)
    for name in SIGNALS:
        whole = (stopped[1] / f"{name}.parquet").read_bytes()
        assert (tmp_path / "run" / f"{name}.parquet").read_bytes() == whole, (name, damaged)
    return True


@pytest.mark.parametrize("name", ["ledger.bin", "shapes.bin"])
def test_a_damaged_stream_or_deck_gives_no_other_result(stopped, tmp_path, name):
    file = copy_of(stopped, tmp_path) / "deck" / name
    flipped(file)
    assert check_goes_on(stopped, tmp_path, name)


def test_a_damaged_started_json_is_refused(stopped, tmp_path):
    flipped(copy_of(stopped, tmp_path) / "started.json", 0.7)
    assert not check_goes_on(stopped, tmp_path, "started.json")


@pytest.mark.parametrize("kind", ["flip", "cut", "gone"])
def test_each_part_of_a_checkpoint_is_checked(stopped, tmp_path, kind):
    """Its halves and every stream; without the engine."""
    step = steps_of(stopped[0] / "deck" / "checkpoint")[0]
    checkpoint = stopped[0] / "deck" / "checkpoint"
    parts = [engine_file(checkpoint, step), plate_file(checkpoint, step), *[stopped[0] / "deck" / s for s in STREAMS]]
    for number, part in enumerate(part for part in parts if part.exists() and part.stat().st_size):
        partial = copy_of(stopped, tmp_path / str(number))
        file, said = partial / part.relative_to(stopped[0]), []
        assert last_whole(partial / "deck", STREAMS, True, said.append) == step and said == []
        if kind == "flip":
            flipped(file)
        elif kind == "cut":
            file.write_bytes(file.read_bytes()[:-7])
        else:
            file.unlink()
        assert last_whole(partial / "deck", STREAMS, True, said.append) == 0, file
        lonely = kind == "gone" and file.suffix == ".checkpoint"  # a half alone is none
        assert lonely or file.name in said[0], (file, said)
        assert steps_of(partial / "deck" / "checkpoint") == []


def test_the_checkpoint_before_a_damaged_one_is_gone_on_from(stopped, tmp_path):
    partial = copy_of(stopped, tmp_path)
    checkpoint, said = partial / "deck" / "checkpoint", []
    step = steps_of(checkpoint)[0]
    for name in (engine_file, plate_file):
        shutil.copy(name(checkpoint, step), name(checkpoint, step + 1000))
    flipped(engine_file(checkpoint, step + 1000), 0.3)
    assert last_whole(partial / "deck", STREAMS, True, said.append) == step
    assert len(said) == 1 and str(step + 1000) in said[0]
    assert steps_of(checkpoint) == steps_of(checkpoint, "plate") == [step]


@pytest.mark.validate
def test_fifty_random_damages(stopped, tmp_path):
    rng, outcomes = random.Random(50), []
    files = [file.relative_to(stopped[0]) for file in sorted(stopped[0].rglob("*"))
             if file.is_file() and file.stat().st_size and file.name not in ("lock", "engine.log", "engine.out",
                                                                             "log.liggghts")]
    for k in range(50):
        partial = copy_of(stopped, tmp_path / str(k))
        file = partial / rng.choice(files)
        if rng.random() < 0.5:
            flipped(file, rng.random())
        else:
            file.write_bytes(file.read_bytes()[:int(rng.random() * file.stat().st_size)])
        outcomes.append(check_goes_on(stopped, tmp_path / str(k), file.name))
        shutil.rmtree(tmp_path / str(k))
    assert outcomes.count(True) > 25, outcomes
