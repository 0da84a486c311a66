"""A run whose directory was damaged while it stood still goes on to the undisturbed result, with the damage named, or
is refused in one line: never another result."""

import json
import random
import shutil
import struct
import zlib

import pytest

from dem.run.directory import HEADER, half_of, last_whole, name_of, steps_of
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


@pytest.fixture(scope="module")
def of_other_damping(stopped, tmp_path_factory):
    """A run that differs in the plate's damping alone, which the engine does not know."""
    here = tmp_path_factory.mktemp("other")
    scene = small_stone(here, **{"damping_ratio = 0.01": "damping_ratio = 0.2"})
    assert run("dem", "run", scene, "--out", here / "other", "--walltime", 0)[0] == 75
    return here / "other.partial"


def flipped(file, place=0.5):
    data = bytearray(file.read_bytes())
    data[int(place * (len(data) - 1))] ^= 16
    file.write_bytes(data)


def copy_of(stopped, tmp_path):
    shutil.copytree(stopped[0], tmp_path / "run.partial")
    (stopped[0].parent / ".modes").is_dir() and shutil.copytree(stopped[0].parent / ".modes", tmp_path / ".modes")
    return tmp_path / "run.partial"


def whole_checkpoint(partial, said):
    """The step of the last one that is whole; without the engine."""
    identity = json.loads((partial / "started.json").read_text())["identity"]
    return last_whole(partial / "deck", STREAMS, True, name_of(identity), said.append)


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
    parts = [half_of(checkpoint, "engine", step), half_of(checkpoint, "plate", step),
             *[stopped[0] / "deck" / s for s in STREAMS]]
    for number, part in enumerate(part for part in parts if part.exists() and part.stat().st_size):
        partial = copy_of(stopped, tmp_path / str(number))
        file, said = partial / part.relative_to(stopped[0]), []
        assert whole_checkpoint(partial, said) == step and said == []
        if kind == "flip":
            flipped(file)
        elif kind == "cut":
            file.write_bytes(file.read_bytes()[:-7])
        else:
            file.unlink()
        assert whole_checkpoint(partial, said) == 0, file
        lonely = kind == "gone" and file.suffix == ".checkpoint"  # a half alone is none
        assert lonely or file.name in said[0], (file, said)
        assert steps_of(partial / "deck" / "checkpoint") == []


def test_the_checkpoint_before_a_damaged_one_is_gone_on_from(stopped, tmp_path):
    partial = copy_of(stopped, tmp_path)
    checkpoint, said = partial / "deck" / "checkpoint", []
    step = steps_of(checkpoint)[0]
    for half in ("engine", "plate"):
        shutil.copy(half_of(checkpoint, half, step), half_of(checkpoint, half, step + 1000))
    flipped(half_of(checkpoint, "engine", step + 1000), 0.3)
    assert whole_checkpoint(partial, said) == step
    assert len(said) == 1 and str(step + 1000) in said[0]
    assert steps_of(checkpoint) == steps_of(checkpoint, "plate") == [step]


@pytest.mark.parametrize("parts", [["engine", "plate", *STREAMS], ["engine"], ["plate"], ["forces.bin"]])
def test_a_checkpoint_of_a_run_with_another_plate_is_refused(stopped, of_other_damping, tmp_path, parts):
    """All of it or a part is copied in, as whole as it is there."""
    partial = copy_of(stopped, tmp_path)
    there, here = of_other_damping / "deck", partial / "deck"
    step = steps_of(here / "checkpoint")[0]
    assert steps_of(there / "checkpoint")[0] == step
    names = [f"checkpoint/{part}_{step}.checkpoint" if part in ("engine", "plate") else part for part in parts]
    assert (there / names[0]).read_bytes() != (here / names[0]).read_bytes()
    for name in filter(lambda name: (there / name).exists(), names):
        shutil.copy(there / name, here / name)
    assert check_goes_on(stopped, tmp_path, "of another run")


def test_overwrite_begins_anew_whatever_was_begun(stopped, tmp_path):
    """A checkpoint that is whole and yet leads nowhere, here for its state, is no reason to clear up by hand."""
    partial = copy_of(stopped, tmp_path)
    file = half_of(partial / "deck" / "checkpoint", "engine", steps_of(partial / "deck" / "checkpoint")[0])
    data = bytearray(file.read_bytes())
    at = data.index(b"atoms\0") + 40
    data[at:at + 8] = struct.pack("<d", 1e9)  # the tag of its first sub-sphere
    HEADER.pack_into(data, 0, *HEADER.unpack_from(data)[:-1], zlib.crc32(data[HEADER.size:]))
    file.write_bytes(data)
    scene = stopped[0].parent / "stone.toml"
    assert run("dem", "run", scene, "--out", tmp_path / "run")[0] == 1
    assert run("dem", "run", scene, "--out", tmp_path / "run", "--overwrite")[0] == 0
    for name in SIGNALS:
        whole = (stopped[1] / f"{name}.parquet").read_bytes()
        assert (tmp_path / "run" / f"{name}.parquet").read_bytes() == whole, name


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
