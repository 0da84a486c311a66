"""One Ctrl-C ends everything that a command started, with one line, and keeps what is finished."""

import os
import random
import signal
import subprocess
import sys
import time

import pytest

from tests.robustness.small import ROOT, SCENES, below, is_alive, small_stone, start, wait_until, what_was_said

LINE = "interrupted; what is finished stays, the same command goes on"
PROGRAMS = {"dem": ["deck", "SCENE", "--out", "OUT"], "plate_fem": ["modes", "SCENE"],
            "analysis": ["features", "nothing.csv"], "recognition": ["evaluate", "nowhere"], "report": ["nowhere"],
            "gangue": ["features", "nothing.csv"]}


def numpy_is_loading(pid):
    """The first of the slow imports, after which a program listens for certain."""
    try:
        return "_multiarray_umath" in open(f"/proc/{pid}/maps").read()
    except OSError:
        return False


def interrupt_at(name, tmp_path, delay_s):
    """Exit code, and how long the program went on after it had loaded numpy, s."""
    words = {"SCENE": SCENES / "paper.toml", "OUT": tmp_path / "out"}
    process = start(name, *[words.get(word, word) for word in PROGRAMS[name]], start_new_session=True)
    while process.poll() is None and not numpy_is_loading(process.pid):
        time.sleep(0.005)
    loaded = time.monotonic()
    try:
        _, errors = process.communicate(timeout=delay_s)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=6000)
    went_on_s = time.monotonic() - loaded
    assert "Traceback" not in errors, (name, delay_s, errors)
    if process.returncode == 130:
        assert what_was_said(errors) == [LINE]
    else:
        assert process.returncode in (0, 2), errors  # it was done before
    return process.returncode, went_on_s


@pytest.mark.parametrize("name", PROGRAMS)
def test_no_traceback_while_a_program_starts(tmp_path, name):
    assert interrupt_at(name, tmp_path, 0.01)[0] == 130  # a fast machine is done with the shortest in 0.05 s


SLOW_TO_END = """
import os, time
from common.process.command import listen_for_interrupt
class Last:
    def __del__(self, write=os.write, sleep=time.sleep):  # when Python forgets its modules
        write(1, b"going")
        sleep(1)
listen_for_interrupt()
last = Last()
raise SystemExit(2)
"""


def test_an_interrupt_after_the_end_changes_nothing():
    process = subprocess.Popen([sys.executable, "-c", SLOW_TO_END], cwd=ROOT, stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE)
    assert process.stdout.read(5) == b"going"
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=600) == (b"", b"") and process.returncode == 2


@pytest.mark.validate
@pytest.mark.parametrize("name", PROGRAMS)
def test_no_traceback_at_thirty_moments(tmp_path, name):
    rng = random.Random(name)
    # The second one finds caches and files in memory, as those that are interrupted do.
    (code, _), (_, whole_s) = (interrupt_at(name, tmp_path / f"whole_{k}", 6000) for k in range(2))
    assert code != 130
    codes = [interrupt_at(name, tmp_path / str(k), rng.uniform(0, whole_s))[0] for k in range(30)]
    assert codes.count(130) > 5, codes


def engines_below(process):
    return [pid for pid, program in below(process.pid) if "liggghts" in program]


def long_runs(tmp_path, command):
    """A command at work on three runs, one at a time, that has started an engine, and its directory."""
    scene = small_stone(tmp_path, **{"count = 1\n": "count = 2\n", "gangue_order = [1]": "gangue_order = [2, 1]",
                                     "[0.1, 0.0]": "[0.1, 0.0], [-0.1, 0.0]",
                                     # not done while Snakemake, which is asked first, waits for it
                                     "duration_s = 6e-3": "duration_s = 0.6\nfree_flight_tolerance = 0.0"})
    (tmp_path / "plan.toml").write_text('scene = "stone.toml"\nseed = 1\n'
                                        '[families.one]\ngroups = 1\nruns_per_group = 3\n')
    (tmp_path / "values.toml").write_text('scene = "stone.toml"\n[vary]\n"stones.seed" = [1, 2, 3]\n')
    file = {"dataset": tmp_path / "plan.toml", "campaign": tmp_path / "values.toml"}.get(command, scene)
    out = tmp_path / "out"
    jobs = [] if command == "run" else ["--jobs", "1"]
    process = start("dem", command, file, "--out", out, *jobs, start_new_session=True)
    wait_until(lambda: engines_below(process), process, "an engine")
    return process, [pid for pid, _ in below(process.pid)]


def check_gone(everybody):
    deadline = time.monotonic() + 300
    while any(map(is_alive, everybody)):
        assert time.monotonic() < deadline, "a child outlived the command"
        time.sleep(0.02)


@pytest.mark.slow
@pytest.mark.parametrize("command", ["sweep", "dataset", "run", "campaign"])
def test_one_interrupt_ends_the_children_and_what_waits_does_not_start(tmp_path, command):
    process, everybody = long_runs(tmp_path, command)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does
    output, errors = process.communicate(timeout=600)
    assert process.returncode == 130, errors
    said = what_was_said(errors)
    assert said[-1:] == [LINE] and "Traceback" not in output + errors
    assert len(said) == 1 or command == "campaign"  # Snakemake tells of every run
    check_gone(everybody)
    begun = [*tmp_path.rglob("*.partial")]
    assert len(begun) == 1 and (begun[0] / "started.json").exists()  # what was at work stays, and no other began


@pytest.mark.slow
@pytest.mark.parametrize("command, number", [
    ("sweep", signal.SIGTERM), pytest.param("campaign", signal.SIGHUP, marks=pytest.mark.validate),
    pytest.param("campaign", signal.SIGKILL, marks=pytest.mark.validate)])
def test_a_command_that_is_killed_takes_all_with_it_and_can_be_given_again(tmp_path, command, number):
    process, everybody = long_runs(tmp_path, command)
    process.send_signal(number)
    process.communicate(timeout=600)
    assert process.returncode == -number
    check_gone(everybody)
    if number == signal.SIGKILL:
        again, _ = long_runs(tmp_path, command)  # as far as an engine
        again.kill()
        again.communicate(timeout=600)
