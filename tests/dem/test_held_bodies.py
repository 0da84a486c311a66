"""Bodies that touch something gently move as rigid bodies: beside brute force and closed forms. docs/free_flight.md."""

import numpy as np
import pytest
from decks import FREE_FLIGHT, Body, bond_line, chain, deck, frames, ledger, run_engine, write_files

from dem.run.results import read_forces

GRAVITY = 9.8
DT = 2e-7
FREE = (f"fix free_flight all {FREE_FLIGHT} agglomerates agglomerates.txt gravity {GRAVITY} speed 3 tolerance 1e-4 every 60 unheld unheld\n")
WEIGHT = f"fix gravity unheld gravity {GRAVITY} vector 0 0 -1\n"
PLATE = ("fix plate all wall/plate agglomerates agglomerates.txt forces forces.bin extent -1 1 -1 1 co_step 20 "
         "contact model hertz tangential history primitive type 2 zplane 0.0\n")


def tripod():
    """Three sub-spheres that lie on the plate with a fourth on top of them."""
    a = 2e-3
    center = np.array([[0, 0, 0], [a, 0, 0], [a / 2, a * np.sqrt(3) / 2, 0], [a / 2, a / np.sqrt(12), a * np.sqrt(2 / 3)]])
    pair = np.array([[0, 1], [0, 2], [1, 2], [0, 3], [1, 3], [2, 3]])
    return Body(center, np.full(4, 0.9e-3), pair, np.full(6, 1e-3))


def drop(directory, body, height, fix, steps, velocity="velocity all set 0 0 0 units box\n", tension=1e30):
    directory.mkdir()
    body.center_m[:, 2] += height - (body.center_m[:, 2] - body.radius_m).min()
    write_files(directory, body)
    run_engine(directory, deck(DT, steps, steps // 20, bonds=bond_line(tension=tension, shear=tension, damping_time=2e-7),
                               lines=WEIGHT + PLATE + fix, velocity=velocity + "thermo_modify lost ignore\n"))
    return read_forces(directory / "forces.bin"), frames(directory), ledger(directory)


@pytest.fixture(scope="module")
def landed(tmp_path_factory):
    """A tripod falls 1 um, bounces a few times and lies still: brute force, and held."""
    directory = tmp_path_factory.mktemp("landed")
    return {name: drop(directory / name, tripod(), 1e-6, fix, 150_000) for name, fix in (("brute", ""), ("held", FREE))}


def test_a_body_at_rest_weighs_on_the_plate_with_its_weight(landed):
    for force, end, _ in landed.values():
        late = force.all_mean_N[force.all_step > 120_000].sum() * 20 / 30_000
        assert late == pytest.approx(GRAVITY * end.mass[0].sum(), rel=1e-4)


def test_the_plate_gets_the_impulse_that_the_body_got(landed):
    """Over all bounces: the weight times the time, less what momentum is left; a co-step is 20 steps."""
    for force, end, rows in landed.values():
        weight = GRAVITY * end.mass[0].sum() * 150_000 * DT
        assert force.all_mean_N.sum() * 20 * DT == pytest.approx(weight + rows.column["momentum_z_kg_m_s"][-1, 0],
                                                                     rel=1e-6)


def test_it_comes_to_rest_as_deep_as_by_brute_force(landed):
    brute, held = landed["brute"][1], landed["held"][1]
    assert np.abs(held.x - brute.x)[-1, :, 2].max() < 1e-9  # of a fall of 1 um; how it bounces is within the tolerance


def test_the_ledger_closes_while_it_is_held(landed):
    """Kinetic and potential energy, what contacts and bonds hold and what dashpots took: nothing else."""
    for _, end, rows in landed.values():
        c = {name: value[:, 0] for name, value in rows.column.items()}
        gained = (c["kinetic_J"] - c["wall_work_J"] - c["bond_work_J"] - c["pair_work_J"]
                  + GRAVITY * c["mass_height_kg_m"])
        fall = GRAVITY * end.mass[0].sum() * 1e-6
        assert np.abs(gained - gained[0]).max() < 5e-3 * fall


def test_a_body_that_lies_on_the_plate_wakes_and_breaks(tmp_path):
    """A lone sub-sphere falls on the middle of a row that lies on the plate and is held: it breaks as by brute force."""
    ends = {}
    for name, fix in (("brute", ""), ("held", FREE)):
        row = chain(3)
        lying = Body(np.vstack([row.center_m, [2e-3, 0, 0.01]]), np.full(4, 0.9e-3), row.pair, row.bond_radius_m)
        _, end, rows = drop(tmp_path / name, lying, 1e-6, fix, 30_000,
                            "group one id 4\nvelocity all set 0 0 0 units box\nvelocity one set 0 0 -4 units box\n", 2e6)
        ends[name] = rows.column["broken"][-1, 0]
    assert ends["brute"] > 0
    assert ends["held"] == ends["brute"]


def arch(loose_m):
    """A row of seven of which the ends stand on the plate, the others 0.2 mm higher, and sub-spheres at `loose_m`."""
    row = chain(7)
    row.center_m[1:-1, 2] += 0.2e-3
    return Body(np.vstack([row.center_m, loose_m]), np.full(7 + len(loose_m), 0.9e-3), row.pair, row.bond_radius_m)


def struck_at_once(directory, body, speed, tolerance, tension):
    """Loose sub-spheres fly to what lies held, each so gently that it stays held for one of them; brute force beside.
    The plate gets what momentum they lose and their weight gives, also while it is let go. Returns the largest energy
    that the bonds had, with that of broken ones, by way of integration."""
    found = {}
    way = body.center_m[7:] - np.array([body.center_m[np.linalg.norm(body.center_m[:7] - x, axis=1).argmin()]
                                        for x in body.center_m[7:]])
    velocity = "velocity all set 0 0 0 units box\n" + "".join(
        f"set atom {8 + k} vx {x:.17g} vy {y:.17g} vz {z:.17g}\n"
        for k, (x, y, z) in enumerate(-speed * way / np.linalg.norm(way, axis=1)[:, None]))
    body.center_m[:, 2] += 1e-6 + 0.9e-3
    for name, fix in (("brute", ""), ("held", FREE.replace("1e-4", str(tolerance)))):
        (directory / name).mkdir()
        write_files(directory / name, body)
        text = deck(DT, 12_000, 20, bonds=bond_line(tension=tension, shear=1e30, damping_time=2e-8),
                    lines=WEIGHT + PLATE + fix, velocity=velocity + "thermo_modify lost ignore\n")
        run_engine(directory / name, text.replace("5e9 2e11", "5e9 5e9"))  # what is foreseen has the stiffest pair
        column, weight = ledger(directory / name).column, GRAVITY * body.mass_kg.sum() * 12_000 * DT
        start = -speed * (body.mass_kg[7:] * way[:, 2] / np.linalg.norm(way, axis=1)).sum()
        gained = column["momentum_z_kg_m_s"][-1, 0] - start
        impulse = read_forces(directory / name / "forces.bin").all_mean_N.sum() * 20 * DT
        assert impulse - weight == pytest.approx(gained, abs=1e-7 * weight)
        found[name] = (column["bond_elastic_J"] + column["released_J"])[:, 0].max()
    return found


def test_many_gentle_pushes_at_once_wake_a_held_body(tmp_path):
    """Five of them push with more than the whole body is held under: its bonds take up energy as by brute force."""
    above = chain(7).center_m[1:-1] + [0, 0, 0.2e-3 + 1.8e-3 + 0.8e-3]
    found = struck_at_once(tmp_path, arch(above), 0.5, 1e-4, 1e30)
    assert found["held"] == pytest.approx(found["brute"], rel=0.2)


def test_two_gentle_pushes_on_one_sub_sphere_wake_a_held_body(tmp_path):
    """They come to the first of the row from either side and push it with more than a tenth of its bond's strength."""
    angle = np.radians(35)
    beside = 2.6e-3 * np.array([[0, np.sin(a), np.cos(a)] for a in (-angle, angle)])
    found = struck_at_once(tmp_path, arch(beside), 0.5, 1.0, 2e6)
    assert found["held"] == pytest.approx(found["brute"], rel=0.2)


def test_what_a_body_trembles_with_is_counted_when_it_is_held(tmp_path):
    """Nothing damps the bonds: the ledger knows where the energy of their vibration went, while it lies on the plate."""
    tripod_ = tripod()
    tripod_.center_m[:, 2] += 0.9e-3 - 5e-9  # it lies on the plate: a body in the air would leave the arrays
    write_files(tmp_path, tripod_)
    velocity = "velocity all set 0 0 0 units box\nset atom 1*3 vx -0.0133\nset atom 4 vx 0.04\nthermo_modify lost ignore\n"
    run_engine(tmp_path, deck(DT, 1000, 20, bonds=bond_line(), lines=WEIGHT + PLATE + FREE, velocity=velocity))
    c = {name: value[:, 0] for name, value in ledger(tmp_path).column.items()}
    gained = c["kinetic_J"] - c["wall_work_J"] - c["bond_work_J"] - c["pair_work_J"] + GRAVITY * c["mass_height_kg_m"]
    trembles = c["bond_elastic_J"].max()
    assert np.ptp(c["bond_elastic_J"][-20:]) < 1e-6 * trembles  # it is held
    assert np.abs(gained - gained[0]).max() < 0.05 * trembles  # half a step of the vibration


def test_a_held_body_that_stands_on_one_foot_falls_over(tmp_path):
    """A row of three at 30 degrees, its lowest sub-sphere on the plate without friction: from rest its middle falls as that
    of a rigid body on a smooth floor, m g r c/(I + m r^2 c^2) being its angular acceleration, c the cosine and r its arm."""
    row, angle, steps = chain(3), np.radians(30), 25_000
    row.center_m[:] = row.center_m[:, :1] * [np.cos(angle), 0, np.sin(angle)] + [0, 0, 0.9e-3 - 5e-9]
    write_files(tmp_path, row)
    text = deck(DT, steps, steps // 20, bonds=bond_line(damping_time=2e-7), lines=WEIGHT + PLATE + FREE,
                velocity="velocity all set 0 0 0 units box\nthermo_modify lost ignore\n")
    run_engine(tmp_path, text.replace("0.5 0.5 0.5 0.5", "0 0 0 0"))
    mass, arm = row.mass_kg[0], 2e-3 * np.cos(angle)
    inertia = mass * (2 * 2e-3**2 + 3 * 0.4 * 0.9e-3**2)
    fall = 0.5 * 3 * mass * GRAVITY * arm**2 / (inertia + 3 * mass * arm**2) * (steps * DT) ** 2
    x = frames(tmp_path).x
    assert x[0, 1, 2] - x[-1, 1, 2] == pytest.approx(fall, rel=0.05)


def test_a_held_body_turns_as_its_spin_says(tmp_path):
    """A row that stands on one foot, turns about the vertical and falls over: its sub-spheres move about its middle as
    their spins say, by central differences."""
    row, angle, spin, every = chain(3), np.radians(30), 50.0, 250
    row.center_m[:] = row.center_m[:, :1] * [np.cos(angle), 0, np.sin(angle)] + [0, 0, 0.9e-3 - 5e-9]
    write_files(tmp_path, row)
    rates = "".join(f"set atom {k + 1} vy {v!r}\n" for k, v in enumerate((spin * (row.center_m - row.center_m[1])[:, 0]).tolist()))
    text = deck(DT, 15_000, every, bonds=bond_line(damping_time=2e-7), lines=WEIGHT + PLATE + FREE,
                velocity=f"set atom * vx 0 vz 0 omegaz {spin}\n{rates}thermo_modify lost ignore\n")
    run_engine(tmp_path, text.replace("0.5 0.5 0.5 0.5", "0 0 0 0"))
    f = frames(tmp_path)
    assert not f.torque[1:].any()  # of bonds: it is held
    arm = f.x - f.x.mean(axis=1, keepdims=True)
    moved = (arm[2:] - arm[:-2]) / (2 * every * DT)
    expected = np.cross(f.omega, arm)[1:-1]
    assert np.abs(f.omega[-1, 0, :2]).max() > 5  # it falls
    assert np.abs(moved - expected).max() < 1e-4 * np.abs(expected).max()


def test_a_body_that_is_pushed_by_more_than_half_its_limit_is_not_held(tmp_path):
    """Its weight is that much: it goes on trembling, since nothing damps its bonds."""
    tripod_ = tripod()
    tripod_.center_m[:, 2] += 0.9e-3 - 5e-9
    write_files(tmp_path, tripod_)
    velocity = "velocity all set 0 0 0 units box\nset atom 1*3 vx -0.00001\nset atom 4 vx 0.00003\nthermo_modify lost ignore\n"
    strength = 1e-3 / (np.pi * 1e-6)  # 1 mN: a sub-sphere of three bonds is pushed by 0.3 mN at most, and the body weighs 0.24 mN
    run_engine(tmp_path, deck(DT, 1000, 20, bonds=bond_line(tension=strength, shear=1e30), lines=WEIGHT + PLATE + FREE,
                              velocity=velocity))
    c = {name: value[:, 0] for name, value in ledger(tmp_path).column.items()}
    assert np.ptp(c["bond_elastic_J"][-20:]) > 0.1 * c["bond_elastic_J"].max() and c["broken"][-1] == 0
