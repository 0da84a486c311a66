"""Engine and plate together where theory or an independent integration knows the answer."""

import os
import re
import socket
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from scenes_of_tests import changed
from scipy.integrate import solve_ivp

import dem.deck.render
import dem.run.participants
from common.files.cache import user_cache
from common.resources import resource
from dem.coupling.launch import ENGINE
from dem.coupling.pipes import PlatePipes
from dem.deck.render import write_deck
from dem.run.prepare import prepare
from dem.run.results import read_forces
from dem.run.run import run_prepared, run_scene
from plate_fem.modes import PlateModes, plate_modes

STEEL = {"density_kg_m3": 7833.0, "youngs_modulus_Pa": 206.8e9, "poisson_ratio": 0.28}


class CentreModes(PlateModes):
    """Given to the engine on a patch around the centre alone, where the ball hits and stays."""

    @property
    def largest_shape(self):
        return np.full(len(self.frequency_Hz), 2 / np.sqrt(self.mass_kg))

    def grid(self, spacing_m):
        axis = self.lines_x_m[-1] * 1e-4 * np.arange(-4, 5)
        return axis, axis

    def shapes_at(self, points_m):
        yield np.ones((len(points_m), 1)) * self.nodal[0, len(self.nodal[0]) // 2]


def navier_modes(length, thickness, material, max_frequency_Hz):
    """Exact Kirchhoff modes of a simply supported square plate, in place of the finite-element ones; those with a node
    at the centre are left out, as a force there does not move them."""
    rho, young, nu = material.values()
    rigidity = young * thickness**3 / (12 * (1 - nu**2))
    scale = np.sqrt(rigidity / (rho * thickness))
    limit = 2 * np.pi * max_frequency_Hz / scale / (np.pi / length) ** 2
    odd = np.arange(1, int(np.sqrt(limit)) + 1, 2)
    m, n = (v.ravel() for v in np.meshgrid(odd, odd, indexing="ij"))
    order = np.argsort(m**2 + n**2, kind="stable")
    order = order[(m**2 + n**2)[order] <= limit]
    m, n = m[order] * np.pi / length, n[order] * np.pi / length
    mass, count = rho * thickness * length**2, len(order)
    size = 2 / np.sqrt(mass)
    lines = np.array([-length / 2, 0, length / 2])
    x, y = (v.ravel()[:, None] + length / 2 for v in np.meshgrid(lines, lines, indexing="ij"))
    sx, cx, sy, cy = np.sin(m * x), np.cos(m * x), np.sin(n * y), np.cos(n * y)
    return CentreModes(
        frequency_Hz=scale * (m**2 + n**2) / (2 * np.pi), damping_ratio=np.zeros(count), lines_x_m=lines,
        lines_y_m=lines, nodal=size * np.array([sx * sy, m * cx * sy, n * sx * cy, m * n * cx * cy]),
        mean_shape=size * 4 / (m * n * length**2), rod_force=np.zeros((0, count)),
        surface_stress=np.zeros((9, 3, count)), mass_kg=mass, theory="kirchhoff", n_residual=0)


def ball_on_plate(tmp_path, radius, thickness, length, speed, duration, max_frequency_Hz):
    """A steel ball in the middle of a simply supported steel plate: (summary, fast stream)."""
    scene = changed("elastic_plate", {
        "materials.gangue": STEEL, "stones.radius_m": radius, "stones.speed_m_s": speed, "stones.gap_m": 1e-7,
        "stones.positions_m": [[0.0, 0.0]], "time.duration_s": duration,
        "time.sample_interval_s": duration / 10, "time.view_interval_s": None, "plate.rods": None, "plate.sensors": None,
        **{f"plate.{key}": value for key, value in STEEL.items()}, "plate.damping_ratio": 0.0,
        "plate.edges": "simply_supported", "plate.size_m": [length, length],
        "plate.thickness_m": thickness, "plate.max_frequency_Hz": 2000.0})
    model = prepare(scene, "ball", user_cache())
    model.modes = navier_modes(length, thickness, STEEL, max_frequency_Hz)
    summary = run_prepared(model, tmp_path / "run")
    return summary, pd.read_parquet(tmp_path / "run" / "fast.parquet")


def test_karas_plate(tmp_path):
    """Steel ball R 10 mm at 1 m/s on 200 x 200 x 8 mm (Karas 1939): peak force, its time, contact time, rebound."""
    summary, fast = ball_on_plate(tmp_path, 0.010, 0.008, 0.2, 1.0, 100e-6, 400e3)
    force, t = fast["force_N"].to_numpy(), fast["t_s"].to_numpy() - 0.5 * fast["t_s"][1] - 1e-7
    assert summary["peak_force_N"] == pytest.approx(1378.3, rel=2e-3)
    top = force.argmax()
    bend = np.polyfit(t[top - 5:top + 6] - t[top], force[top - 5:top + 6], 2)
    assert t[top] - bend[1] / (2 * bend[0]) == pytest.approx(32.9e-6, rel=5e-3)
    contact = np.flatnonzero(force)
    assert (contact[-1] - contact[0] + 1) * fast["t_s"][1] == pytest.approx(73.4e-6, rel=1e-2)
    assert summary["rebound_speed_m_s"][0] == pytest.approx(0.664, rel=2e-3)


# lambda, restitution, peak force F T/(m v) where given (C. Zener, Phys. Rev. 59 (1941) 669).
ZENER = [(0.05, 0.9178, None), (0.1, 0.8433, 1.0355), (0.3, 0.6060, 0.8706), (0.5, 0.4369, 0.7502),
         (1.0, 0.1841, 0.5562)]


@pytest.mark.parametrize("inelasticity, restitution, peak", ZENER)
def test_zener_sphere_on_a_large_plate(tmp_path, inelasticity, restitution, peak):
    """A plate so large that no wave returns before the ball has left: restitution 1 %, peak force 0.5 %."""
    radius, speed = 0.01, 1.0
    rho, young, nu = STEEL.values()
    mass = rho * 4 / 3 * np.pi * radius**3
    stiffness = 2 / 3 * np.sqrt(radius) * young / (1 - nu**2)
    time = (mass**2 / (stiffness**2 * speed)) ** 0.2  # Zener's unit of time
    # lambda = m^(3/5) K^(2/5) v^(1/5)/(8 sqrt(rho h D)) gives the thickness.
    thickness = np.sqrt(mass**0.6 * stiffness**0.4 * speed**0.2 / (8 * inelasticity)
                        / (rho * np.sqrt(young / (12 * (1 - nu**2) * rho))))
    duration = (3.6 + 2.5 * inelasticity) * time
    scale = np.sqrt(young * thickness**2 / (12 * (1 - nu**2) * rho))
    # A bending wave of angular frequency omega travels at 2 sqrt(omega scale); there and back within the contact for
    # omega = 20/time, above which the impact holds next to nothing.
    length = 2 * np.sqrt(20 / time * scale) * duration
    summary, _ = ball_on_plate(tmp_path, radius, thickness, length, speed, duration, 100 / (2 * np.pi * time))
    assert summary["rebound_speed_m_s"][0] / speed == pytest.approx(restitution, abs=1e-2 * restitution)
    if peak is not None:
        assert summary["peak_force_N"] * time / (mass * speed) == pytest.approx(peak, rel=5e-3)


def ring():
    """Places of the paper's ten stones (10, 2), m."""
    angle = 2 * np.pi * np.arange(10) / 10
    return 0.1 * np.column_stack([np.cos(angle), np.sin(angle)])


@pytest.fixture(scope="module")
def ten_spheres(runs):
    """The paper's ten stones at 50 %, unbonded and without dissipation: (scene, modes, summary, fast stream)."""
    scene = changed("paper", {
        "stones.agglomerate": None, "time.duration_s": 1.5e-3, "time.gravity_m_s2": None, "time.view_interval_s": None,
        **{f"contacts.{k}_plate": {"restitution": 1.0, "friction": 0.0} for k in ("coal", "gangue")}})
    summary = run_scene(scene, "ten spheres", runs / "ten")
    return scene, plate_modes(scene.plate, user_cache(), ring()), summary, pd.read_parquet(runs / "ten" / "fast.parquet")


def test_ten_elastic_spheres_at_once(ten_spheres):
    """Total force and plate velocity within 0.1 % (L2) of DOP853 with the same modes."""
    scene, modes, summary, fast = ten_spheres
    phi = modes.shape_at(ring())
    omega, n = 2 * np.pi * modes.frequency_Hz, len(modes.frequency_Hz)
    radius, plate = scene.stones.radius_m, scene.plate
    material = [scene.materials[name] for name in summary["materials"]]
    mass = np.array([m.density_kg_m3 for m in material]) * 4 / 3 * np.pi * radius**3
    k = np.array([4 / 3 * np.sqrt(radius) / ((1 - m.poisson_ratio**2) / m.youngs_modulus_Pa
                                             + (1 - plate.poisson_ratio**2) / plate.youngs_modulus_Pa)
                  for m in material])

    def rates(t, y):
        z, v, a, da = y[:10], y[10:20], y[20:20 + n], y[20 + n:20 + 2 * n]
        force = k * np.maximum(0, radius - z + phi @ a) ** 1.5
        dda = -force @ phi - 2 * modes.damping_ratio * omega * da - omega**2 * a
        return np.concatenate([v, force / mass, da, dda, [force.sum()]])

    start = np.zeros(21 + 2 * n)
    start[:10], start[10:20] = radius + scene.stones.gap_m, -scene.stones.speed_m_s
    times = fast["t_s"].to_numpy()
    y = solve_ivp(rates, (0, times[-1]), start, method="DOP853", rtol=1e-11, atol=1e-15, t_eval=times,
                  max_step=2e-6).y
    force = np.diff(y[-1], prepend=0) / np.diff(times, prepend=-np.inf)
    for name, expected in (("force_N", force), ("v_m_s", modes.mean_shape @ y[20 + n:20 + 2 * n])):
        error = np.linalg.norm(fast[name] - expected) / np.linalg.norm(expected)
        assert error < 1e-3, f"{name}: {error:.2e}"


@pytest.mark.slow
def test_the_scheme_is_of_second_order_in_the_co_step(runs):
    """Error of the plate's velocity against the smallest co-step: slope 2 in the co-step. So for the work that the
    contacts do on the wall, which goes where the plate is predicted, against that of the modal forces on the plate."""
    velocity, length, missing = {}, {}, {}
    for co_step in (1, 12, 24, 48):
        scene = changed("elastic_plate", {"time.time_step_s": 1e-7, "time.co_step": co_step})
        directory = runs / f"co_step_{co_step}"
        summary = run_scene(scene, "co-step", directory)
        length[co_step] = co_step * summary["dt_s"]
        missing[co_step] = summary["energy"]["given_to_plate_J"] / summary["energy"]["plate_work_J"] - 1
        velocity[co_step] = pd.read_parquet(directory / "signals.parquet")["v_m_s"].to_numpy()
    compared = (12, 24, 48)
    errors = [np.linalg.norm(velocity[s] - velocity[1]) for s in compared]
    slope = np.polyfit(np.log([length[s] for s in compared]), np.log(errors), 1)[0]
    assert 1.9 < slope < 2.1, f"{slope:.2f}, errors {errors}"
    assert abs(missing[1]) < 1e-6
    slope = np.polyfit(np.log([length[s] for s in compared]), np.log([abs(missing[s]) for s in compared]), 1)[0]
    assert 1.8 < slope < 2.2, f"{slope:.2f}, {missing}"


def with_weak_contact(monkeypatch, numbers):
    """Decks have this `weak_contact`."""
    render = dem.deck.render.render

    def changed_deck(*given):
        text = re.sub("weak_contact" + 4 * r" \S+", "", render(*given))
        place = text.index("contact model", text.index("wall/plate"))
        return f"{text[:place]}weak_contact {numbers} {text[place:]}"

    monkeypatch.setattr(dem.deck.render, "render", changed_deck)


@pytest.mark.slow
def test_a_stone_that_another_strikes_just_above_the_plate_is_felt(tmp_path, monkeypatch):
    """Messages are rare, as they are where chips lie, which the large stone does here. The lower of two small stones comes
    40 um above the plate at a hundredth of the speed of the upper one, which gives it its own: whenever between two
    messages it touches, the plate gets the same impulse as by messages that are not rare."""
    def impulse_N_s(number, touch_s):
        small = {"material": "gangue", "radius_m": 0.003, "place_m": [0.1, 0.03]}
        scene = changed("elastic_plate", {
            **dict.fromkeys([f"stones.{name}" for name in ("count", "radius_m", "positions_m", "speed_m_s", "gangue_order",
                                                          "gangue_ratio")]),
            "stones.each": [{"material": "gangue", "radius_m": 0.025, "place_m": [-0.1, 0.0], "velocity_m_s": 0.05},
                            small | {"velocity_m_s": 0.05, "arrival_s": touch_s + 4e-5 / 0.05},
                            small | {"velocity_m_s": 5.0, "arrival_s": touch_s + 6.04e-3 / 5}],
            "stones.gap_m": 1e-7, "time.duration_s": 2.25e-4, "time.sample_interval_s": 4.5e-5, "time.view_interval_s": None,
            "time.free_flight_tolerance": 0.0, "contacts.gangue_gangue": {"restitution": 1.0, "friction": 0.0}})
        run_scene(scene, "struck", tmp_path / str(number))
        return pd.read_parquet(tmp_path / str(number) / "stones.parquet")["impulse_N_s"][1]

    expected = impulse_N_s("often", 1.1e-4)
    with_weak_contact(monkeypatch, "1e9 1e9 64 64")
    found = [impulse_N_s(k, 1e-4 + 5e-6 * k) for k in range(4)]
    assert found == pytest.approx([expected] * 4, rel=2e-3)


@pytest.mark.slow
def test_a_stone_that_comes_out_of_free_flight_finds_messages_frequent(tmp_path, monkeypatch):
    """They are rare while a stone pushes weakly. Whenever between two of them another one strikes, work given is work
    taken."""
    with_weak_contact(monkeypatch, "1e9 0.05 32 32")
    for k in range(4):
        scene = changed("elastic_plate", {
            **dict.fromkeys([f"stones.{name}" for name in ("count", "radius_m", "positions_m", "speed_m_s", "gangue_order",
                                                          "gangue_ratio")]),
            "stones.each": [{"material": "gangue", "radius_m": 0.025, "place_m": [-0.1, 0.0], "velocity_m_s": 0.05},
                            {"material": "gangue", "radius_m": 0.01, "place_m": [0.1, 0.03], "velocity_m_s": 3.0,
                             "arrival_s": 1.5e-4 + 5e-6 * k}],
            "stones.gap_m": 1e-7, "time.duration_s": 3e-4, "time.view_interval_s": None,
            "contacts.gangue_gangue": {"restitution": 1.0, "friction": 0.0}})
        energy = run_scene(scene, "weak", tmp_path / str(k))["energy"]
        assert energy["given_to_plate_J"] == pytest.approx(energy["plate_work_J"], rel=3e-3)


@pytest.mark.slow
def test_the_co_step_of_a_bonded_stone_is_short_enough(runs):
    """A stone that does not break, at the default co-step and at every step: a tenth of the 1 % that a default may be
    off in force, plate velocity and energy."""
    found = {}
    for co_step in (None, 1):
        scene = changed("single", {"stones.agglomerate": {"subspheres": 500, "contact": "sub_spheres", "unbreakable": True}, "time.view_interval_s": None,
                                   "stones.gangue_ratio": 1.0, "time.duration_s": 1.2e-3}
                        | ({} if co_step is None else {"time.co_step": co_step}))
        directory = runs / f"bonded_{co_step}"
        summary = run_scene(scene, "co-step", directory)
        found[co_step] = (summary["co_step"], summary["dt_s"], pd.read_parquet(directory / "fast.parquet"))
    assert found[None][0] > 1 and found[None][1] == found[1][1]
    for name in ("force_N", "v_m_s", "total_J"):
        every, default = (found[k][2][name].to_numpy() for k in (1, None))
        error = np.linalg.norm(default - every) / np.linalg.norm(every)
        assert error < 1e-3, f"{name}: {error:.1e}"


@pytest.mark.slow
@pytest.mark.parametrize("case, changes", [
    ("a stone laid on the plate", {"time.duration_s": 0.02, "stones.speed_m_s": 0.0, "stones.gap_m": 1e-7}),
    ("a heavy sphere on a thin plate", {"time.duration_s": 0.008, "stones.speed_m_s": 0.5, "plate.thickness_m": 0.002,
                                        "plate.max_frequency_Hz": 3000.0, "materials.gangue.density_kg_m3": 20000.0}),
])
def test_lasting_contact_stays_stable(runs, case, changes):
    """Under gravity the sphere stays on the plate; nothing but the fall supplies energy."""
    scene = changed("elastic_plate", {
        "time.gravity_m_s2": 9.8, "plate.damping_ratio": 0.02,
        "contacts.gangue_plate": {"restitution": 0.5, "friction": 0.0}} | changes)
    directory = runs / case.replace(" ", "_")
    summary = run_scene(scene, case, directory)
    fast = pd.read_parquet(directory / "fast.parquet")
    potential = pd.read_parquet(directory / "energy.parquet")["potential_J"]
    assert fast["total_J"].max() <= 1.001 * (summary["energy"]["impact_J"] - potential.min())
    if scene.stones.speed_m_s == 0:
        mass = 4 / 3 * np.pi * 0.025**3 * 2400
        assert fast["force_N"][fast["t_s"] > 0.01].mean() == pytest.approx(mass * 9.8, rel=0.05)
    else:
        assert abs(summary["energy"]["closure"]) < 1e-2


@pytest.mark.slow
def test_chips_need_the_plate_seldom(runs, monkeypatch):
    """While chips hop, after the impact, one message serves several co-steps: fewer messages, and the same motion, as with
    one a co-step."""
    received = []

    class CountedPipes(PlatePipes):
        def receive(self):
            message = super().receive()
            received[-1].append(getattr(message, "step", 0))
            return message

    monkeypatch.setattr(dem.run.participants, "PlatePipes", CountedPipes)
    scene = {"stones.agglomerate.subspheres": 200, "time.view_interval_s": None, "time.duration_s": 0.02,
             "stones.speed_m_s": 3.5, "materials.coal.bond.fracture_energy_J_m2": None}  # bonds that snap make chips
    found = []
    for name in ("seldom", "often"):
        received.append([])
        directory = runs / f"chips_{name}"
        summary = run_scene(changed("single", scene), "chips", directory)
        scene["time.co_step"] = summary["co_step"]  # one that is told has a message each
        assert summary["n_bonds_broken"] > 50
        found.append((summary["n_bonds_broken"], pd.read_parquet(directory / "fast.parquet")))
        received[-1] = sum(step * summary["dt_s"] > 1e-3 for step in received[-1])
    assert received[0] < 0.75 * received[1]
    assert found[0][0] == found[1][0]
    for name in ("force_N", "v_m_s", "a_m_s2", "total_J"):
        seldom, often = (fast[name].to_numpy() for _, fast in found)
        assert np.linalg.norm(seldom - often) < 1e-3 * np.linalg.norm(often), name


@pytest.mark.slow
@pytest.mark.parametrize("thickness_m", [0.001, 0.002])
def test_a_plate_that_gives_way_by_millimetres_keeps_energy_and_momentum(runs, thickness_m):
    """It comes to reach beyond the sub-spheres that were listed, in the middle of a contact: nothing of the work and of the
    force at that step is lost."""
    scene = changed("elastic_plate", {"stones.speed_m_s": 3.0, "time.duration_s": 2e-3, "time.gravity_m_s2": 0.0,
                                      "plate.thickness_m": thickness_m, "plate.max_frequency_Hz": 1000.0})
    summary = run_scene(scene, "thin", runs / f"thin_{thickness_m}")
    assert abs(summary["energy"]["closure"]) < 1e-4
    assert summary["impulse_N_s"] == pytest.approx(summary["momentum_change_kg_m_s"], rel=1e-6)


def shipped_participant(tmp_path, thinks_s=0.0, plate_process=""):
    """The prepared run, and the end of the engine that was started by hand beside templates/participant.py, which moves
    in the frequencies of an undamped plate, once thinks so long, and answers."""
    scene = changed("small", {"plate.damping_ratio": 0.0, "plate.max_frequency_Hz": 800.0, "time.duration_s": 1e-3,
                              "stones.agglomerate": None, "time.view_interval_s": None, "plate.sensors": []})
    prepared = prepare(scene, "small.toml", user_cache())
    write_deck(tmp_path / "deck", prepared.scene, prepared.assembly, prepared.step, prepared.modes)
    program = resource("templates/participant.py").read_text()
    assert "    step = 0\n" in program
    slow = program.replace("import sys", "import sys, time").replace("    step = 0\n", f"    step = 0\n    time.sleep({thinks_s})\n")
    (tmp_path / "slow.py").write_text(slow)
    given = [str(tmp_path / "deck"), repr(prepared.step.co_step * prepared.step.dt_s),
             *(repr(float(hz)) for hz in prepared.modes.frequency_Hz)]
    with subprocess.Popen([sys.executable, tmp_path / "slow.py", *given], stderr=subprocess.DEVNULL) as plate:
        while not (tmp_path / "deck" / "from_plate").exists():
            assert plate.poll() is None
        environment = {name: value for name, value in os.environ.items() if name != "PLATE_PROCESS"}
        if plate_process:
            environment["PLATE_PROCESS"] = plate_process.format(host=socket.gethostname(), pid=plate.pid)
        # The library may print bytes that are no UTF-8.
        engine = subprocess.run([ENGINE, "-in", "deck.liggghts"], cwd=tmp_path / "deck", env=environment, check=False,
                                timeout=120, capture_output=True, text=True, errors="replace")
        if engine.returncode:
            plate.kill()
        else:
            assert plate.wait(timeout=10) == 0
    return prepared, engine


@pytest.mark.slow
def test_the_shipped_participant_moves_as_the_plate_does(tmp_path):
    """The same pushes on the stones."""
    prepared, engine = shipped_participant(tmp_path)
    assert engine.returncode == 0
    run_prepared(prepared, tmp_path / "run")
    ours = pd.read_parquet(tmp_path / "run" / "fast.parquet")["force_N"].to_numpy()
    pushes, theirs = read_forces(tmp_path / "deck" / "forces.bin"), np.zeros(len(ours))
    theirs[pushes.all_step // prepared.step.fast_steps] = pushes.all_mean_N
    assert theirs == pytest.approx(ours, abs=1e-6 * ours.max()) and ours.max() > 1000


@pytest.mark.parametrize("thinks_s, plate_process, stuck", [
    (3.0, "{host} {pid} 1", True), (3.0, "{host} {pid} 30", False),
    pytest.param(13.0, "{host} {pid}", True, marks=pytest.mark.validate),
    pytest.param(13.0, "{host} {pid} 60", False, marks=pytest.mark.validate),
    pytest.param(13.0, "", False, marks=pytest.mark.validate)])
def test_who_starts_the_engine_says_how_long_the_plate_may_think(tmp_path, thinks_s, plate_process, stuck):
    _, engine = shipped_participant(tmp_path, thinks_s, plate_process)
    assert (engine.returncode != 0) == stuck
    limit_s = plate_process.split()[2] if plate_process.count(" ") == 2 else "10"
    assert (f"is stuck: no processor time in {limit_s} s" in engine.stdout + engine.stderr) == stuck
