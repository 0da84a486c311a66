"""Bodies that touch something gently move as rigid bodies: beside brute force and closed forms. docs/free_flight.md."""

import numpy as np
import pytest
from decks import FREE_FLIGHT, Body, bond_line, chain, deck, frames, ledger, run_engine, write_files

from dem.run.recorder import read_forces

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
