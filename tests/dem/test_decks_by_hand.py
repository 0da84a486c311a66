"""docs/deck: it runs as it stands on one rank and on several, and in free flight, with the same motion."""

import shutil
import subprocess
import sys

import numpy as np
import pytest
from decks import run_engine
from scenes_of_tests import SCENES

from dem.run.energy_balance import read_ledger
from dem.run.results import read_forces

FILES = SCENES.parent / "docs" / "deck"
STONES, DT, G = 2, 5e-7, 9.81
MASS_kg = 4 * 2000 * np.pi / 6 * 9.8e-3**3


def run(directory, variants=(), changes=(), ranks=1):
    """What the engine wrote of the deck, with the lines of these variants and some words replaced."""
    shutil.copytree(FILES, directory)
    if "stream" in variants:
        subprocess.run([sys.executable, "stones.py"], cwd=directory, check=True)
    deck = (directory / "deck.liggghts").read_text()
    for old, new in {**dict(changes), **{f"#{variant} ": "" for variant in variants}}.items():
        assert old in deck
        deck = deck.replace(old, new)
    run_engine(directory, deck, ranks)
    return read_ledger(directory / "ledger.bin", STONES), read_forces(directory / "forces.bin")


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    directory = tmp_path_factory.mktemp("by_hand") / "run"
    return *run(directory), directory


def test_the_deck_obeys_the_laws_of_motion(alone):
    """The momentum that the plate gives is the integral of the force on it and of the weight; energy comes from nowhere;
    bonds break, and one stone strikes the wall."""
    ledger, forces, directory = alone
    column = {name: values.sum(axis=1) for name, values in ledger.column.items()}
    row_s = 10 * DT
    wall = np.fromfile(directory / "side.bin", dtype=[("step", "<i8"), ("force_N", "<f8", 3)])
    pushed_N = np.array([forces.all_mean_N[forces.all_step <= step].sum() - wall["force_N"][wall["step"] <= step, 2].sum()
                         for step in ledger.step])
    change = {"gained": column["momentum_z_kg_m_s"], "given": row_s * pushed_N - STONES * MASS_kg * G * DT * ledger.step}
    # The force on the wall is a mean over steps without their halves at its ends, which matter while it is pushed.
    free = ~np.isin(ledger.step, wall["step"])
    gained, given = (values[free] - values[0] for values in change.values())
    assert gained == pytest.approx(given, abs=1e-9 * gained.max())
    assert len(wall) > 10 and gained[-1] > STONES * MASS_kg * 2
    assert column["broken"][-1] >= 4


@pytest.mark.parametrize("ranks", [2, pytest.param(4, marks=pytest.mark.validate)])
def test_the_deck_moves_alike_on_several_ranks(alone, tmp_path, ranks):
    ledger, forces = run(tmp_path / "run", ranks=ranks)
    assert np.array_equal(ledger.step, alone[0].step)
    for name, expected in alone[0].column.items():
        assert ledger.column[name] == pytest.approx(expected, abs=1e-9 * np.abs(expected).max()), name
    assert np.array_equal(forces.all_step, alone[1].all_step)
    assert forces.all_mean_N == pytest.approx(alone[1].all_mean_N, abs=1e-9 * alone[1].all_mean_N.max())


def assert_same_strike(expected, found, stone, tolerance, late_steps=0):
    """The first pushes of a stone on the plate, up to the largest."""
    (step, push), (found_step, found_push) = ((p.step[p.stone == stone][:10], p.mean_N[p.stone == stone][:10])
                                              for p in (expected, found))
    assert np.array_equal(found_step, step + late_steps)
    assert found_push == pytest.approx(push, abs=tolerance * push.max())


def test_the_deck_strikes_alike_in_free_flight(alone, tmp_path):
    """To round-off until one has struck the wall, after which its vibration is frozen as it flies again."""
    ledger, forces = run(tmp_path / "run", ("flight",))
    assert_same_strike(alone[1], forces, 0, 1e-9)
    assert_same_strike(alone[1], forces, 1, 1e-4)
    assert ledger.column["kinetic_J"][-1].sum() == pytest.approx(alone[0].column["kinetic_J"][-1].sum(), rel=1e-3)


def test_the_stones_come_and_strike_one_by_one(alone, tmp_path):
    """The first as if all were there from the start, the second so many steps later as it enters."""
    changes = {"read_data": "#", "velocity  ": "#", "bonds bonds.txt": "bonds none", "impact_J 0.02464": "impact_J 0",
               "height_kg_m 7.3e-5": "height_kg_m 0"}
    _, forces = run(tmp_path / "run", ("flight", "stream"), changes)
    assert_same_strike(alone[1], forces, 0, 1e-9)
    assert_same_strike(alone[1], forces, 1, 1e-4, late_steps=3000)
