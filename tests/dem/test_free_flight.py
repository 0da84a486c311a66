"""Bodies out of the force loops: what a jump keeps, and brute force beside it. docs/free_flight.md."""

import re

import numpy as np
import pandas as pd
import pytest
from decks import FREE_FLIGHT, Body, bond_line, chain, deck, fcc_ball, frames, ledger, run_engine, write_files
from scenes_of_tests import changed
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from dem.run.results import read_forces
from dem.run.run import run_scene

GRAVITY = 9.8
DT = 2e-7
FREE = f"fix free_flight all {FREE_FLIGHT} agglomerates agglomerates.txt gravity {GRAVITY} speed 3 tolerance {{}} every 50 unheld unheld\n"
WEIGHT = f"fix gravity unheld gravity {GRAVITY} vector 0 0 -1\n"
PLATE = ("fix plate all wall/plate agglomerates agglomerates.txt forces forces.bin extent -1 1 -1 1 co_step 1 "
         "contact model hertz tangential history primitive type 2 zplane 0.0\n")


def bracket():
    """Five sub-spheres in a bent row with a branch: three different principal moments."""
    center = 2e-3 * np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [1, 0, 1.0]])
    pair = np.array([[0, 1], [1, 2], [2, 3], [1, 4]])
    return Body(center, np.full(5, 0.9e-3), pair, np.full(4, 1e-3))


def moments(x, v, omega, mass, radius):
    """Momentum, angular momentum about the origin and kinetic energy of each frame."""
    own = (0.4 * mass * radius**2)[..., None]
    m = mass[..., None]
    return ((m * v).sum(axis=-2), (m * np.cross(x, v) + own * omega).sum(axis=-2),
            0.5 * (m * v**2 + own * omega**2).sum(axis=(-2, -1)))


def throw(body, omega, v):
    """Deck lines: the centre of each sub-sphere in rigid motion. None spins about itself, which is inner motion."""
    lines = ""
    for k, r in enumerate(body.center_m - np.average(body.center_m, axis=0, weights=body.mass_kg)):
        ux, uy, uz = (float(c) for c in v + np.cross(omega, r))
        lines += f"group one_{k} id {k + 1}\nvelocity one_{k} set {ux!r} {uy!r} {uz!r} units box\n"
    return lines


def test_all_bodies_may_leave_where_a_checkpoint_begins_anew(tmp_path):
    """The kernel's list is then to be made anew of nothing; an older one would name sub-spheres that are gone."""
    body = bracket()
    write_files(tmp_path, body)
    output = run_engine(tmp_path, deck(
        DT, 20_000, 10_000, bonds=bond_line(tension=1e6, shear=1e6, damping_time=1e-7), lines=WEIGHT + FREE.format(1)
        + "fix checkpoint all checkpoint every 50 directory checkpoint resume 0\n",
        velocity=throw(body, np.array([40.0, -250.0, 90.0]), np.array([0.5, 0.2, 2.0]))
        + "thermo 5000\nthermo_style custom step atoms\nthermo_modify lost ignore\n"))
    assert re.search(r"^ *5000 +0 *$", output, re.MULTILINE)  # step, sub-spheres in the arrays
    assert len((tmp_path / "events.csv").read_text().splitlines()) <= 1  # nothing broke


def halves():
    """Two cubes of 27 sub-spheres each, bonded in themselves: a stone that is cracked through the middle."""
    cube = 2e-3 * np.stack(np.meshgrid(*[np.arange(3.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    first, second = np.triu_indices(27, 1)
    near = np.linalg.norm(cube[first] - cube[second], axis=1) < 2.1e-3
    pair = np.column_stack([first, second])[near]
    return Body(np.vstack([cube, cube + [0, 0, 5.8002e-3]]), np.full(54, 0.9e-3), np.vstack([pair, pair + 27]),
                np.full(2 * len(pair), 1e-3))


@pytest.mark.parametrize("spin_rad_s, in_arrays", [(4, 0), (8, 54)])
def test_halves_of_a_stone_that_turn_slowly_fly_as_one(tmp_path, spin_rad_s, in_arrays):
    """Each could touch the other at any time. Free, they part at spin x 5.8 mm: 23 mm/s, which a tolerance of 1e-4 allows
    after an impact of 3 m/s, or 46 mm/s."""
    write_files(tmp_path, halves())
    turning = "".join(f"velocity all ramp v{along} {-way * 0.01 * spin_rad_s} {way * 0.01 * spin_rad_s} {across} {middle - 0.01} "
                      f"{middle + 0.01} sum yes units box\n" for along, way, across, middle in (
                          ("y", -1, "z", 4.9e-3), ("z", 1, "y", 2e-3)))
    output = run_engine(tmp_path, deck(
        DT, 5000, 5000, bonds=bond_line(damping_time=1e-7), lines=WEIGHT + FREE.format(1e-4),
        velocity="velocity all set 0.5 0.2 2 units box\n" + turning
        + "thermo 4990\nthermo_style custom step atoms\nthermo_modify lost ignore\n"))
    assert re.search(rf"^ *4990 +{in_arrays} *$", output, re.MULTILINE)


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """A bracket thrown with a spin about none of its axes, 0.1 s of flight, out of the force loops nearly from the start."""
    directory = tmp_path_factory.mktemp("flight")
    body = bracket()
    write_files(directory, body)
    output = run_engine(directory, deck(
        DT, 500_000, 10_000, bonds=bond_line(damping_time=1e-7), lines=WEIGHT + FREE.format(1),
        velocity=throw(body, np.array([40.0, -250.0, 90.0]), np.array([0.5, 0.2, 2.0]))
        + "thermo 5000\nthermo_style custom step atoms\nthermo_modify lost ignore\n"))
    return directory, output


def test_a_spinning_fragment_leaves_the_arrays(flight):
    _, output = flight
    rows = [line.split() for line in output.splitlines()]
    atoms = {int(row[0]): int(row[1]) for row in rows if len(row) == 2 and row[0].isdigit() and row[1].isdigit()}
    assert atoms[5000] == 0 and atoms[10_000] == 5  # shown at the step of a dump


def test_momentum_and_energy_are_kept_over_the_flight(flight):
    """To 1e-9 from the first frame in the air to the last: closed form of momentum, energy with its potential."""
    directory, _ = flight
    f = frames(directory)
    free = slice(1, None)
    t = f.step[free] * DT
    momentum, angular, kinetic = (q[free] for q in moments(f.x, f.v, f.omega, f.mass, f.radius))
    total = f.mass[0].sum()
    expected = momentum[0] + np.outer(t - t[0], [0, 0, -total * GRAVITY])
    assert np.abs(momentum - expected).max() < 1e-9 * np.abs(momentum).max()
    center = (f.mass[free, :, None] * f.x[free]).sum(axis=1) / total
    path = center[0] + np.outer(t - t[0], momentum[0] / total) - 0.5 * GRAVITY * np.outer((t - t[0]) ** 2, [0, 0, 1])
    assert np.abs(center - path).max() < 1e-9 * np.abs(path).max()
    own = angular - np.cross(center, momentum)
    assert np.abs(own - own[0]).max() < 1e-9 * np.abs(own).max()
    energy = kinetic + total * GRAVITY * center[:, 2]
    assert np.abs(energy - energy[0]).max() < 1e-9 * kinetic.max()
    rows = ledger(directory)
    late = rows.step >= f.step[1]
    sum_of_parts = sum(rows.column[name][late, 0] for name in ("kinetic_J", "bond_elastic_J"))
    sum_of_parts = sum_of_parts + GRAVITY * rows.column["mass_height_kg_m"][late, 0]
    assert np.abs(np.diff(sum_of_parts)).max() < 1e-9 * kinetic.max()
    assert rows.column["kinetic_J"][late, 0] == pytest.approx(kinetic, rel=1e-9)


def test_attitude_follows_the_free_top(flight):
    """Against Euler's equations in the body's frame, integrated by DOP853."""
    directory, _ = flight
    f = frames(directory)
    first, last = 1, -1
    m, r = f.mass[first], f.radius[first]

    def arms(k):
        return f.x[k] - np.average(f.x[k], axis=0, weights=m)

    arm = arms(first)
    inertia = sum(mi * (a @ a * np.eye(3) - np.outer(a, a)) + 0.4 * mi * ri**2 * np.eye(3)
                  for mi, ri, a in zip(m, r, arm))
    velocity = f.v[first] - np.average(f.v[first], axis=0, weights=m)
    spin = np.linalg.solve(inertia, (m[:, None] * np.cross(arm, velocity)
                                     + 0.4 * (m * r**2)[:, None] * f.omega[first]).sum(axis=0))

    def rates(_, y):
        turned, w = y[:9].reshape(3, 3), y[9:]
        skew = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        return np.concatenate([(turned @ skew).ravel(), np.linalg.solve(inertia, -np.cross(w, inertia @ w))])

    time = (f.step[last] - f.step[first]) * DT
    end = solve_ivp(rates, (0, time), np.concatenate([np.eye(3).ravel(), spin]), method="DOP853", rtol=1e-12,
                    atol=1e-12).y[:, -1]
    expected = arm @ end[:9].reshape(3, 3).T
    assert np.abs(spin).max() * time > 15  # several turns
    assert np.abs(arms(last) - expected).max() < 1e-8 * np.abs(arm).max()


def test_a_spinning_body_comes_back_with_its_bonds_as_they_were(tmp_path):
    """At the end of a run all bodies come back, and the next run goes on with them: no energy is gained."""
    body = bracket()
    write_files(tmp_path, body)
    end = 4000
    run_engine(tmp_path, deck(
        DT, end, 1, bonds=bond_line(damping_time=1e-7), lines=WEIGHT + FREE.format(1),
        velocity=throw(body, np.array([40.0, -1000.0, 90.0]), np.array([0.5, 0.2, 2.0])) + "thermo_modify lost ignore\n")
        + "run 10\n")
    rows = ledger(tmp_path)
    kinetic, bonds = (rows.column[name][:, 0] for name in ("kinetic_J", "bond_elastic_J"))
    energy = kinetic + bonds + GRAVITY * rows.column["mass_height_kg_m"][:, 0]
    back = np.flatnonzero(rows.step == end + 1)[0]
    assert np.ptp(bonds[back - 100:back]) == 0  # it was away
    assert abs(bonds[back] - bonds[back - 1]) < 0.5 * bonds[back - 1]
    assert -1e-4 * kinetic[0] < energy[back] - energy[back - 1] <= 0


def test_a_body_that_comes_back_while_its_bond_bends_keeps_its_angular_momentum(tmp_path):
    """Two sub-spheres spin alike and move across their bond so that the whole has none. They leave while the bond bends,
    and come back above the plate: the torques of the bond turn both to the same side, forces take that away again."""
    body, spin, dip = chain(2), 1000.0, 1000.0 * 0.4 * 0.9e-3**2 / 1e-3
    body.center_m[:, 2] += 1.5e-3
    write_files(tmp_path, body)
    run_engine(tmp_path, deck(
        DT, 1200, 5, bonds=bond_line(), lines=WEIGHT + PLATE + FREE.format(1),
        velocity=f"set atom 1*2 vx 0 vy 0 omegay {spin}\nset atom 1 vz {-3 - dip!r}\nset atom 2 vz {-3 + dip!r}\n"
        "thermo_modify lost ignore\n"))
    f = frames(tmp_path)
    momentum, angular, _ = moments(f.x, f.v, f.omega, f.mass, f.radius)
    own = angular - np.cross(f.x.mean(axis=1), momentum)  # both have one mass
    touch = np.flatnonzero((f.x[:, :, 2] < f.radius).any(axis=1))[0]
    turned = np.diff(f.torque[:touch, 0, 1])
    assert np.count_nonzero(turned == 0) > 50 and turned[-2:].all()  # it was away, and is back
    assert np.abs(own[:touch]).max() < 1e-9 * 2 * spin * 0.4 * f.mass[0, 0] * 0.9e-3**2


def test_the_lists_leave_out_no_contact(tmp_path):
    """A ball strikes the plate aslant and breaks: the elastic energy of the contacts that the engine lists, with a skin
    of its own within bodies, is that of all pairs of sub-spheres that overlap."""
    body = fcc_ball(5)
    body.center_m[:, 2] += 1e-5 - (body.center_m[:, 2] - body.radius_m).min()
    write_files(tmp_path, body)
    text = deck(DT, 3000, 10, bonds=bond_line(tension=1e6, shear=1e6, damping_time=1e-7),
                lines=WEIGHT + PLATE + FREE.format(1e-4).replace("\n", " body_skin 3e-5\n"),
                velocity="velocity all set 2 1 -5 units box\nthermo_modify lost ignore\n")
    run_engine(tmp_path, text.replace(" tangential history", ""))
    modulus = 5e9 / (2 * (1 - 0.25**2))
    f, rows = frames(tmp_path), ledger(tmp_path)
    first, second = np.triu_indices(len(body.radius_m), 1)
    expected = []
    for x, radius in zip(f.x, f.radius):
        overlap = radius[first] + radius[second] - np.linalg.norm(x[first] - x[second], axis=1)
        reduced = radius[first] * radius[second] / (radius[first] + radius[second])
        expected.append((8 / 15 * modulus * np.sqrt(reduced) * np.maximum(overlap, 0) ** 2.5).sum())
    found = rows.column["pair_elastic_J"][:, 0][np.isin(rows.step, f.step)]
    in_force = np.isin(f.step, rows.step)
    assert np.count_nonzero(expected) > 50
    assert found == pytest.approx(np.array(expected)[in_force], rel=1e-9, abs=1e-15)


def drop(directory, fix):
    """An unbreakable ball falls 20 mm before it hits the rigid plate."""
    body = fcc_ball(4)
    body.center_m[:, 2] += 0.02 - (body.center_m[:, 2] - body.radius_m).min()
    write_files(directory, body)
    run_engine(directory, deck(DT, 100_000, 10_000, bonds=bond_line(damping_time=1e-7), lines=WEIGHT + PLATE + fix,
                               velocity="velocity all set 0.3 0 -1.5 units box\nthermo_modify lost ignore\n"))
    return read_forces(directory / "forces.bin"), frames(directory)


def test_a_ball_that_falls_hits_as_by_brute_force(tmp_path):
    (tmp_path / "brute").mkdir()
    (tmp_path / "free").mkdir()
    brute, end_brute = drop(tmp_path / "brute", "")
    free, end_free = drop(tmp_path / "free", FREE.format(1e-6))
    assert brute.mean_N.max() > 1
    assert np.array_equal(brute.step, free.step)
    assert free.mean_N == pytest.approx(brute.mean_N, abs=1e-6 * brute.mean_N.max())
    # after the rebound they fly as rigid bodies, where brute force lets what vibration is left die
    assert end_free.x[-1] == pytest.approx(end_brute.x[-1], abs=1e-6)


def test_two_balls_that_meet_in_the_air(tmp_path):
    """They are in the arrays in time: the encounter is that of brute force."""
    one = fcc_ball(3)
    ends = {}
    for name, fix in (("brute", ""), ("free", FREE.format(1e-4))):
        directory = tmp_path / name
        directory.mkdir()
        n = len(one.radius_m)
        two = Body(np.vstack([one.center_m, one.center_m + [0.02, 0.001, 0]]), np.tile(one.radius_m, 2),
                   np.vstack([one.pair, one.pair + n]), np.tile(one.bond_radius_m, 2))
        write_files(directory, two)
        velocity = (f"group left id <= {n}\nvelocity all set 0 0 1 units box\nvelocity left set 2 0 1 units box\n"
                    "thermo_modify lost ignore\n")
        run_engine(directory, deck(DT, 50_000, 5000, bonds=bond_line(damping_time=1e-7), lines=WEIGHT + fix,
                                   velocity=velocity))
        ends[name] = frames(directory)
    brute, free = ends["brute"], ends["free"]
    assert np.abs(brute.v[-1] - brute.v[0])[:, 0].min() > 0.5  # both felt it
    assert free.v[-1].mean(axis=0) == pytest.approx(brute.v[-1].mean(axis=0), abs=1e-9)
    assert free.x[-1] == pytest.approx(brute.x[-1], abs=1e-6)


def test_one_that_left_later_meets_one_that_flew_before(tmp_path):
    """A sphere bounces off the plate, leaves the arrays after that, and rises into one that left them at the start."""
    ends = {}
    for name, fix in (("brute", ""), ("free", FREE.format(1e-4))):
        (tmp_path / name).mkdir()
        two = Body(np.array([[0, 0, 0.02], [0.2e-3, 0, 1.5e-3]]), np.full(2, 1e-3), np.zeros((0, 2), dtype=int), np.zeros(0))
        write_files(tmp_path / name, two)
        velocity = ("group low id 2\nvelocity all set 0 0 0.1 units box\nvelocity low set 0 0 -3 units box\n"
                    "thermo_modify lost ignore\n")
        run_engine(tmp_path / name, deck(DT, 50_000, 5000, lines=WEIGHT + PLATE + fix, velocity=velocity))
        ends[name] = frames(tmp_path / name)
    brute, free = ends["brute"], ends["free"]
    assert brute.v[-1, 0, 2] > 1.0 > brute.v[0, 0, 2]  # the upper one was hit
    assert free.v[-1] == pytest.approx(brute.v[-1], abs=1e-6)
    assert free.x[-1] == pytest.approx(brute.x[-1], abs=1e-8)


def test_sub_spheres_that_get_lost_are_an_error(tmp_path):
    """Each look counts them: here one leaves a box with fixed faces before the first look."""
    write_files(tmp_path, bracket())
    text = deck(DT, 200, 100, lines=WEIGHT + FREE.format(1), velocity="velocity all set 5000 0 0 units box\nthermo_modify lost ignore\n")
    with pytest.raises(AssertionError, match="Sub-spheres were lost"):
        run_engine(tmp_path, text.replace("boundary m m m", "boundary f f f"))


@pytest.mark.slow
def test_plate_signals_are_those_of_brute_force(runs):
    """An elastic sphere leaves the plate and comes back while the plate is not asked: the same record."""
    tables = []
    for name, tolerance in (("brute", 0.0), ("free", 1e-6)):
        scene = changed("elastic_plate", {"time.free_flight_tolerance": tolerance, "time.duration_s": 0.012,
                                          "time.gravity_m_s2": 980.0, "stones.speed_m_s": 3.0})
        run_scene(scene, "test", runs / f"jump_{name}")
        tables.append(pd.read_parquet(runs / f"jump_{name}" / "fast.parquet"))
    brute, free = tables
    hits = np.flatnonzero(np.diff((brute["force_N"] > 0).astype(int)) == 1)
    assert len(hits) >= 2
    for name in ("force_N", "u_m", "a_m_s2", "total_J", "rod_1_N"):
        assert np.abs(free[name] - brute[name]).max() < 1e-5 * np.abs(brute[name]).max(), name




def hook():
    """A row of three that is bent back on itself, so that its ends touch."""
    half, reach = 0.5 * (2 * 0.9e-3 - 2e-5), 2e-3
    center = np.array([[0, -half, 0], [np.sqrt(reach**2 - half**2), 0, 0], [0, half, 0]])
    return Body(center, np.full(3, 0.9e-3), np.array([[0, 1], [1, 2]]), np.full(2, 1e-3))


def test_the_spring_of_a_contact_in_a_body_turns_with_it(tmp_path):
    """Ends of a hook rub on each other as it begins to spin, and a stretched tangential spring stays between them. When
    it comes back from its flight above the plate it is pushed as before: seen from the body, no force has changed."""
    body, speed = hook(), 3.0
    body.center_m[:, 2] += 3.3e-3
    write_files(tmp_path, body)
    text = deck(DT, 4000, 5, bonds=bond_line(damping_time=1e-6), lines=WEIGHT + PLATE + FREE.format(1e-9),
                velocity=throw(body, np.array([6000.0, 0, 0]), np.array([0, 0, -speed])) + "thermo_modify lost ignore\n")
    run_engine(tmp_path, text.replace("0.5 0.5 0.5 0.5", "0.1 0.1 0.1 0.1"))
    f, rows = frames(tmp_path), ledger(tmp_path)
    elastic = rows.column["pair_elastic_J"][:, 0]
    still = np.flatnonzero(np.diff(elastic) == 0)  # it is away

    back = still[np.flatnonzero(np.diff(still) > 1)[0]] + 1
    before, after, away = still[0] - 3, back + 3, still[1]
    overlap = 2 * 0.9e-3 - np.linalg.norm(f.x[:, 2] - f.x[:, 0], axis=1)
    hertz_J = 8 / 15 * 5e9 / (2 * (1 - 0.25**2)) * np.sqrt(0.45e-3) * np.maximum(overlap, 0) ** 2.5
    assert elastic[before] > hertz_J[before]  # and a spring
    assert elastic[away] == pytest.approx(hertz_J[away], rel=1e-9)
    assert rows.column["wall_work_J"][after, 0] == 0  # it has not touched the plate yet
    arm = f.x - f.x.mean(axis=1, keepdims=True)  # all have one mass
    turn, _ = Rotation.align_vectors(arm[after], arm[before])
    assert turn.magnitude() > 1
    found = turn.inv().apply(f.force[after])
    assert found == pytest.approx(f.force[before], abs=0.04 * np.abs(f.force[before]).max())


def test_a_body_that_spins_beside_a_wall_is_there_when_its_tip_strikes(tmp_path):
    """It falls along the wall at less than half its length, and turns towards it: it rebounds as by brute force."""
    wall = ("fix side all wall/side agglomerates agglomerates.txt forces side.bin every 10 box 3e-3 3e-3 -1 1 -1 1 "
            "contact model hertz tangential history primitive type 2 zplane 0.0\n")
    ends = {}
    for name, fix in (("brute", ""), ("free", FREE.format(1e-4))):
        (tmp_path / name).mkdir()
        body = chain(5)
        body.center_m[:] = body.center_m[:, [2, 1, 0]]
        write_files(tmp_path / name, body)
        run_engine(tmp_path / name, deck(DT, 20_000, 1000, bonds=bond_line(damping_time=1e-7), lines=WEIGHT + wall + fix,
                                         velocity=throw(body, np.array([0, 400.0, 0]), np.zeros(3)) + "thermo_modify lost ignore\n"))
        ends[name] = frames(tmp_path / name)
    brute, free = ends["brute"], ends["free"]
    assert brute.v[-1, :, 0].mean() < -0.1
    assert free.v[-1].mean(axis=0) == pytest.approx(brute.v[-1].mean(axis=0), abs=0.03)  # 1e-4 of (3 m/s)^2


def test_a_body_that_spins_beside_another_is_there_when_its_tip_strikes(tmp_path):
    """A row turns about its middle towards a sphere that floats beside it, neither comes nearer: it is struck as by brute
    force."""
    ends = {}
    for name, fix in (("brute", ""), ("free", FREE.format(1e-4))):
        (tmp_path / name).mkdir()
        row = chain(5)
        beside = row.center_m.mean(axis=0) + 4e-3 * np.array([[np.cos(1.0), np.sin(1.0), 0]])
        write_files(tmp_path / name, Body(np.vstack([row.center_m, beside]), np.full(6, 0.9e-3), row.pair, row.bond_radius_m))
        run_engine(tmp_path / name, deck(DT, 12_000, 1000, bonds=bond_line(damping_time=1e-7), lines=WEIGHT + fix, velocity=(
            "velocity all set 0 0 0 units box\n" + throw(row, np.array([0, 0, 400.0]), np.zeros(3)) + "thermo_modify lost ignore\n")))
        ends[name] = frames(tmp_path / name)
    brute, free = ends["brute"], ends["free"]
    assert np.linalg.norm(brute.v[-1, 5, :2]) > 0.5  # it was struck
    assert free.v[-1, 5] == pytest.approx(brute.v[-1, 5], abs=0.03)  # 1e-4 of (3 m/s)^2


def test_a_body_that_spins_above_the_plate_is_there_when_its_tip_strikes(tmp_path):
    """A row turns about its middle, 3 mm above the plate, and falls from rest: it rebounds as by brute force."""
    ends = {}
    for name, fix in (("brute", ""), ("free", FREE.format(1e-4))):
        (tmp_path / name).mkdir()
        row = chain(5)
        row.center_m[:, 2] += 3e-3
        write_files(tmp_path / name, row)
        run_engine(tmp_path / name, deck(DT, 12_000, 1000, bonds=bond_line(damping_time=1e-7), lines=WEIGHT + PLATE + fix,
                                         velocity=throw(row, np.array([0, 400.0, 0]), np.zeros(3)) + "thermo_modify lost ignore\n"))
        ends[name] = frames(tmp_path / name)
    brute, free = ends["brute"], ends["free"]
    assert brute.v[-1, :, 2].mean() > 0.1
    assert free.v[-1].mean(axis=0) == pytest.approx(brute.v[-1].mean(axis=0), abs=0.03)  # 1e-4 of (3 m/s)^2
