"""Two bonded stones that touch each other: Hertz' elastic spheres, Mindlin's rigid ones, and the energy when they break."""

import re

import numpy as np
import pytest
from decks import run_engine
from scipy.integrate import solve_ivp
from test_checkpoint_engine import stopped_at_next
from test_smooth_contact import PAIRS

from common import hertz
from dem.deck.contact import smooth_law
from dem.run.energy_balance import read_ledger, stone_energies
from lab.rock.dump import read_dump
from lab.rock.two_stones import Meeting, meet, scene_of, velocities, write_meeting

R_m = 0.025
COAL = Meeting.of("coal_coal_25_25_2_200")


def of_all(restitution=1.0, friction=0.0):
    return {f"contacts.{pair}": {"restitution": restitution, "friction": friction} for pair in PAIRS}


def ran(directory, meeting, seed=1, aside=0.0, ranks=1, **changes):
    """A meeting's ledger, deck and what was prepared of it."""
    prepared = write_meeting(directory, scene_of(meeting, seed, **changes), meeting.speed_m_s, sum(meeting.radii_m), aside)
    text = (directory / "deck" / "deck.liggghts").read_text()
    # Sub-spheres of LIGGGHTS' own contacts are smooth: what rubs is the fix that is tested.
    text, found = re.subn(r"(fix friction .*peratomtypepair \d+)(.*)", lambda m: m[1] + re.sub(r"[\d.]+", "0", m[2]), text)
    assert found == text.count("coefficientFriction")
    run_engine(directory / "deck", text, ranks)
    return read_ledger(directory / "deck" / "ledger.bin", 2), prepared


def left_over(rows):
    """What contacts took less what they hold and turned into heat, over the first kinetic energy."""
    parts = stone_energies(rows, 0.0, np.zeros(2))
    return np.abs(parts["contacts_unexplained_J"].sum(axis=1)).max() / rows.column["kinetic_J"][0].sum()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["coal_coal_25_25_6_200", "gangue_coal_25_25_0.5_200", "coal_gangue_50_12.5_2_200"])
def test_stones_push_each_other_as_elastic_spheres_however_they_are_turned(name):
    found = meet(Meeting.of(name), 3)
    assert found["force"] == pytest.approx(1, abs=0.02)
    assert found["rebound"] > 0.995 and found["sideways"] < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("restitution", [0.5, 0.2])
def test_restitution_is_that_of_whole_stones(restitution):
    assert meet(COAL, 5, **of_all(restitution))["rebound"] == pytest.approx(restitution, rel=0.02)


def mindlin_pair(scene, mass_kg, speed, aside, friction):
    """Velocities of two equal rigid spheres with Hertz' force, Mindlin's spring and Coulomb's limit: (2, 3) m/s, and the
    spin about y of each. The second comes down beside the first's axis; state: x, z, v_x, v_z, spin of both, slip."""
    law = smooth_law(scene.contacts["coal_coal"], scene.materials["coal"], scene.materials["coal"])
    reach, inertia = 2 * R_m, 0.4 * mass_kg * R_m**2
    state = np.zeros(11)
    state[[2, 3]] = aside * 1.001 * reach, np.sqrt(1 - aside**2) * 1.001 * reach
    state[7] = -speed
    dt, spring = 5e-8, 0.0
    for _ in range(40000):
        apart = state[2:4] - state[:2]
        distance = np.hypot(*apart)
        n = apart / distance
        t = np.array([n[1], -n[0]])
        overlap = reach - distance
        if overlap > 0:
            force = hertz.stiffness_N_m32(law.modulus_Pa, R_m / 2) * overlap**1.5
            arm = R_m - overlap / 2
            # spin w about y moves a point at r by w x r: along t at +arm n by w arm
            sliding = (state[6:8] - state[4:6]) @ t - arm * (state[8] + state[9])
            spring, before = 8 * law.shear_modulus_Pa * np.sqrt(R_m / 2 * overlap), spring
            state[10] *= min(1, before / spring)  # keeps its force as it stiffens
            state[10] = np.clip(state[10] + dt * sliding, -friction * force / spring, friction * force / spring)
            across = spring * state[10]  # on the first along t
            push = -force * n + across * t
            state[4:6] += dt * push / mass_kg
            state[6:8] -= dt * push / mass_kg
            state[8:10] += dt * across * arm / inertia
        elif state[10] or (state[6:8] - state[4:6]) @ n > 0:
            break
        state[:4] += dt * state[4:8]
    return state[4:8].reshape(2, 2), state[8:10]


def moment_of(rows, radius):
    """Angular momentum of sub-spheres with the columns of view.dump about the origin, kg m2/s."""
    x, v, m, omega = rows[:, 1:4], rows[:, 4:7], rows[:, 7], rows[:, 8:11]
    return (m[:, None] * np.cross(x, v) + (0.4 * m * radius**2)[:, None] * omega).sum(axis=0)


def spin_of(rows, radius):
    """Of a stone with the columns of view.dump, rad/s."""
    rows, m = rows.copy(), rows[:, 7]
    rows[:, 1:7] -= np.average(rows[:, 1:7], axis=0, weights=m)
    x, own = rows[:, 1:4], 0.4 * m * radius**2
    inertia = np.einsum("i,ijk->jk", m, (x**2).sum(axis=1)[:, None, None] * np.eye(3) - x[:, :, None] * x[:, None, :])
    return np.linalg.solve(inertia + own.sum() * np.eye(3), moment_of(rows, radius))


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_an_oblique_meeting_is_that_of_rigid_spheres_with_mindlins_spring(tmp_path, friction):
    _, prepared = ran(tmp_path, COAL, 2, 0.4, **of_all(friction=friction))
    found = velocities(tmp_path / "deck", prepared)[:, [0, 2]]
    expected, spins = mindlin_pair(prepared.scene, prepared.assembly.mass_kg.sum() / 2, 2.0, 0.4, friction)
    assert found == pytest.approx(expected, abs=0.015 * 2.0)
    (_, first), (_, last) = list(read_dump(tmp_path / "deck" / "view.dump"))
    stone, radius = prepared.assembly.agglomerate, prepared.assembly.radius_m
    for k in range(2):
        assert spin_of(last[stone == k], radius[stone == k])[1] == pytest.approx(spins[k], rel=0.03, abs=0.01)
    before, after = moment_of(first, radius), moment_of(last, radius)  # one pushes the other where it is pushed itself
    assert after == pytest.approx(before, abs=5e-4 * np.linalg.norm(before))


@pytest.mark.slow
def test_a_stone_that_spins_without_friction_keeps_its_spin(tmp_path):
    """At 200 rad/s its surface passes the other's five times as fast as it comes, and the patch goes round with it."""
    prepared = write_meeting(tmp_path, scene_of(COAL, 3), 2.0, 2 * R_m, 0.0)
    deck, upper = tmp_path / "deck", prepared.assembly.agglomerate == 1
    center, mass = prepared.assembly.center_m, prepared.assembly.mass_kg
    spin = np.outer(upper, [0.0, 200.0, 0.0])
    arm = center - np.average(center[upper], axis=0, weights=mass[upper])
    rows = np.hstack([np.cross(spin, arm) - np.outer(upper, [0.0, 0.0, 2.0]), spin])
    with open(deck / "atoms.data", "a") as out:
        out.write("\nVelocities\n\n" + "".join(
            f"{k} " + " ".join(f"{number:.17g}" for number in row) + "\n" for k, row in enumerate(rows.tolist(), 1)))
    own = 0.4 * mass * prepared.assembly.radius_m**2
    energy = (mass @ (rows[:, :3]**2).sum(axis=1) + own @ (spin**2).sum(axis=1)) / 2
    text = re.sub(r"\nvelocity .*", "", (deck / "deck.liggghts").read_text())
    run_engine(deck, re.sub(r"impact_J \S+", f"impact_J {float(energy)!r}", text))
    lower_m_s, upper_m_s = velocities(deck, prepared)
    assert lower_m_s == pytest.approx([0.0, 0.0, -2.0], abs=0.005)
    assert upper_m_s == pytest.approx([0.0, 0.0, 0.0], abs=0.005)
    last, radius = list(read_dump(deck / "view.dump"))[-1][1], prepared.assembly.radius_m
    assert spin_of(last[upper], radius[upper])[1] == pytest.approx(200.0, rel=0.001)
    assert np.abs(spin_of(last[~upper], radius[~upper])).max() < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("speed_m_s", [pytest.param(6, marks=pytest.mark.validate), 12])
def test_stones_that_break_each_other_keep_the_energy_and_do_not_pass(tmp_path, speed_m_s):
    meeting = Meeting.of(f"coal_coal_25_25_{speed_m_s}_500")
    rows, prepared = ran(tmp_path, meeting, 1, 0.1, **of_all(0.9, 0.4), **{"stones.agglomerate.unbreakable": False})
    assert rows.column["broken"][-1].sum() > 50
    assert left_over(rows) < 3e-5  # of first order in the time step, twice this, if looks forget half a step
    friction = rows.column["friction_J"].sum(axis=1)
    assert friction[-1] > {6: 5e-4, 12: 1e-2}[speed_m_s]  # of released pairs at 12 m/s: their patches rub 2e-3 J before
    assert np.diff(friction).min() > -1e-12
    last = list(read_dump(tmp_path / "deck" / "view.dump"))[-1][1]
    first, second = last[:prepared.assembly.sizes[0]], last[prepared.assembly.sizes[0]:]
    middle = np.average(first[:, 3], weights=first[:, 7])
    assert second[second[:, 3] < middle, 7].sum() < 0.01 * second[:, 7].sum()


def chain_N(scene, mass_kg, speed, clear_m):
    """Peaks of the forces between two equal rigid spheres and on the plate, N: the upper one comes down on the lower one,
    which lies on the plate."""
    coal = scene.materials["coal"]
    pair = smooth_law(scene.contacts["coal_coal"], coal, coal)
    plate = smooth_law(scene.contacts["coal_plate"], coal, scene.plate)
    k = [hertz.stiffness_N_m32(pair.modulus_Pa, R_m / 2), hertz.stiffness_N_m32(plate.modulus_Pa, R_m)]

    def forces(y):
        return k[0] * max(0, y[0] - y[1] - clear_m[0]) ** 1.5, k[1] * max(0, y[1] - clear_m[1]) ** 1.5

    def rate(_, y):  # ways down, speeds down
        on_lower, on_plate = forces(y)
        return [y[2], y[3], -on_lower / mass_kg, (on_lower - on_plate) / mass_kg]
    run = solve_ivp(rate, (0, 1e-3), [0, 0, speed, 0], rtol=1e-9, atol=1e-12, max_step=1e-6)
    return np.max([forces(y) for y in run.y.T], axis=0)


@pytest.mark.slow
def test_a_stone_that_lands_on_a_lying_one_is_a_chain_of_hertz_contacts(tmp_path):
    meeting = Meeting.of("coal_coal_25_25_2_500")
    prepared = write_meeting(tmp_path, scene_of(meeting, 6, **{"time.duration_s": 6e-4}), 2.0, 2 * R_m, 0.0)
    deck = tmp_path / "deck"
    head, atoms = (deck / "atoms.data").read_text().split("Atoms\n\n")
    rows = np.array([line.split() for line in atoms.splitlines()], dtype=float)
    surface = [line.split() for line in (deck / "surface.txt").read_text().splitlines()]
    place = np.array([row for row in surface if len(row) == 6], dtype=float)[:, :3]
    middle = rows[[0, -1], 4:] - [place[0], place[-1]]  # of the surfaces, which is not that of the mass
    clear = 1e-5, np.linalg.norm(middle[1] - middle[0]) - 2 * R_m
    rows[:, 6] -= middle[0, 2] - R_m - clear[0]
    head = re.sub(r"\S+( \S+ zlo)", r"-0.01\1", head)
    (deck / "atoms.data").write_text(head + "Atoms\n\n" + "".join(
        f"{row[0]:.0f} {row[1]:.0f} " + " ".join(f"{number:.17g}" for number in row[2:]) + "\n" for row in rows))
    run_engine(deck, (deck / "deck.liggghts").read_text())
    ledger, dt = read_ledger(deck / "ledger.bin", 2), prepared.step.dt_s
    momentum = np.diff(ledger.column["momentum_z_kg_m_s"], axis=0) / np.diff(ledger.step * dt)[:, None]
    expected = chain_N(prepared.scene, prepared.assembly.mass_kg.sum() / 2, 2.0, (clear[1], clear[0]))
    assert [momentum[:, 1].max(), momentum.sum(axis=1).max()] == pytest.approx(expected.tolist(), rel=0.03)



BREAKS = {**of_all(0.7, 0.4), "stones.agglomerate.unbreakable": False, "stones.agglomerate.subspheres": 200}


def flown(directory, aside, tolerance):
    """Velocities after, m/s, and at each thermo output how many sub-spheres are in the arrays, of two stones that begin
    1 mm apart."""
    meeting = Meeting.of("coal_coal_25_25_0.5_200")
    scene = scene_of(meeting, 2, **of_all(friction=0.3), **{"time.duration_s": 2.6e-3, "time.free_flight_tolerance": tolerance})
    prepared = write_meeting(directory, scene, 0.5, 2 * R_m + 1e-3, aside)
    text = (directory / "deck" / "deck.liggghts").read_text()
    log = run_engine(directory / "deck", re.sub(r"thermo +\d+", "thermo 100", text))
    rows = re.findall(r"^ +(\d+) +(\d+) +\S+ *$", log, re.MULTILINE)
    return velocities(directory / "deck", prepared), np.array(rows, dtype=int)[:, 1]


@pytest.mark.slow
def test_stones_in_free_flight_meet_as_by_brute_force(tmp_path):
    expected, _ = flown(tmp_path / "brute", 0.4, 0.0)
    found, _ = flown(tmp_path / "free", 0.4, 1e-4)
    assert found == pytest.approx(expected, abs=1e-4 * 0.5)
    assert np.linalg.norm(found[0]) > 0.3


def test_stones_that_pass_each_other_closely_stay_in_free_flight(tmp_path):
    """By half a millimetre, less than what smooth surfaces lie outside sub-spheres."""
    found, in_arrays = flown(tmp_path, (2 * R_m + 5e-4) / (2 * R_m + 1e-3), 1e-4)
    assert found == pytest.approx(np.array([[0, 0, 0], [0, 0, -0.5]]), abs=1e-9)
    assert len(in_arrays) > 50 and (in_arrays == 0).mean() > 0.9


def halves_flown(directory, tolerance, onto_plate, flat_first):
    """Two stones are broken in halves. A half of the second comes down on the lower half of the first, or on the plate; the
    others are out of the way. The lowest sub-sphere of its round side is 0.3 mm above its surface. Its height and
    velocity after, m and m/s, and how many sub-spheres are in the arrays at each thermo output."""
    scene = scene_of(COAL, 4, **of_all(0.5, 0.3), **{"time.duration_s": 2.6e-3, "time.free_flight_tolerance": tolerance})
    write_meeting(directory, scene, 3.0, 2 * R_m, 0.0)
    deck = directory / "deck"
    surface = [line.split() for line in (deck / "surface.txt").read_text().splitlines()]
    upper = np.array([float(row[2]) > 0 for row in surface if len(row) == 6])
    second = np.arange(len(upper)) >= len(upper) // 2
    bonds = np.loadtxt(deck / "bonds.txt")
    kept = bonds[np.equal(*upper[bonds[:, :2].astype(int) - 1].T)]
    np.savetxt(deck / "bonds.txt", kept, fmt=["%d"] * 3 + ["%.17g"] * 5)
    head, atoms = (deck / "atoms.data").read_text().split("Atoms\n\n")
    rows = np.array([line.split() for line in atoms.splitlines()], dtype=float)
    x, radius = rows[:, 4:], 0.5 * rows[:, 2]
    falls, waits = second & (upper == flat_first), ~second & ~upper
    beneath = 0.0 if onto_plate else (x[waits, 2] + radius[waits]).max()
    x[falls, 2] += beneath + (7e-3 if onto_plate else 5e-3) - (x[falls, 2] - radius[falls]).min()
    for k, others in enumerate([second & ~falls, ~second & ~waits, *([waits] if onto_plate else [])]):
        x[others, 0] += 0.1 * (k + 1)
    head = re.sub(r"\S+( \S+ zlo)", r"-0.01\1", re.sub(r"\S+ xlo", "0.4 xlo", head))
    (deck / "atoms.data").write_text(head + "Atoms\n\n" + "".join(
        f"{row[0]:.0f} {row[1]:.0f} " + " ".join(f"{number:.17g}" for number in row[2:]) + "\n" for row in rows))
    log = run_engine(deck, re.sub(r"thermo +\d+", "thermo 100", (deck / "deck.liggghts").read_text()))
    in_arrays = re.findall(r"^ +\d+ +(\d+) +\S+ *$", log, re.MULTILINE)
    last = list(read_dump(deck / "view.dump"))[-1][1][falls]
    return np.average(last[:, 3:7], axis=0, weights=last[:, 7]), np.array(in_arrays, dtype=int)


@pytest.mark.slow
@pytest.mark.parametrize(("onto_plate", "flat_first"), [(False, True), (True, True), (True, False)])
def test_a_fragment_flies_where_only_the_rest_of_its_stone_would_touch(tmp_path, onto_plate, flat_first):
    """Above another fragment or the plate, into which its whole stone would reach. It strikes as by brute force."""
    expected, _ = halves_flown(tmp_path / "brute", 0.0, onto_plate, flat_first)
    found, in_arrays = halves_flown(tmp_path / "free", 1e-4, onto_plate, flat_first)
    assert expected[3] > -2.5
    assert found[0] == pytest.approx(expected[0], abs=1e-5)
    assert found[1:] == pytest.approx(expected[1:], abs=1e-3 * 3.0)
    assert (in_arrays == 0).mean() > 0.3


@pytest.mark.slow
def test_two_ranks_find_the_same(tmp_path):
    found = []
    for ranks in (1, 2):
        rows, _ = ran(tmp_path / str(ranks), COAL, 4, 0.3, ranks, **of_all(0.7, 0.4), **{"time.duration_s": 1e-4})
        c = rows.column
        assert left_over(rows) < 3e-5  # of first order in the time step, twice this, if looks forget half a step
        found.append(np.concatenate([c[name].sum(axis=1) for name in ("kinetic_J", "pair_elastic_J", "friction_J", "pair_damped_J")]))
    assert found[1] == pytest.approx(found[0], rel=1e-9, abs=1e-11)


@pytest.mark.slow
def test_a_run_stopped_in_the_contact_goes_on_bit_by_bit(tmp_path):
    """At each of its checkpoints, while bonds break under the patches."""
    meeting = Meeting.of("coal_coal_25_25_8_200")
    for name in ("whole", "parted"):
        write_meeting(tmp_path / name, scene_of(meeting, 1, **BREAKS, **{"time.duration_s": 1.5e-4}), 8.0, 2 * R_m, 0.2)
    run_engine(tmp_path / "whole" / "deck", (tmp_path / "whole" / "deck" / "deck.liggghts").read_text())
    step, stops = 0, 0
    while step is not None:
        _, output, step = stopped_at_next(tmp_path / "parted" / "deck", 1, step)
        stops += step is not None
    assert stops > 10, output[-500:]
    whole, parted = (tmp_path / name / "deck" / "ledger.bin" for name in ("whole", "parted"))
    assert read_ledger(whole, 2).column["broken"].sum() > 0
    assert whole.read_bytes() == parted.read_bytes()
