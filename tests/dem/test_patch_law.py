"""The law of a stone's patch, step by step, from the places of its sub-spheres; and the energy of a stone that turns on it."""

import re

import numpy as np
import pytest
from decks import DUMP_NUMBERS, DUMPED, frames, run_engine
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from test_smooth_contact import RADIUS_m, stone

from dem.deck.render import write_deck
from dem.run.energy_balance import read_ledger
from dem.run.prepare import prepare

STRENGTH_Pa = 200e6
SOFTER = 2  # the bonds under the patch that presses, so that no other compliance, nor none, is mistaken for theirs


class Surface:
    """surface.txt of one stone: `law` has its numbers from `count` on, the arrays one number, or place, of each sub-sphere."""

    def __init__(self, directory):
        self.file = directory / "surface.txt"
        self.outside, law, *rows = self.file.read_text().splitlines()
        self.law, self.rows = np.array(law.split(), dtype=float), np.array([row.split() for row in rows], dtype=float)
        self.place, self.radius, self.mass, self.is_surface = self.rows[:, :3], *self.rows[:, 3:].T

    def write(self):
        rows = [" ".join(f"{number:.17g}" for number in row) for row in (self.law, *self.rows)]
        self.file.write_text("\n".join([self.outside, *rows]) + "\n")

    def weights(self, axis):
        """Of the patch about `axis` by the formula of docs/contact.md: a linear factor centres them."""
        rho = self.place - np.outer(self.place @ axis, axis)
        inside = 1 - (rho**2).sum(axis=1) / self.law[2] ** 2
        w = np.where((self.is_surface == 1) & (self.place @ axis > 0) & (inside > 0), self.radius**2 * inside, 0)
        shift = -np.linalg.lstsq((w[:, None] * rho).T @ rho, w @ rho, rcond=None)[0]
        w = w * np.maximum(0, 1 + rho @ shift)
        return w / w.sum()


def deck_of(tmp_path, scene):
    model = prepare(scene, "scene", tmp_path)
    write_deck(tmp_path / "deck", model.scene, model.assembly, model.step, model.modes)
    return tmp_path / "deck", Surface(tmp_path / "deck")


def run_spinning(deck, surface, spin, every, along_m_s=0.0):
    """Run the deck with the stone in rigid rotation `spin`, rad/s, and with a speed along x, besides its fall, seen at
    `every` so many steps."""
    text = (deck / "deck.liggghts").read_text()
    start = "velocity        all set 0 0 -3.0 units box\n"
    (contacts,) = set(re.findall(r"contacts.bin every \d+", text))
    assert start in text
    middle = surface.mass @ surface.place / surface.mass.sum()
    velocity = np.array([along_m_s, 0, -3.0]) + np.cross(spin, surface.place - middle)
    energy = 0.5 * surface.mass @ ((velocity**2).sum(axis=1) + 0.4 * surface.radius**2 * np.dot(spin, spin))
    turning = "".join(
        f"set atom {k + 1} " + " ".join(f"v{d} {u!r} omega{d} {s!r}" for d, u, s in zip("xyz", v, spin)) + "\n"
        for k, v in enumerate(velocity.tolist()))
    dump = f'dump view all custom {every} view.dump id {DUMPED}\ndump_modify view format "%d{DUMP_NUMBERS}"\n'
    text = re.sub(r"impact_J \S+", f"impact_J {float(energy)!r}", text).replace(start, turning + dump)
    run_engine(deck, text.replace(contacts, f"contacts.bin every {every}"))


def contacts_of(deck):
    """{step: elastic force of the patch, N} of contacts.bin."""
    data, at, found = (deck / "contacts.bin").read_bytes(), 0, {}
    while at < len(data):
        step, count = np.frombuffer(data, "<i8", 2, at)
        found[int(step)] = np.frombuffer(data, "<f8", 5 * count, at + 16).reshape(-1, 5)[:, 3].sum()
        at += 16 + 40 * count
    return found


def push_N(q, modulus, compliance, strength=None):
    """Of a sphere that loads a plane by d = q + C F: Hertz, and beyond its strength the slope pi p R."""
    k = 4 / 3 * modulus * np.sqrt(RADIUS_m)
    yields = (np.pi * strength / (2 * modulus)) ** 2 * RADIUS_m if strength else np.inf

    def push(d):
        return k * min(d, yields) ** 1.5 + (np.pi * strength * RADIUS_m * (d - yields) if d > yields else 0)
    return 0.0 if q <= 0 else push(brentq(lambda d: d - compliance * push(d) - q, q, 2 * q, xtol=1e-18))


@pytest.mark.slow
@pytest.mark.parametrize(("strength_Pa", "spin"), [(None, 0.0), (STRENGTH_Pa, 0.0), (None, 60.0)],
                         ids=["elastic", "crushes", "turned"])
def test_the_patch_pushes_by_how_far_its_members_came(tmp_path, strength_Pa, spin):
    """q = sum w_i (R - c_iz) from the dumped places, and F(q) solved anew. A stone that has turned by 0.15 rad presses with
    another patch, which has the compliance of the others."""
    scene = stone(200, **{"time.free_flight_tolerance": 0.0, "materials.coal.contact_strength_Pa": strength_Pa,
                          "stones.gap_m": 7.5e-3 if spin else 1e-5, "time.duration_s": 2.9e-3 if spin else 4e-4})
    deck, surface = deck_of(tmp_path, scene)
    surface.law[10 if spin else 9] *= SOFTER
    surface.write()
    run_spinning(deck, surface, (0, spin, 0), 10 if spin else 1)
    seen, recorded = frames(deck), contacts_of(deck)
    pressing = [k for k, step in enumerate(seen.step) if recorded.get(step, 0) > 0]
    q = []
    for k in pressing:
        x = seen.x[k if spin else pressing[0]]  # the patch follows a stone that turns
        turned = Rotation.align_vectors(x - x.mean(axis=0), surface.place - surface.place.mean(axis=0))[0]
        axis = turned.inv().apply([0, 0, -1.0])
        weight = surface.weights(axis)
        q.append(RADIUS_m + weight @ turned.apply(surface.place)[:, 2] - weight @ seen.x[k][:, 2])
    q = np.array(q)
    if strength_Pa:
        pressing, q = pressing[:q.argmax()], q[:q.argmax()]  # what is left after crushing unloads otherwise
    compliance = surface.law[10 if np.arccos(-axis[2]) > 0.1 else 9]
    expected = [push_N(one, surface.law[3], compliance, strength_Pa) for one in q]
    found = [recorded[int(seen.step[k])] for k in pressing]
    assert found == pytest.approx(expected, abs=(5e-3 if spin else 1e-6) * max(expected))


@pytest.mark.slow
def test_the_patch_drags_by_how_far_it_slid_since_it_came(tmp_path):
    """It sticks. The way of its members over the plate, from the dumped places, stretches the spring in series with their
    bonds, which LIGGGHTS moves: 1/k = 1/(4 G*/E* 2 E* a) - C. While k rises the spring keeps its force."""
    scene = stone(200, friction=5.0, **{"time.free_flight_tolerance": 0.0, "time.duration_s": 1.5e-4})
    deck, surface = deck_of(tmp_path, scene)
    surface.law[11] *= SOFTER
    surface.write()
    run_spinning(deck, surface, (0, 0, 0), 1, along_m_s=0.5)
    seen, recorded = frames(deck), contacts_of(deck)
    steps = [k for k, step in enumerate(seen.step) if recorded.get(step, 0) > 0]
    steps = range(steps[0], steps[-1] + 1)
    modulus, shear, compliance = surface.law[3], surface.law[4], surface.law[11]
    weight = surface.weights(np.array([0, 0, -1.0]))
    dt_s = float(re.search(r"^timestep +(\S+)", (deck / "deck.liggghts").read_text(), re.MULTILINE)[1])
    stretch_m, before_N_m, expected = 0.0, 0.0, []
    for k in steps:
        arm_m = seen.x[k - 1, :, 2]
        way_m = weight @ (seen.x[k, :, 0] - seen.x[k - 1, :, 0]
                          - dt_s * (seen.omega[k, :, 1] + seen.omega[k - 1, :, 1]) / 2 * arm_m)
        push = recorded[int(seen.step[k])]
        radius_m = np.cbrt(push * RADIUS_m / (4 / 3 * modulus))
        mindlin = 8 * shear * radius_m
        spring_N_m = mindlin / (1 - compliance * mindlin)
        stretch_m = stretch_m * min(1, before_N_m / spring_N_m) + way_m
        before_N_m = spring_N_m
        expected.append(-spring_N_m * stretch_m)
    found = seen.force[list(steps), :, 0].sum(axis=1)
    assert compliance * mindlin > 0.2
    assert found == pytest.approx(np.array(expected), abs=5e-3 * np.abs(expected).max())


@pytest.mark.slow
def test_a_stone_with_a_heavy_side_is_pushed_along_the_axis_of_its_surface(tmp_path):
    """It spins about the vertical through its mass, beside the centre of its surface, where the plate's push has no
    moment: bonds add none, patch and dashpot act on the contact's axis."""
    scene = stone(200, restitution=0.3, **{"time.free_flight_tolerance": 0.0, "stones.gap_m": 6e-3, "time.duration_s": 2.4e-3})
    deck, surface = deck_of(tmp_path, scene)
    heavy = surface.place[:, 0] > 0
    surface.mass[heavy] *= 3
    surface.write()
    head, atoms = (deck / "atoms.data").read_text().split("Atoms\n\n")
    rows = [line.split() for line in atoms.splitlines()]
    (deck / "atoms.data").write_text(head + "Atoms\n\n" + "".join(
        " ".join([*row[:3], repr(float(row[3]) * (3 if side else 1)), *row[4:]]) + "\n" for row, side in zip(rows, heavy)))
    run_spinning(deck, surface, (0, 0, 400.0), 10)
    seen, recorded = frames(deck), contacts_of(deck)
    moments = []
    for k, step in enumerate(seen.step):
        if recorded.get(step, 0) == 0:
            continue
        x, f = seen.x[k], seen.force[k]
        turned = Rotation.align_vectors(x - x.mean(axis=0), surface.place - surface.place.mean(axis=0))[0]
        centre = x.mean(axis=0) - turned.apply(surface.place.mean(axis=0))
        moment = np.cross(x - centre, f).sum(axis=0) + seen.torque[k].sum(axis=0)
        moments.append(np.hypot(*moment[:2]))
    assert turned.magnitude() > 0.5 and len(moments) > 10
    assert max(moments) < 0.01 * RADIUS_m * max(recorded.values())


def contact_books(deck):
    """What contacts took less what they hold and turned into heat, in units of the first kinetic energy."""
    c = {name: rows[:, 0] for name, rows in read_ledger(deck / "ledger.bin", 1).column.items()}
    left = (c["wall_work_J"] + c["pair_work_J"] + c["wall_elastic_J"] + c["pair_elastic_J"] + c["wall_damped_J"]
            + c["pair_damped_J"] + c["wall_released_J"] + c["friction_J"] - c["springs_gained_J"])
    return c, left / c["kinetic_J"][0]


@pytest.mark.parametrize("seed", [1, 2])
def test_a_stone_that_spins_without_friction_keeps_its_speed_and_its_spin(tmp_path, seed):
    """The plate pushes it through its middle, however far it turns."""
    spin = 200.0
    deck, surface = deck_of(tmp_path, stone(200, **{"time.free_flight_tolerance": 0.0, "time.duration_s": 4e-4,
                                                    "stones.seed": seed}))
    run_spinning(deck, surface, (0, spin, 0), 50)
    end = frames(deck)
    x, v, m, own = end.x[-1], end.v[-1], end.mass[-1], 0.4 * end.mass[-1] * end.radius[-1] ** 2
    x, speed = x - np.average(x, axis=0, weights=m), np.average(v, axis=0, weights=m)
    moment = (m[:, None] * np.cross(x, v - speed) + own[:, None] * end.omega[-1]).sum(axis=0)
    inertia = np.einsum("i,ijk->jk", m, (x**2).sum(axis=1)[:, None, None] * np.eye(3) - x[:, :, None] * x[:, None, :])
    assert speed[2] == pytest.approx(3.0, rel=0.002)
    assert np.linalg.solve(inertia + own.sum() * np.eye(3), moment)[1] == pytest.approx(spin, rel=0.001)


def test_a_stone_that_rolls_onto_loose_surface_gives_up_its_share_with_the_energy(tmp_path):
    """It spins as it presses, towards sub-spheres of its surface that no bond holds: the patch moves on over them six times
    and each time has less of itself."""
    deck, surface = deck_of(tmp_path, stone(200, **{"time.free_flight_tolerance": 0.0, "time.duration_s": 4e-4}))
    loose = (surface.place[:, 0] > 0.15 * RADIUS_m) & (surface.place[:, 2] < 0) & (surface.is_surface == 1)
    bonds = np.loadtxt(deck / "bonds.txt")
    bonds = bonds[~loose[bonds[:, :2].astype(int) - 1].any(axis=1)]
    np.savetxt(deck / "bonds.txt", bonds, fmt=["%d"] * 3 + ["%.17g"] * 5)
    run_spinning(deck, surface, (0, 400.0, 0), 10)
    c, left = contact_books(deck)
    assert c["wall_released_J"].max() > 0.005 * c["kinetic_J"][0]
    assert np.abs(left).max() < 2e-5
