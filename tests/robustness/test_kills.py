"""A run killed at random moments, again and again, gives the undisturbed result: byte for byte on one rank.

KILLS in the environment says how many kills there are of each kind of run. Without it there are 201 in all.
"""

import os
import random
import shutil
import signal
import sys
import time

import numpy as np
import pandas as pd
import pytest

import dem.run.run  # noqa: F401  what a run imports late is there already when it is forked: kills meet its work
from dem.__main__ import main
from dem.coupling.pipes import STOPPED
from dem.run.directory import steps_of
from tests.robustness.small import below, is_alive, small_stone

ONE_RANK, TWO_RANKS = (int(os.environ.get("KILLS", kills)) for kills in ("47", "60"))  # of each kind
FALLING = "[[stones.each]]\nradius_m = 0.025\nmaterial = "
LATER = f"""
{FALLING}"coal"\nplace_m = [0.1, 0.0]\nvelocity_m_s = 3.0
{FALLING}"gangue"\nplace_m = [-0.1, 0.1]\nvelocity_m_s = 4.0\narrival_s = 0.003
{FALLING}"gangue"\nplace_m = [0.23, -0.1]\nvelocity_m_s = [9.0, 0.0, -1.0]
"""  # one stone enters while the first breaks, and one leaves the plate
KINDS = {"sub-spheres": {}, "smooth": {"subspheres = 60": "subspheres = 200", '"sub_spheres"': '"smooth"'},
         "stones that come and go": {
             "count = 1\n": "", "radius_m = 0.025": "", "speed_m_s = 3.0": "",
             "gangue_order = [1]": "", "gangue_ratio = 0.0": "",
             "positions_m = [[0.1, 0.0]]": "", "[materials]": LATER + "[materials]"},
         "two ranks": {  # the time in which the stone breaks, with as many checkpoints
             'name = "single"': 'name = "single"\nranks = 2', "duration_s = 6e-3": "duration_s = 1.2e-3",
             "sample_interval_s = 1.5e-4": "sample_interval_s = 3e-5",
             "view_interval_s = 1.5e-3": "view_interval_s = 3e-4"}}


def fork_run(scene, out, errors, *more):
    """The command in a process that has done its imports already."""
    pid = os.fork()
    if pid:
        return pid
    code = 70
    try:
        os.dup2(os.open(errors, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)
        sys.stderr, sys.stdout = os.fdopen(2, "w"), open(os.devnull, "w")
        code = main(["run", str(scene), "--out", str(out), *more])
        sys.stderr.flush()
    finally:
        os._exit(code)


def ended(pid, patience_s):
    """Exit code as of os.waitstatus_to_exitcode, None if it still runs after that time."""
    deadline = time.monotonic() + patience_s
    while time.monotonic() < deadline:
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.005)
    return None


def stop_at_a_checkpoint(scene, out, errors, rng):
    """A run as short as these is done before it takes a checkpoint by itself. Asked to stop, it takes one."""
    for _ in range(rng.randint(1, 3)):
        if ended(fork_run(scene, out, errors, "--walltime", "0"), 3000) != STOPPED:
            break


def kill_some(pid, turn):
    """The run, its engine or one of its ranks, or everybody at once. Returns all that there were."""
    children = [child for child, _ in below(pid)]
    victims = [[pid], children[-1:], [pid, *children]][turn % 3] or [pid]
    for victim in victims:
        try:
            os.kill(victim, signal.SIGKILL)
        except ProcessLookupError:
            pass
    return children


def killed_until_finished(scene, out, rng, longest_s, kills_left, stops_first):
    """Returns the number of kills that it took, and how many of them met a run with a checkpoint."""
    kills, met, errors = 0, 0, out.with_name("stderr")
    checkpoints = out.with_name(f"{out.name}.partial") / "deck" / "checkpoint"
    while not out.exists():
        if stops_first or kills % 2:  # else every other one when there is something to go on from
            stop_at_a_checkpoint(scene, out, errors, rng)
        if out.exists():
            break
        pid = fork_run(scene, out, errors)
        code = ended(pid, rng.uniform(0, longest_s) if kills < kills_left else 3000)
        children = []
        if code is None:
            children = kill_some(pid, kills)
            kills += 1
            met += bool(steps_of(checkpoints))
            code = ended(pid, 3000)
        text = errors.read_text()
        assert code in (0, 1, -signal.SIGKILL) and "Traceback" not in text, (code, text)
        deadline = time.monotonic() + 60
        while any(map(is_alive, children)):
            assert time.monotonic() < deadline, "a process outlived the run"
            time.sleep(0.01)
        assert not out.exists() or (out / "contents.json").exists()  # whole or absent
    return kills, met


def check_same(out, expected, ranks):
    """Every table of the two runs; two ranks sum in another order after a checkpoint. Energies are compared with the
    largest of their table, since some are differences of it."""
    assert {file.name for file in out.glob("*.parquet")} == {file.name for file in expected.glob("*.parquet")}
    for wanted in expected.glob("*.parquet"):
        found = out / wanted.name
        if ranks == 1:
            assert found.read_bytes() == wanted.read_bytes(), wanted.name
            continue
        found, wanted = pd.read_parquet(found), pd.read_parquet(wanted)
        assert len(found) == len(wanted), out
        numbers = wanted.select_dtypes("number")
        for column in numbers:
            alike = numbers.filter(regex="_J$") if column.endswith("_J") else numbers[[column]]
            scale = np.abs(alike.to_numpy()).max() if len(wanted) else 1.0
            np.testing.assert_allclose(found[column], wanted[column], rtol=0, atol=1e-12 * scale + 1e-300)


@pytest.mark.validate
@pytest.mark.parametrize("kind", KINDS)
def test_killed_at_many_moments(tmp_path, kind):
    scene, ranks = small_stone(tmp_path, **KINDS[kind]), 2 if kind == "two ranks" else 1
    assert ended(fork_run(scene, tmp_path / "whole", tmp_path / "stderr"), 3000) == 0, (tmp_path / "stderr").read_text()
    start = time.monotonic()
    assert ended(fork_run(scene, tmp_path / "again", tmp_path / "stderr"), 3000) == 0
    longest_s = time.monotonic() - start
    check_same(tmp_path / "again", tmp_path / "whole", ranks)
    rng, kills, met, resumed, wanted = random.Random(ranks), 0, 0, 0, ONE_RANK if ranks == 1 else TWO_RANKS
    while kills < wanted:
        more = killed_until_finished(scene, tmp_path / "killed", rng, longest_s, wanted - kills, ranks == 2)
        kills, met = kills + more[0], met + more[1]
        check_same(tmp_path / "killed", tmp_path / "whole", ranks)
        resumed += len(pd.read_json(tmp_path / "killed" / "run.json", typ="series")["resumed_at_s"])
        shutil.rmtree(tmp_path / "killed")
        print(f"{kind}: {kills} kills so far, {met} met a checkpoint", flush=True)
    print(f"{kind}: {kills} kills, of which {met} met a checkpoint; taken up at one {resumed} times")
    assert resumed > 0 and met >= (0.8 if ranks == 2 else 0.4) * wanted
