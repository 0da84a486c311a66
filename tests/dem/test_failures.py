"""A full disk, an output that cannot be written, too little memory, a file cut off: one clear line, and nothing that was
finished is lost."""

import os
import subprocess
import sys
from contextlib import contextmanager

import numpy as np
import pandas as pd
import pytest
from scenes_of_tests import SCENES

from dem.__main__ import main
from plate_fem.modes import plate_modes, table_hash


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A small stone on a rigid plate with many pictures, which fill a disk."""
    text = (SCENES.parent / "tests" / "single.toml").read_text()
    rigid = (SCENES / "hertz_coal.toml").read_text()
    text = text[:text.index("[plate]")] + rigid[rigid.index("[plate]"):]
    assert "subspheres = 500" in text
    file = tmp_path_factory.mktemp("failures") / "stone.toml"
    file.write_text(text.replace("subspheres = 500", "subspheres = 200"))
    return file


@contextmanager
def disk(directory, options):
    """A file system in memory of its own."""
    directory.mkdir()
    if os.geteuid() != 0:
        pytest.skip("only root may mount a small file system")
    if subprocess.run(["mount", "-t", "tmpfs", "-o", options, "none", directory], check=False).returncode != 0:
        pytest.skip("this machine does not let root mount a file system")
    try:
        yield directory
    finally:
        subprocess.run(["umount", directory], check=True)


def one_line(capsys):
    error = capsys.readouterr().err.splitlines()
    said = (" s  left ", " ...", "warning: ")  # progress, stages, and what a scene is warned of
    lines = [line for line in error if not any(words in line for words in said)]
    assert len(lines) == 1, error
    return lines[0]


@pytest.mark.slow
def test_a_full_disk_ends_the_run_in_one_line_and_room_lets_it_go_on(scene, tmp_path, capsys):
    with disk(tmp_path / "small", "size=700k") as small:
        earlier = small / "earlier"
        earlier.mkdir()
        (earlier / "run.json").write_text("{}\n")
        assert main(["run", str(scene), "--out", str(small / "run")]) == 1
        line = one_line(capsys)
        assert str(small / "run") in line and ("No space left" in line or "disk is full" in line), line
        assert not (small / "run").exists() and (earlier / "run.json").read_text() == "{}\n"
        subprocess.run(["mount", "-o", "remount,size=30m", small], check=True)
        assert main(["run", str(scene), "--out", str(small / "run")]) == 0
        assert main(["run", str(scene), "--out", str(tmp_path / "elsewhere")]) == 0
        for name in ("signals", "breakage"):
            pd.testing.assert_frame_equal(pd.read_parquet(small / "run" / f"{name}.parquet"),
                                          pd.read_parquet(tmp_path / "elsewhere" / f"{name}.parquet"), check_exact=True)
        assert len(list((small / "run" / "view").iterdir())) == len(list((tmp_path / "elsewhere" / "view").iterdir()))


@pytest.mark.parametrize("size_k", [8, 100, 140])
def test_a_full_disk_names_the_file(scene, tmp_path, capsys, size_k):
    """While the lock, the deck, or what the engine says is written."""
    with disk(tmp_path / "small", f"size={size_k}k") as small:
        assert main(["run", str(scene), "--out", str(small / "run")]) == 1
        line = one_line(capsys)
        assert str(small / "run.partial") in line and ("No space left" in line or "disk is full" in line), line


def test_an_output_that_cannot_be_written_is_refused_in_one_line(scene, tmp_path, capsys):
    with disk(tmp_path / "read_only", "ro,size=1m") as directory:
        assert main(["run", str(scene), "--out", str(directory / "run")]) == 1
        line = one_line(capsys)
        assert str(directory) in line and "Read-only" in line


@pytest.mark.slow
def test_too_little_memory_ends_the_run_in_one_line(scene, tmp_path):
    """The limit is set when the modules are loaded: 10 MB are enough to begin with, not to pack a stone."""
    program = ("import resource, sys; import dem.run.run; from dem.__main__ import main\n"
               "now = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()\n"
               "resource.setrlimit(resource.RLIMIT_AS, (now + 10_000_000,) * 2)\n"
               f"sys.exit(main(['run', {str(scene)!r}, '--out', {str(tmp_path / 'run')!r}]))\n")
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=SCENES.parent, check=False,
                          timeout=120, env=os.environ | {"COAL_GANGUE_CACHE": str(tmp_path / "cache")})
    lines = [line for line in done.stderr.splitlines() if " left " not in line and not line.endswith(" ...")]
    assert done.returncode == 1 and len(lines) == 1 and "memory" in lines[0].lower(), done.stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("text, words", [("{\"status\": ", "cut off or not JSON"), ("[1, 2]", "not what a run wrote")])
def test_a_run_json_that_cannot_be_read_is_named(scene, tmp_path, capsys, text, words):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "run.json").write_text(text)
    assert main(["resume", str(tmp_path / "run")]) == 2
    line = one_line(capsys)
    assert words in line and "run.json" in line


@pytest.mark.slow
def test_modes_on_disk_that_are_cut_off_or_foreign_are_found_anew(tmp_path):
    from common.files.cache import entry_file
    from common.scene.plate import read_plate

    plate = read_plate(SCENES / "elastic_plate.toml").model_copy(update={"max_frequency_Hz": 400.0})
    expected = plate_modes(plate, tmp_path)
    file = entry_file(tmp_path, "modes", table_hash(plate))
    whole = file.read_bytes()
    for damaged in (whole[:len(whole) // 2], b"", b"PAR1 something else"):
        file.write_bytes(damaged)
        assert np.array_equal(plate_modes(plate, tmp_path).frequency_Hz, expected.frequency_Hz)
        assert len(file.read_bytes()) == len(whole)
