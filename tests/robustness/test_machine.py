"""A machine with too little memory, a full disk, or a reader that goes away: one line, and nothing half written."""

import contextlib
import resource
import subprocess
import sys

import pytest

import recognition.__main__
import report.__main__
from tests.analysis.synthetic import write_run, write_sweep
from tests.fuzz.mutations import outcome
from tests.robustness.small import ROOT


@pytest.mark.parametrize("fault", ['RuntimeError("can\'t start new thread")', "MemoryError()",
                                   'ImportError("x.so: failed to map segment from shared object")'])
def test_too_little_memory_for_a_thread_or_a_library(fault):
    done = subprocess.run([sys.executable, "-c", "from common.process.command import run_command\n"
                           f"def fails(): raise {fault}\n"
                           "raise SystemExit(run_command('dem', fails))"], cwd=ROOT, capture_output=True, text=True,
                          check=False)
    assert done.returncode == 1 and done.stderr.count("\n") == 1 and "not enough memory" in done.stderr


def shell(command):
    return subprocess.run(["bash", "-c", f"set -o pipefail; {command}"], capture_output=True, text=True, cwd=ROOT,
                          check=False, timeout=3000)


def test_a_reader_that_goes_away_and_a_full_disk_behind_standard_output(tmp_path):
    write_run(tmp_path / "ratio_030", 0.3)
    program = f"{sys.executable} -m analysis features {tmp_path / 'ratio_030'}"
    closed = shell(f"{program} | (exec 0<&-; sleep 0.1)")
    assert closed.stderr == "" and closed.returncode in (0, 141)  # 0 where all was written before
    full = shell(f"{program} > /dev/full")
    assert full.returncode == 1 and full.stderr == "analysis: No space left on device\n"


@contextlib.contextmanager
def write_limit(number_of_bytes):
    """Within, files of so many bytes may be written, as on a full disk. Bytecode that is cut off would fail later."""
    free = resource.getrlimit(resource.RLIMIT_FSIZE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "dont_write_bytecode", True)
        resource.setrlimit(resource.RLIMIT_FSIZE, (number_of_bytes, free[1]))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, free)


@pytest.mark.slow
def test_a_disk_that_is_full_when_a_model_or_a_report_is_written(tmp_path, monkeypatch):
    sweep = write_sweep(tmp_path / "sweep", ratios=(0.0, 0.3, 0.7, 1.0))
    run = sweep / "ratio_030"
    monkeypatch.setattr("recognition.estimation.noise.COPIES", 2)
    for entry, arguments in [(recognition.__main__.main, ["fit", sweep, "--out", tmp_path / "model.json"]),
                             (report.__main__.main, [run])]:
        with write_limit(1000):
            code, errors = outcome(entry, [str(argument) for argument in arguments])
        # The cache may tell it too.
        lines = [line for line in errors.splitlines()
                 if "not kept for later runs" not in line and "_write(" not in line]
        assert code == 1 and len(lines) == 1 and "File too large" in lines[0], errors
    assert not (tmp_path / "model.json").exists() and not (run / "report.html").exists()
    assert not list(tmp_path.rglob("*.part"))
