"""The contract of docs/coupling.md, each side alone against a stand-in for the other, and what happens when one
fails."""

import os
import signal
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scenes_of_tests import SCENES, changed
from scipy.linalg import expm

import dem.coupling.pipes
from common.files.cache import user_cache
from dem.coupling.launch import ENGINE
from dem.coupling.pipes import CouplingError, EngineWatchdog, FinishedMessage, ForceMessage, PlatePipes
from dem.deck.render import write_deck
from dem.deck.time_step import TimeStep
from dem.run.participants import PlateParticipant
from dem.run.prepare import prepare
from plate_fem.modes import PlateModes
from plate_fem.motion import ModalMotion

FREQUENCY_Hz = 200.0


def one_mode():
    """A plate of one mode with shape 1 kg^-1/2 everywhere."""
    return PlateModes(
        frequency_Hz=np.array([FREQUENCY_Hz]), damping_ratio=np.zeros(1), lines_x_m=np.array([-1.0, 1.0]),
        lines_y_m=np.array([-1.0, 1.0]), nodal=np.concatenate([np.ones((1, 4, 1)), np.zeros((3, 4, 1))]),
        mean_shape=np.ones(1), rod_force=np.zeros((0, 1)), surface_stress=np.zeros((4, 3, 1)), mass_kg=1.0,
        theory="kirchhoff", n_residual=0)


def steps(count):
    return TimeStep(dt_s=1e-6, limits_s={}, bond_time_s=None, co_step=10, fast_steps=10, sample_steps=10, steps=count)


class FakeEngine(threading.Thread):
    """Honours the contract: a mass m on a spring k that is fixed to the plate, mean forces over each co-step."""

    def __init__(self, directory, mass, stiffness, co_steps, interval_s, substeps=50):
        super().__init__(daemon=True)
        self.names = [directory / "to_plate", directory / "from_plate"]
        self.mass, self.stiffness, self.co_steps, self.interval_s, self.substeps = (
            mass, stiffness, co_steps, interval_s, substeps)
        self.z = []

    def run(self):
        with open(self.names[0], "wb", buffering=0) as out, open(self.names[1], "rb", buffering=0) as answers:
            z, v, w = 0.0, -1.0, 0.0
            dt = self.interval_s / self.substeps
            mean = 0.0
            for k in range(self.co_steps):
                out.write(struct.pack("<qqqd", 10 * k, min(k, 1), 1, mean))
                step, reach, target, _ = struct.unpack("<qddd", answers.read(32))
                assert step == 10 * k and reach >= 0
                impulse, start = 0.0, w
                for n in range(self.substeps):  # velocity Verlet against the moving wall
                    force = -self.stiffness * (z - (start + (target - start) * n / self.substeps))
                    v += 0.5 * dt * force / self.mass
                    z += dt * v
                    after = -self.stiffness * (z - (start + (target - start) * (n + 1) / self.substeps))
                    v += 0.5 * dt * after / self.mass
                    impulse += 0.5 * dt * (force + after)
                w, mean = target, -impulse / self.interval_s
                self.z.append(z)
            out.write(struct.pack("<qqqd", -1, 0, 0, 0.0))
            assert struct.unpack("<qddd", answers.read(32))[0] == -1


def test_a_fake_engine_and_the_plate_swing_as_two_masses(tmp_path):
    """Lasting contact: mass and plate on springs, against the matrix exponential, to 1e-4 over several periods."""
    count, interval = 2000, 1e-5
    motion = ModalMotion(one_mode(), interval)
    pipes = PlatePipes(tmp_path, 1, timeout_s=20)
    engine = FakeEngine(tmp_path, mass=0.3, stiffness=1e6, co_steps=count, interval_s=interval)
    engine.start()
    pipes.open(lambda: True)
    PlateParticipant(motion, steps(10 * count), lambda *row: None).run(pipes)
    pipes.close()
    engine.join(5)
    omega2 = (2 * np.pi * FREQUENCY_Hz) ** 2
    m, k = 0.3, 1e6
    matrix = np.array([[0, 1, 0, 0], [-k / m, 0, k / m, 0], [0, 0, 0, 1], [k, 0, -omega2 - k, 0]])
    state, turn, exact = np.array([0, -1.0, 0, 0]), expm(matrix * interval), []
    for _ in range(count):
        state = turn @ state
        exact.append(state[0])
    error = np.abs(np.array(engine.z) - exact).max() / np.abs(exact).max()
    assert error < 2e-3, error


@pytest.mark.parametrize(("asked", "trend"), [(10, 1 / 10), (2, 0.0)])
def test_a_force_goes_on_with_its_trend_but_not_across_free_flight(asked, trend):
    """No force over ten co-steps, then a mean of 1 N kg^-1/2 over the next ten. Had the engine asked for these ten, the mean of
    the four after them is taken to lie on the line through both means, seven co-steps on; after a flight there is no line."""
    motion, answered = ModalMotion(one_mode(), 1e-5), []
    messages = iter([*(ForceMessage(step, count, ahead, np.array([force])) for step, count, ahead, force in (
        (0, 0, 10, 0.0), (100, 10, asked, 0.0), (200, 10, 4, 1.0))), FinishedMessage()])
    pipes = SimpleNamespace(receive=lambda: next(messages), confirm=lambda message: None,
                            answer=lambda step, reach, amplitude, rate: answered.append(amplitude[0]))
    PlateParticipant(motion, steps(200), lambda *row: None).run(pipes)
    w = 2 * np.pi * FREQUENCY_Hz
    first, both = (1 - np.cos(w * count * 1e-5) for count in (4, 14))  # by a constant force from rest, times w^2
    assert answered[-1] == pytest.approx((both + 7 * trend * first) / w**2, rel=1e-9, abs=0)


def opened(directory, alive=lambda: True, timeout_s=1.0):
    """The plate's end open, and the engine's end in the hand of the test."""
    pipes = PlatePipes(directory, 1, timeout_s=timeout_s)
    ends = []

    def other_side():
        ends.append(os.open(directory / "to_plate", os.O_WRONLY))
        ends.append(os.open(directory / "from_plate", os.O_RDONLY))

    thread = threading.Thread(target=other_side, daemon=True)
    thread.start()
    pipes.open(alive)
    thread.join(5)
    return pipes, ends


def test_an_engine_that_died_is_seen_at_once(tmp_path):
    living = [True]
    pipes, ends = opened(tmp_path, lambda: living[0], timeout_s=60)
    living[0] = False
    os.close(ends[0])
    start = time.monotonic()
    with pytest.raises(CouplingError, match="the engine ended before the plate did"):
        pipes.receive()
    assert time.monotonic() - start < 5
    pipes.close()


def test_a_stuck_engine_is_given_up(tmp_path):
    pipes, _ = opened(tmp_path, timeout_s=0.5)
    with pytest.raises(CouplingError, match="said nothing for 0.5 s"):
        pipes.receive()
    pipes.close()


def test_a_force_that_is_no_number_is_refused(tmp_path):
    pipes, ends = opened(tmp_path)
    os.write(ends[0], struct.pack("<qqqd", 7, 1, 1, float("nan")))
    with pytest.raises(CouplingError, match="no number at step 7"):
        pipes.receive()
    pipes.close()


@pytest.mark.parametrize("step, co_steps", [(10, 2), (21, 2), (40, 4)])
def test_an_engine_at_another_step_than_its_co_steps_make_is_refused(tmp_path, step, co_steps):
    """Of a run of 30 steps, co-steps of 10."""
    pipes, ends = opened(tmp_path)
    for message in ((0, 0, 1, 0.0), (step, co_steps, 1, 0.0)):
        os.write(ends[0], struct.pack("<qqqd", *message))
    with pytest.raises(CouplingError, match=f"the engine sent step {step} after {co_steps} co-steps from step 0"):
        PlateParticipant(ModalMotion(one_mode(), 1e-5), steps(30), lambda *row: None).run(pipes)
    pipes.close()


@pytest.mark.parametrize("reach, amplitude, rate", [(np.nan, 0, 0), (-1, 0, 0), (0, np.inf, 0), (0, 0, np.nan)])
def test_a_plate_that_moves_by_no_number_tells_itself(tmp_path, reach, amplitude, rate):
    """The engine would take its numbers for an unstable step of its own."""
    pipes, _ = opened(tmp_path)
    with pytest.raises(CouplingError, match="the plate's motion at step 7 is no number"):
        pipes.answer(7, reach, np.array([amplitude]), np.array([rate]))
    pipes.close()


def test_an_engine_that_reads_no_more_is_seen(tmp_path):
    pipes, ends = opened(tmp_path)
    os.close(ends[1])
    with pytest.raises(CouplingError, match="does not read any more"):
        pipes.answer(0, 0.0, np.zeros(1), np.zeros(1))
    pipes.close()


def test_the_engine_waits_until_the_plate_knows_of_the_end(tmp_path):
    """The real engine against a plate of another program, which stands still and is slow."""
    scene = changed("elastic_plate", {"plate.max_frequency_Hz": 500.0})
    model = prepare(scene, "scene", user_cache())
    write_deck(tmp_path / "deck", scene, model.assembly, model.step, model.modes)
    n, names = len(model.modes.frequency_Hz), [tmp_path / "deck" / name for name in ("to_plate", "from_plate")]
    for name in names:
        os.mkfifo(name)
    engine = subprocess.Popen([str(ENGINE), "-in", "deck.liggghts"], cwd=tmp_path / "deck", stdin=subprocess.DEVNULL,
                              stdout=subprocess.DEVNULL)
    with open(names[0], "rb", buffering=0) as read, open(names[1], "wb", buffering=0) as write:
        step = None
        while step != -1:
            if step is not None:
                write.write(struct.pack("<qd", step, 0.0) + bytes(16 * n))
            step = struct.unpack("<q", read.read(24 + 8 * n)[:8])[0]
        with pytest.raises(subprocess.TimeoutExpired):
            engine.wait(timeout=1)
        write.write(struct.pack("<qd", -1, 0.0) + bytes(16 * n))
        assert engine.wait(timeout=60) == 0


@pytest.mark.parametrize("plate, words", [
    ("dies", "The plate does not answer any more"), ("answers another step", "The plate answered another step"),
    ("reach", "The plate answered step 0 with a wrong reach_m"), ("below", "with a wrong reach_m"),
    ("amplitude", "with a wrong amplitude"), ("rate", "with a wrong rate")])
def test_the_engine_ends_with_a_clear_error_when_the_plate_fails(tmp_path, plate, words):
    """The real engine against a fake plate that fails at the first record."""
    scene = changed("elastic_plate", {"plate.max_frequency_Hz": 500.0})
    model = prepare(scene, "scene", user_cache())
    write_deck(tmp_path / "deck", scene, model.assembly, model.step, model.modes)
    n = len(model.modes.frequency_Hz)
    for name in ("to_plate", "from_plate"):
        os.mkfifo(tmp_path / "deck" / name)
    engine = subprocess.Popen([str(ENGINE), "-in", "deck.liggghts"], cwd=tmp_path / "deck", stdin=subprocess.DEVNULL,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace")
    names = [tmp_path / "deck" / name for name in ("to_plate", "from_plate")]
    with open(names[0], "rb", buffering=0) as read, open(names[1], "wb", buffering=0) as write:
        read.read(24 + 8 * n)
        answer = struct.pack("<qd", 99 if "step" in plate else 0, {"reach": np.nan, "below": -1.0}.get(plate, 0.0))
        numbers = np.zeros(2 * n)
        numbers[0 if plate == "amplitude" else -1] = np.nan if plate in ("amplitude", "rate") else 0.0
        if plate != "dies":
            write.write(answer + numbers.tobytes())
    output, _ = engine.communicate(timeout=20)
    assert engine.returncode != 0
    assert words in output


def test_an_engine_that_gets_microseconds_at_a_time_is_not_stuck(monkeypatch):
    """As ranks do that leave the processor to others: too little for a tick of the kernel."""
    monkeypatch.setattr(dem.coupling.pipes, "STUCK_s", 0.3)
    for line, stuck in (("while read -t 0.05; [ $? -gt 128 ]; do :; done", False), ("read", True)):
        with subprocess.Popen(["bash", "-c", line], stdin=subprocess.PIPE) as engine:
            time.sleep(0.3)  # bash has started
            watchdog, deadline, said = EngineWatchdog(engine), time.monotonic() + 2, ""
            try:
                while time.monotonic() < deadline:
                    assert watchdog()
                    time.sleep(0.1)
            except CouplingError as error:
                said = str(error)
            engine.kill()
            assert ("is stuck: no processor time" in said) == stuck


class StoppedRun:
    """A run of which one side, `engine` or `plate`, is stopped as soon as the engine has set up; `noticed_s` is the time
    after which the other side tells."""

    def __init__(self, directory, side):
        scene = directory / "scene.toml"
        text = (SCENES / "elastic_plate.toml").read_text()
        assert "max_frequency_Hz = 20000.0" in text
        directory.mkdir()
        scene.write_text(text.replace("max_frequency_Hz = 20000.0", "max_frequency_Hz = 500.0"))
        self.run = subprocess.Popen([sys.executable, "-m", "dem", "run", str(scene), "--out", str(directory / "run")],
                                    cwd=SCENES.parent, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                    stderr=subprocess.PIPE, text=True)
        self.side, self.output = side, directory / "run.partial" / "deck" / "engine.out"
        self.engine = self.start = self.noticed_s = None

    def said(self):
        return self.output.read_text(errors="replace") if self.output.exists() else ""

    def watch(self):
        """Stop the side if it is time, and see whether the other one has noticed."""
        if self.start is None:
            assert self.run.poll() is None
            if "Setting up run" in self.said():
                pid = self.run.pid
                self.engine = int(Path(f"/proc/{pid}/task/{pid}/children").read_text().split()[0])
                os.kill(self.engine if self.side == "engine" else pid, signal.SIGSTOP)
                self.start = time.monotonic()
        elif self.noticed_s is None:
            waited_s = time.monotonic() - self.start
            assert waited_s < 60
            if self.run.poll() is not None if self.side == "engine" else "ERROR" in self.said():
                self.noticed_s = waited_s


@pytest.mark.slow
def test_a_side_that_is_stopped_ends_the_run_within_seconds(tmp_path):
    """SIGSTOP: the process lives, its pipes are open, and it says nothing. The other one sees that it uses no time.
    Both sides are tried at once, since all this is waiting."""
    engine, plate = runs = [StoppedRun(tmp_path / side, side) for side in ("engine", "plate")]
    while any(one.noticed_s is None for one in runs):
        for one in runs:
            one.watch()
        time.sleep(0.002)
    assert engine.run.returncode == 1
    assert f"the engine (process {engine.engine}) is stopped by a signal" in engine.run.stderr.read().splitlines()[-1]
    assert f"The plate (process {plate.run.pid}) is stopped by a signal" in plate.said()
    plate.run.kill()
    for one in runs:
        one.run.communicate()
    assert all(9 < one.noticed_s < 40 for one in runs)
