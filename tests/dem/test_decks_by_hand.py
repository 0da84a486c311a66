"""docs/decks.md: its deck runs as it stands on one rank and on several, and in free flight, with the same motion."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from decks import run_engine
from scenes_of_tests import SCENES

from dem.__main__ import main
from dem.run.energy_balance import read_ledger
from dem.run.recorder import read_forces

PAGE = (SCENES.parent / "docs" / "decks.md").read_text()
BLOCKS = re.findall(r"```(data|liggghts|sh) ?(.*)\n((?:.*\n)*?)```", PAGE)
STONES, DT, G = 2, 5e-7, 9.81
MASS_kg = 4 * 2000 * np.pi / 6 * 9.8e-3**3


def run(directory, ranks=1, free_flight=False):
    directory.mkdir()
    for kind, name, text in BLOCKS:
        if kind == "data":
            (directory / name).write_text(text)
    run_engine(directory, "".join(text for kind, name, text in BLOCKS
                                  if kind == "liggghts" and (free_flight or name != "one rank")), ranks)
    return read_ledger(directory / "ledger.bin", STONES), read_forces(directory / "forces.bin")


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    return run(tmp_path_factory.mktemp("by_hand") / "1")


def test_the_deck_of_the_page_obeys_the_laws_of_motion(alone):
    """The momentum that the plate gives is the integral of the force on it and of the weight; energy comes from nowhere;
    bonds break, and one stone strikes the wall."""
    ledger, forces = alone
    column = {name: values.sum(axis=1) for name, values in ledger.column.items()}
    ends_s = ledger.step * DT
    row_s = 10 * DT
    impulse = np.array([forces.all_mean_N[forces.all_step <= step].sum() * row_s for step in ledger.step])
    gained = column["momentum_z_kg_m_s"] - column["momentum_z_kg_m_s"][0]
    assert impulse[-1] > STONES * MASS_kg * 2
    assert gained == pytest.approx(impulse - impulse[0] - STONES * MASS_kg * G * (ends_s - ends_s[0]), abs=2e-5)
    assert column["broken"][-1] >= 4


@pytest.mark.parametrize("ranks", [2, 4])
def test_the_deck_of_the_page_moves_alike_on_several_ranks(alone, tmp_path, ranks):
    ledger, forces = run(tmp_path / "run", ranks)
    assert np.array_equal(ledger.step, alone[0].step)
    for name, expected in alone[0].column.items():
        assert ledger.column[name] == pytest.approx(expected, abs=1e-9 * np.abs(expected).max()), name
    assert np.array_equal(forces.all_step, alone[1].all_step)
    assert forces.all_mean_N == pytest.approx(alone[1].all_mean_N, abs=1e-9 * alone[1].all_mean_N.max())
