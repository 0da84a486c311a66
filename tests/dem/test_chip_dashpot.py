"""A chip of three sub-spheres that the dashpot of a smooth contact pushes beside its middle.

The chip is thin towards the contact axis, so that a push on the axis turns it as easily as if it had a hundredth of its
mass. A dashpot that is meant for the whole mass would then throw it off; it may stop it within a step at most.
"""

import itertools
import re

import numpy as np
import pytest
from decks import DUMP_NUMBERS, DUMPED, frames, run_engine
from test_smooth_contact import RADIUS_m, stone

from dem.deck.contact import read_contacts
from dem.deck.render import write_deck
from dem.run.energy_balance import read_ledger
from dem.run.prepare import prepare
from dem.stones.contact_patch import PATCH_RADIUS

LOOK_STEPS = 32  # after which the engine finds patches anew
SPEED_m_s = 3.0


def mobility(mass, place):
    """1/kg: speed per impulse along z of a flat rigid body's point at the origin, 1/m + (r x n) . I^-1 (r x n)."""
    center = np.average(place, axis=0, weights=mass)
    x, y = (place - center).T
    inertia = np.array([[mass @ y**2, -mass @ (x * y)], [-mass @ (x * y), mass @ x**2]])
    arm = np.array([-center[1], center[0]])  # (r x n) of r = -center
    return 1 / mass.sum() + arm @ np.linalg.solve(inertia, arm)


def chips(place, mass, bonds):
    """Bonded triples of the patch below the stone, each with a fourth sub-sphere with which the contact axis is among
    them: mobility times mass, triple, fourth."""
    inside = 1 - (place[:, :2] ** 2).sum(axis=1) / (PATCH_RADIUS * RADIUS_m) ** 2
    lowest = np.flatnonzero((place[:, 5] == 1) & (place[:, 2] < 0) & (inside > 0.05)).tolist()
    pairs = {frozenset(pair) for pair in bonds[:, :2].astype(int) - 1}
    for chip in map(list, itertools.combinations(lowest, 3)):
        if sum(frozenset(pair) in pairs for pair in itertools.combinations(chip, 2)) < 2:
            continue
        for other in set(lowest) - set(chip):
            four = [*chip, other]
            rho, weight = place[four, :2], place[four, 3] ** 2 * inside[four]
            share = weight * (1 - rho @ np.linalg.solve((weight[:, None] * rho).T @ rho, weight @ rho))
            if (share > 0.02 * share.sum()).all():
                yield mobility(mass[chip], place[chip, :2]) * mass[chip].sum(), chip, other


def write_chip(deck, number):
    """Makes the number-th chip of a mobility between 100 and 200 the only surface of the stone, and all that moves, with
    its fourth, whose bond breaks at once. Returns the chip and the fourth."""
    surface = (deck / "surface.txt").read_text().splitlines()
    place = np.array([line.split() for line in surface[2:]], dtype=float)
    bonds = np.loadtxt(deck / "bonds.txt")
    found = {tuple(chip): other for factor, chip, other in chips(place, place[:, 4], bonds) if 100 < factor < 200}
    chip, other = sorted(found.items())[number]
    four = [*chip, other]
    lines = [line[:-1] + str(int(k in four)) for k, line in enumerate(surface[2:])]
    (deck / "surface.txt").write_text("\n".join([*surface[:2], *lines]) + "\n")
    ends = [np.isin(bonds[:, :2] - 1, some) for some in (chip, four)]
    kept = bonds[ends[0].all(axis=1) | ~ends[1].any(axis=1)]
    kept[:, 7] = 1e3
    first, second = sorted((chip[1], other))
    weak = [first + 1, second + 1, bonds[0, 2], *(place[second, :3] - place[first, :3]), bonds[:, 6].mean(), 1e-4]
    kept = np.vstack([kept, weak])
    np.savetxt(deck / "bonds.txt", kept[np.lexsort(kept[:, 1::-1].T)], fmt=["%d"] * 3 + ["%.17g"] * 5)
    return list(chip), other, place


def run_chip(directory, number):
    scene = stone(restitution=0.1, **{"time.free_flight_tolerance": 0.0, "time.sample_interval_s": 1e-5,
                                      "stones.agglomerate.unbreakable": False, "time.duration_s": 1e-4})
    prepared = prepare(scene, "scene", directory)
    deck = directory / "deck"
    write_deck(deck, prepared.scene, prepared.assembly, prepared.step, prepared.modes)
    chip, other, place = write_chip(deck, number)
    ids = " ".join(str(tag + 1) for tag in (*chip, other))
    text = re.sub(r" fracture \S+|^fix +monitor .*$", "", (deck / "deck.liggghts").read_text(), flags=re.MULTILINE)
    for old, new in (("all set 0 0 -3.0 units box", f"all set 0 0 0 units box\ngroup chip id {ids}\n"
                      f"velocity chip set 0 0 {-SPEED_m_s} units box"), ("every 30 ", "every 1 "),
                     ("\nrun  ", f'\ndump chip chip custom 1 view.dump id {DUMPED}\n'
                      f'dump_modify chip format "%d{DUMP_NUMBERS}" first yes\nrun  ')):
        assert old in text
        text = text.replace(old, new)
    run_engine(deck, text)
    return deck, prepared.step.dt_s, place[chip], np.searchsorted(sorted((*chip, other)), chip)


def axis_of(place, mass, moved):
    """Where the chip, seen as a rigid body, has the centre of its stone: Kabsch's rotation."""
    middle, now = np.average(place, axis=0, weights=mass), np.average(moved, axis=0, weights=mass)
    u, _, v = np.linalg.svd((mass[:, None] * (place - middle)).T @ (moved - now))
    turn = v.T @ np.diag([1, 1, np.linalg.det(v.T @ u.T)]) @ u.T
    return now - turn @ middle


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 1])
def test_a_dashpot_stops_a_chip_pushed_beside_its_middle_in_one_step_at_most(tmp_path, number):
    deck, dt_s, place, rows = run_chip(tmp_path, number)
    c = {name: values[:, 0] for name, values in read_ledger(deck / "ledger.bin", 1).column.items()}
    energy = c["kinetic_J"] + c["wall_elastic_J"] + c["bond_elastic_J"] + c["wall_released_J"]
    assert c["broken"][LOOK_STEPS] == 1 and c["wall_damped_J"][-1] > 0.1 * energy[0]
    assert np.diff(energy).max() < 1e-5 * energy[0]
    assert np.diff(c["wall_damped_J"]).min() >= -1e-9 * c["wall_damped_J"][-1]  # half a step, where the chip stops

    # When the patch is found without the fourth, the dashpot of the whole mass would stop the axis four times over.
    dumped, mass = frames(deck), place[:, 4]
    k = int(np.flatnonzero(dumped.step == LOOK_STEPS)[0])
    moved, force_N = dumped.x[k, rows], dumped.force[k, rows, 2]
    beside = (moved - axis_of(place[:, :3], mass, moved))[:, :2]
    contacts = read_contacts(deck / "contacts.bin", dt_s)
    elastic_N = contacts["force_N"][(contacts["t_s"] / dt_s).round() == LOOK_STEPS].sum()
    before_m_s = dumped.v[k, rows, 2] - 0.5 * dt_s * force_N / mass  # as when the forces were found
    on_axis_m_s = np.linalg.solve(np.vstack([np.ones(3), beside.T]).T, before_m_s)[0]
    stopped = -(force_N.sum() - elastic_N) * dt_s * mobility(mass, beside) / on_axis_m_s
    assert stopped == pytest.approx(1, rel=0.01)
