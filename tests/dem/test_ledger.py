"""Each dissipation of the ledger against a case where it is known by itself."""

import numpy as np
import pytest
from decks import Body, bond_line, chain, deck, frames, ledger, run_engine, write_files

from dem.run.energy_balance import COLUMNS, PlateEnergy, StoneLedger, energy_ledger, stone_energies


@pytest.mark.parametrize("kernel", ["plain", "sse2", "auto"])
def test_damping_of_a_bond_is_the_decay_of_an_oscillator(tmp_path, kernel):
    """Two spheres pulled apart along their bond: E falls as exp(-tau omega^2 t), omega^2 = 2 k/m. What the bond took and
    does not hold is what its damping was measured to take."""
    modulus, body = 5e9, chain(2)
    write_files(tmp_path, body)
    k = modulus * np.pi * 1e-6 / 2e-3
    mass = body.mass_kg[0]
    omega = np.sqrt(2 * k / mass)
    tau = 0.02 / omega
    dt = 0.01 / omega
    steps = int(2 * np.pi * 8 / omega / dt)  # whole periods
    velocity = "set atom 1 vx -0.05\nset atom 2 vx 0.05\n"
    run_engine(tmp_path, deck(dt, steps, steps, bonds=bond_line(modulus, damping_time=tau, kernel=kernel), velocity=velocity))
    c = ledger(tmp_path).column
    start = mass * 0.05**2
    lost = -c["bond_work_J"][-1, 0] - c["bond_elastic_J"][-1, 0]
    assert lost == pytest.approx(start * (1 - np.exp(-tau * omega**2 * steps * dt)), rel=1e-2)
    assert c["kinetic_J"][-1, 0] + c["bond_elastic_J"][-1, 0] + lost == pytest.approx(start, rel=1e-6)
    assert c["bond_damped_J"][-1, 0] == pytest.approx(lost, rel=1e-3)


@pytest.mark.parametrize("moves", ["vx -0.05", "vy -0.05", "omegax 50", "omegay 50"])
def test_the_damping_of_every_motion_of_a_bond_is_measured(tmp_path, moves):
    """Pull, shear, twist and bending, in steps that are long against the time of the damping."""
    modulus, body = 5e9, chain(2)
    write_files(tmp_path, body)
    t0 = np.sqrt(body.mass_kg[0] * 2e-3 / (modulus * np.pi * 1e-6))
    bonds = bond_line(modulus, damping_time=0.01 * t0)
    run_engine(tmp_path, deck(0.2 * t0, 2000, 2000, bonds=bonds, velocity=f"set atom 1 {moves}\n"))
    c = ledger(tmp_path).column
    lost = -c["bond_work_J"][-1, 0] - c["bond_elastic_J"][-1, 0]
    assert lost > 0.1 * frames(tmp_path).mass[0, 0] * 0.05**2 / 8
    assert c["bond_damped_J"][-1, 0] == pytest.approx(lost, rel=1e-3)


@pytest.mark.parametrize("axis", ["x", "z"])
def test_damping_of_a_bond_that_twists_or_bends(tmp_path, axis):
    """Two spheres spin against each other about their bond or across it: omega^2 = 2 k/I, and the bonds do the work that
    the spins lose."""
    modulus, ratio, body, spin = 5e9, 2.0, chain(2), 100.0
    write_files(tmp_path, body)
    k = modulus * np.pi * 1e-6 / 2e-3 * 1e-6 * (1 / ratio / 2 if axis == "x" else 1 / 4)
    inertia = 0.4 * body.mass_kg[0] * body.radius_m[0] ** 2
    omega = np.sqrt(2 * k / inertia)
    tau, dt = 0.02 / omega, 0.01 / omega
    steps = int(2 * np.pi * 8 / omega / dt)
    velocity = f"set atom 1 omega{axis} {-spin}\nset atom 2 omega{axis} {spin}\n"
    run_engine(tmp_path, deck(dt, steps, steps, bonds=bond_line(modulus, ratio, damping_time=tau), velocity=velocity))
    c = ledger(tmp_path).column
    start = inertia * spin**2
    lost = -c["bond_work_J"][-1, 0] - c["bond_elastic_J"][-1, 0]
    assert lost == pytest.approx(start * (1 - np.exp(-tau * omega**2 * steps * dt)), rel=1e-2)
    assert c["kinetic_J"][-1, 0] + c["bond_elastic_J"][-1, 0] + lost == pytest.approx(start, rel=1e-6)


def two_spheres(directory, offset, restitution, friction, steps=3000, every=3000, dt=1e-7, ranks=1):
    """Two free spheres that meet at 1 m/s, the second shifted sideways by `offset`."""
    apart = np.sqrt(4e-6 - offset**2) + 5e-5
    body = Body(np.array([[0, 0, 0], [apart, offset, 0]]), np.full(2, 1e-3), np.zeros((0, 2), int), np.zeros(0))
    write_files(directory, body)
    text = deck(dt, steps, every, velocity="set atom 1 vx 0.5\nset atom 2 vx -0.5\n")
    text = text.replace("0.9 0.9 0.9 0.9", " ".join([str(restitution)] * 4))
    text = text.replace("0.5 0.5 0.5 0.5", " ".join([str(friction)] * 4))
    run_engine(directory, text, ranks)
    c = ledger(directory).column
    kinetic = 2 * 0.5 * body.mass_kg[0] * 0.25
    assert c["pair_elastic_J"][-1, 0] == 0  # apart again
    return c, kinetic


def test_a_head_on_collision_loses_energy_to_the_normal_dashpot_alone(tmp_path):
    c, kinetic = two_spheres(tmp_path, 0.0, restitution=0.5, friction=0.5)
    lost = kinetic - c["kinetic_J"][-1, 0]
    assert lost == pytest.approx((1 - 0.5**2) * kinetic, rel=2e-2)  # the restitution that was asked for
    assert c["pair_damped_J"][-1, 0] == pytest.approx(lost, rel=1e-3)
    assert -c["pair_work_J"][-1, 0] == pytest.approx(lost, rel=1e-9)


def test_a_sliding_collision_without_dashpots_loses_energy_to_friction_alone(tmp_path):
    """Restitution 1: Coulomb's law takes mu x normal impulse x slip, here with slip that lasts through the contact."""
    c, kinetic = two_spheres(tmp_path, 1.2e-3, restitution=1.0, friction=0.05)
    lost = kinetic - c["kinetic_J"][-1, 0]
    assert c["pair_damped_J"][-1, 0] == 0
    assert lost > 0.02 * kinetic
    assert -c["pair_work_J"][-1, 0] == pytest.approx(lost, rel=1e-6)  # the torques' on the spins with the forces'
    # Rigid-sphere theory: J_n = m v_n (both masses equal), slip velocity falls by J_t (2/m + 2 r^2/I) with I = 2/5 m r^2.
    sine = 1.2 / 2.0
    v_n, v_t = np.sqrt(1 - sine**2), sine
    mass = kinetic / 0.25
    impulse = mass * v_n
    slip_end = v_t - 0.05 * impulse * 7 / mass
    assert slip_end > 0  # it slides to the end, as the theory needs
    assert lost == pytest.approx(0.05 * impulse * (v_t + slip_end) / 2, rel=2e-2)
    assert c["friction_J"][-1, 0] - c["springs_gained_J"][-1, 0] == pytest.approx(lost, rel=1e-3)


@pytest.mark.parametrize(("restitution", "friction", "ranks"), [
    (0.7, 0.3, 1), (0.7, 0.3, 2), (0.7, 3.0, 1), (1.0, 3.0, 1), (1.0, 0.0, 1)],
    ids=["slides", "over two ranks", "sticks", "sticks and lets go", "neither"])
def test_all_that_an_oblique_collision_holds_and_takes_adds_up_at_every_instant(tmp_path, restitution, friction, ranks):
    """Of 1 m/s at 37 degrees: kinetic energy, that of Hertz' and of Mindlin's spring, dashpots and friction."""
    c, kinetic = two_spheres(tmp_path, 1.2e-3, restitution, friction, steps=7500, every=25, dt=2e-8, ranks=ranks)
    held, taken = c["kinetic_J"] + c["pair_elastic_J"], c["pair_damped_J"] + c["friction_J"] - c["springs_gained_J"]
    assert c["pair_elastic_J"].max() > 0.3 * kinetic
    assert np.abs(held + taken - kinetic).max() < 1e-3 * kinetic


def test_the_ledger_sees_no_dissipation_where_there_is_none(tmp_path):
    c, kinetic = two_spheres(tmp_path, 0.0, restitution=1.0, friction=0.0)
    assert abs(c["pair_work_J"][-1, 0]) < 1e-5 * kinetic
    assert frames(tmp_path).v[-1, 0, 0] == pytest.approx(-0.5, rel=1e-4)


def test_all_parts_of_the_ledger_are_what_no_contact_or_bond_did():
    """Of any numbers, of two stones: all parts with what is unexplained add up to the kinetic and potential energy less the
    works of bonds and contacts, since what these took is told apart in them and nothing counts twice."""
    numbers = np.random.default_rng(1).normal(size=(len(COLUMNS), 3, 2))
    c = dict(zip(COLUMNS, numbers, strict=True))
    near = np.ones((3, 2), dtype=bool)
    start_kg_m = np.array([0.3, 0.7])
    parts = stone_energies(StoneLedger(np.arange(3), c, near), 9.8, start_kg_m)
    works = c["bond_work_J"] + c["pair_work_J"] + c["wall_work_J"]
    expected = c["kinetic_J"] + 9.8 * (c["mass_height_kg_m"] - start_kg_m) - works
    assert sum(parts.values()) == pytest.approx(expected, rel=1e-12)
    assert parts["given_to_stones_J"].sum(axis=1) == pytest.approx(np.zeros(3), abs=1e-12)


def test_a_stone_that_has_not_entered_closes():
    """What no stone explains is shared among all: of a stone without energy it is no share of anything."""
    start = np.array([1.0, 0.0])
    parts = {name: np.zeros((1, 2)) for name in ("kinetic_J", "potential_J", "given_to_plate_J", "given_to_stones_J")}
    parts["kinetic_J"][0, 0] = 0.998
    parts["given_to_stones_J"][:] = 1e-3
    found = energy_ledger(parts, PlateEnergy(), start)
    assert [one["closure"] for one in found["by_agglomerate"]] == pytest.approx([-1e-3, 0.0])
    assert found["closure"] == pytest.approx(0.0, abs=1e-15)
