"""Faults injected into a run at work: a disk that fills or fails, a slow disk, a clock that jumps. Each ends in one
line or not at all, and the same command then gives the undisturbed result."""

import os
import resource
import subprocess
import sys

import pytest

from dem.__main__ import main
from dem.coupling.launch import engine_error, library_version
from tests.robustness.small import HERTZ, ROOT, run, small_stone, what_was_said

SIGNALS = ("signals", "fast", "breakage", "energy", "contacts")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    here = tmp_path_factory.mktemp("faults")
    scene = small_stone(here)
    assert run("dem", "run", scene, "--out", here / "whole")[0] == 0
    return scene, here / "whole"


def check_same(out, expected):
    for name in SIGNALS:
        assert (out / f"{name}.parquet").read_bytes() == (expected / f"{name}.parquet").read_bytes(), name


@pytest.mark.validate
@pytest.mark.parametrize("most_bytes", [1_000, 5_000, 10_000, 18_000, 100_000, 200_000])
def test_files_may_not_grow_beyond_a_limit(whole, tmp_path, most_bytes):
    """The limit stands for a quota or a full disk, at every file that the run writes in turn."""
    scene, expected = whole
    done = subprocess.run([sys.executable, "-B", "-m", "dem", "run", str(scene), "--out", str(tmp_path / "run")],
                          cwd=ROOT, capture_output=True, text=True, check=False, timeout=3000,
                          preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, most_bytes)))
    largest = max(file.stat().st_size for file in expected.rglob("*"))
    assert done.returncode == (largest > most_bytes)
    assert "Traceback" not in done.stderr and len(what_was_said(done.stderr)) == done.returncode, done.stderr
    assert run("dem", "run", scene, "--out", tmp_path / "run")[0] == 0
    check_same(tmp_path / "run", expected)


@pytest.mark.parametrize("printed, told", [
    (f"step 1\nERROR: no such file\n{74 * '-'}\nMPI_ABORT was invoked\n{74 * '-'}\n", "ERROR: no such file"),
    (f"step 1\n{74 * '-'}\nmpirun noticed that a process was killed.\n{74 * '-'}",
     "mpirun noticed that a process was killed."),
    ("step 1\nstep 2\n", "step 2"), ("", "no output"),
])
def test_what_the_engine_said_last_that_says_something(tmp_path, printed, told):
    (tmp_path / "engine.out").write_text(printed)
    assert engine_error(tmp_path) == told


def test_a_question_to_dpkg_that_was_killed_is_no_missing_package(tmp_path, monkeypatch, capsys):
    (tmp_path / "dpkg-query").write_text("#!/bin/sh\nkill -9 $$\n")
    (tmp_path / "dpkg-query").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    library_version.cache_clear()
    assert main(["run", str(HERTZ), "--out", str(tmp_path / "run")]) == 1
    errors = capsys.readouterr().err
    assert "signal 9" in errors and errors.count("\n") == 1 and not (tmp_path / "run").exists()


# Run within the program before its command: what the fault changes.
FAULTS = {
    "a slow disk": "import os, time; sync = os.fsync; os.fsync = lambda f: (time.sleep(0.2), sync(f))[1]",
    "a clock that jumps": "import time, itertools; n = itertools.count(); clock = time.time\n"
                          "time.time = lambda: clock() + 1e6 * (-1) ** next(n)",
}


@pytest.mark.validate
@pytest.mark.parametrize("fault", FAULTS)
def test_what_only_takes_time_changes_nothing(whole, tmp_path, fault):
    scene, expected = whole
    program = f"{FAULTS[fault]}\nfrom dem.__main__ import main\nimport sys; sys.exit(main(sys.argv[1:]))"
    done = subprocess.run([sys.executable, "-c", program, "run", str(scene), "--out", str(tmp_path / "run")], cwd=ROOT,
                          capture_output=True, text=True, check=False, timeout=3000)
    assert done.returncode == 0, done.stderr
    check_same(tmp_path / "run", expected)


@pytest.mark.validate
@pytest.mark.parametrize("number", [1, 3, 6, 9, 11, 15, 20, 120])
def test_a_read_that_fails(whole, tmp_path, number):
    """The first, third, ... opening to read below the run's directory fails as on a broken disk: of scene, deck, what
    was started, a checkpoint, what the engine wrote, results, and all of that once more for its list."""
    scene, expected = whole
    program = f"""
import builtins, errno, io, itertools, os, sys
from dem.__main__ import main
count, real = itertools.count(1), io.open
def failing(file, mode="r", *rest, **more):
    if isinstance(file, (str, os.PathLike)) and {str(tmp_path)!r} in str(file) and "r" in mode and "+" not in mode:
        if os.path.exists(file) and next(count) == {number}:
            raise OSError(errno.EIO, "Input/output error", str(file))
    return real(file, mode, *rest, **more)
builtins.open = io.open = failing
sys.exit(main(sys.argv[1:]))
"""
    done = subprocess.run([sys.executable, "-c", program, "run", str(scene), "--out", str(tmp_path / "run")], cwd=ROOT,
                          capture_output=True, text=True, check=False, timeout=3000)
    said = what_was_said(done.stderr)
    assert done.returncode in (1, 2) and len(said) == 1 and "Input/output error" in said[0], done.stderr
    assert run("dem", "run", scene, "--out", tmp_path / "run")[0] == 0
    check_same(tmp_path / "run", expected)
