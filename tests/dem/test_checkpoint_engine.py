"""The engine's half of a checkpoint: taken while bonds break, friction slips and dampers work, the run goes on from it
bit by bit on one rank, and to round-off on two."""

import os
import re
import subprocess
from itertools import pairwise

import numpy as np
import pytest
from decks import FREE_FLIGHT, HEAD, MATERIAL, bond_line, fcc_ball, frames, ledger, write_files

from dem.coupling.launch import ENGINE
from dem.run.directory import half_of, steps_of

EVERY, STEPS = 250, 1000
AWAY = ("fix gravity unheld gravity 6000 vector 0 0 -1\n"
        f"fix free_flight all {FREE_FLIGHT} agglomerates agglomerates.txt gravity 6000 speed 5 tolerance 1e-3 every 50 unheld unheld\n")
STREAMS = ("view.dump", "forces.bin", "ledger.bin", "events.csv")


def write_strike(directory, steps=STEPS, extra="", fracture=0.0):
    """A ball hits the rigid plate aslant, breaks, and its sub-spheres rub on each other and on the plate."""
    body = fcc_ball(5)
    body.center_m[:, 2] += 1e-5 - (body.center_m[:, 2] - body.radius_m).min()
    write_files(directory, body)
    t0 = np.sqrt(body.mass_kg.min() / (5e9 * np.pi * 1e-3**2 / 2e-3))
    (directory / "deck.liggghts").write_text(
        HEAD + "variable resume index 0\nvariable walltime index never\nread_data atoms.data\n" + MATERIAL + f"timestep {float(0.2 * t0)!r}\n"
        "fix ledger all ledger agglomerates agglomerates.txt every 50 file ledger.bin\n"
        "group unheld type > 0\nfix motion unheld nve/sphere\n" + bond_line(tension=1e6, shear=1e6, damping_time=0.1 * t0, fracture=fracture) +
        "fix plate all wall/plate agglomerates agglomerates.txt forces forces.bin extent -1 1 -1 1 co_step 1 "
        "contact model hertz tangential history primitive type 2 zplane 0.0\n" + extra +
        "velocity all set 2 1 -5 units box\n"
        f"dump view all custom {EVERY} view.dump id x y z vx vy vz omegax omegay omegaz fx fy fz tqx tqy tqz mass radius\n"
        f'dump_modify view format "%d{17 * " %.17g"}" append yes\n'
        f"fix checkpoint all checkpoint every {EVERY} directory checkpoint resume ${{resume}} walltime ${{walltime}} streams "
        f"{' '.join(STREAMS)}\nrun {steps} upto\n")


def engine(directory, ranks, resume=0, walltime="never"):
    command = [str(ENGINE), "-in", "deck.liggghts", "-var", "resume", str(resume), "-var", "walltime", walltime]
    if ranks > 1:
        command = ["mpirun", "--oversubscribe", "-np", str(ranks), *command]
    return subprocess.Popen(command, cwd=directory, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                            stderr=subprocess.STDOUT, text=True, errors="replace",
                            env=os.environ | {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"})


def stopped_at_next(directory, ranks, resume=0):
    """Runs an engine that is to stop at its first checkpoint. Returns its exit code, what it printed, and the step at which
    it says that it stopped."""
    process = engine(directory, ranks, resume, walltime="0")
    output = process.communicate(timeout=60)[0]
    stopped = re.search(r"Stopped at the checkpoint of step (\d+)", output)
    return process.returncode, output, int(stopped[1]) if stopped else None


def split(directory, ranks, look=lambda: None):
    """The same run stopped at each step at which a checkpoint can be taken, and taken up again. Returns what was to be
    looked at at each."""
    step, seen = 0, []
    while True:
        code, output, stopped = stopped_at_next(directory, ranks, step)
        if code == 0:
            assert seen, output[-1500:]
            return seen
        assert stopped is not None and stopped > step and stopped % EVERY == 0, output[-1500:]
        assert code == 75 and stopped == step + EVERY
        step = stopped
        last_two = [step, step - EVERY] if step > EVERY else [step]  # the one before, and a new one
        assert steps_of(directory / "checkpoint") == last_two
        for older in last_two[1:]:  # who starts the engine removes all but the one to go on from
            half_of(directory / "checkpoint", "engine", older).unlink()
        with open(directory / "forces.bin", "ab") as stream:  # what a killed run wrote after its checkpoint
            stream.write(b"torn")
        seen.append(look())


@pytest.mark.slow
@pytest.mark.parametrize("ranks, fracture", [(1, 0.0), (2, 0.0), (1, 0.6), (2, 0.6)])
def test_a_split_run_is_the_undisturbed_one(tmp_path, ranks, fracture):
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    for directory in (whole, parts):
        directory.mkdir()
        write_strike(directory, fracture=fracture)
    output, _ = engine(whole, ranks).communicate(timeout=60)
    assert len(ledger(whole).step) == STEPS // 50, output[-1500:]
    split(parts, ranks)
    broken = [int(line.split(",")[0]) for line in (whole / "events.csv").read_text().splitlines()[1:]]
    assert min(broken) < EVERY < max(broken)
    contacts = ledger(whole).column
    assert contacts["pair_damped_J"][-1] > 0 and contacts["wall_damped_J"][-1] > 0
    if ranks == 1:
        for name in STREAMS:
            assert (parts / name).read_bytes() == (whole / name).read_bytes(), name
    else:
        a, b = frames(whole), frames(parts)
        assert np.array_equal(a.step, b.step)
        assert np.abs(a.x - b.x).max() < 1e-9
        for name, values in contacts.items():
            assert ledger(parts).column[name] == pytest.approx(values, rel=1e-6, abs=1e-9 * np.abs(values).max()), name


def newest(directory):
    return half_of(directory, "engine", steps_of(directory)[0])


def bodies_away(checkpoint):
    """How many bodies the fix for free flight has in a checkpoint of the engine."""
    data = checkpoint.read_bytes()
    at = data.index(f"{FREE_FLIGHT}\0".encode().ljust(32, b"\0")) + 32
    return int(np.frombuffer(data, "<f8", 1, at + 8)[0])


@pytest.mark.slow
def test_a_run_with_bodies_in_the_air_is_split(tmp_path):
    """Fragments are away from the arrays at the checkpoint, and one of them comes back later."""
    steps = 16 * EVERY
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    for directory in (whole, parts):
        directory.mkdir()
        write_strike(directory, steps, AWAY)
    output, _ = engine(whole, 1).communicate(timeout=60)
    assert len(ledger(whole).step) == steps // 50, output[-1500:]
    away = split(parts, 1, lambda: bodies_away(newest(parts / "checkpoint")))
    assert max(away) > 3, away
    assert any(later < earlier for earlier, later in pairwise(away)), away  # one came back
    for name in STREAMS[1:]:
        assert (parts / name).read_bytes() == (whole / name).read_bytes(), name
    a, b = frames(whole), frames(parts)
    for name in ("step", "x", "v", "omega"):  # a body that is away has no forces
        assert np.array_equal(getattr(a, name), getattr(b, name)), name


def test_a_damaged_or_foreign_checkpoint_is_refused(tmp_path):
    write_strike(tmp_path)
    stopped_at_next(tmp_path, 1)
    file = tmp_path / "checkpoint" / f"engine_{EVERY}.checkpoint"
    data = file.read_bytes()
    for damaged, words in [(data[:-9], "cut off or damaged"), (data[:200] + b"x" + data[201:], "cut off or damaged"),
                           (b"PAR1" + data[4:], "not a checkpoint"), (data[:8] + b"\x63" + data[9:], "another version")]:
        file.write_bytes(damaged)
        output, _ = (process := engine(tmp_path, 1, EVERY)).communicate(timeout=60)
        assert process.returncode != 0 and words in output and file.name in output
