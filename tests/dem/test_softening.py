"""Bonds that soften over a fracture energy (docs/bonds.md)."""

import numpy as np
import pytest
from decks import bond_line, deck, fcc_ball, ledger, run_engine, write_files
from test_bond_breaking import AREA, CASES, LENGTH, RATIO, STEPS, STRENGTH, E, events, load_one_bond, two_balls

from dem.run.energy_balance import PlateEnergy, energy_ledger, read_ledger, stone_energies

STORED_J_m2 = {"pull": STRENGTH**2 * LENGTH / (2 * E), "shear": STRENGTH**2 * LENGTH * RATIO / (2 * E),
               "twist": STRENGTH**2 * LENGTH * RATIO / (4 * E)}  # over the section, at the strength


@pytest.mark.parametrize("kernel", ["plain", "sse2", "auto"])
@pytest.mark.parametrize("name", STORED_J_m2)
def test_a_bond_takes_its_fracture_energy_to_break(tmp_path, name, kernel):
    """Loaded in proportion it breaks where the triangle of force over displacement has the area G A: at the strain of
    the strength times G over what it stores there."""
    freedom, critical, mode, bond = CASES[name]
    ratio = 3.0
    found = load_one_bond(tmp_path, freedom, 2 * ratio * critical, kernel=kernel, fracture=ratio * STORED_J_m2[name],
                          **bond)
    assert [event["mode"] for event in found] == [mode]
    assert float(found[0]["step"]) == pytest.approx(STEPS / 2, abs=2)
    assert float(found[0]["energy_J"]) == pytest.approx(ratio * STORED_J_m2[name] * AREA, rel=1e-2)
    assert float(found[0]["area_m2"]) == pytest.approx(AREA, rel=1e-8)


@pytest.mark.parametrize("kernel", ["plain", "auto"])
def test_a_stronger_bond_takes_the_square_of_its_factor(tmp_path, kernel):
    """With f on the strength and f^2 on the fracture energy it yields and breaks at f times the displacement."""
    freedom, critical, mode, bond = CASES["pull"]
    ratio, factor = 3.0, 1.5
    found = load_one_bond(tmp_path, freedom, 2 * factor * ratio * critical, strength_factor=factor, kernel=kernel,
                          fracture=ratio * STORED_J_m2["pull"], **bond)
    assert [event["mode"] for event in found] == [mode]
    assert float(found[0]["step"]) == pytest.approx(STEPS / 2, abs=2)
    assert float(found[0]["energy_J"]) == pytest.approx(factor**2 * ratio * STORED_J_m2["pull"] * AREA, rel=1e-2)


@pytest.mark.parametrize("kernel", ["plain", "auto"])
def test_a_bond_of_mohr_and_coulomb_takes_its_fracture_energy_too(tmp_path, kernel):
    """Sheared and pulled by half as much: |F_s| + tan(phi) F_n reaches the cohesion at the displacement y below."""
    ratio, tan_friction, along = 3.0, 0.6, 0.5
    k_n = E * AREA / LENGTH
    y = STRENGTH * AREA / (k_n / RATIO + tan_friction * k_n * along)
    stored = 0.5 * (k_n / RATIO * y**2 + k_n * (along * y) ** 2)
    found = load_one_bond(tmp_path, 1, 2 * ratio * y, along=along, kernel=kernel, shear=STRENGTH,
                          tan_friction=tan_friction, fracture=ratio * stored / AREA)
    assert [event["mode"] for event in found] == ["shear"]
    assert float(found[0]["step"]) == pytest.approx(STEPS / 2, abs=2)
    assert float(found[0]["energy_J"]) == pytest.approx(ratio * stored, rel=1e-2)


@pytest.mark.parametrize("kernel", ["plain", "auto"])
def test_pressure_that_would_strengthen_does_nothing_in_tension(tmp_path, kernel):
    """A bond that is pulled has a negative mean pressure, which neither strengthens nor weakens it as it softens."""
    freedom, critical, _, bond = CASES["pull"]
    found = load_one_bond(tmp_path, freedom, 6 * critical, kernel=kernel, fracture=3 * STORED_J_m2["pull"],
                          dilatation=(0.0, 2.0, 0.0), **bond)
    assert float(found[0]["step"]) == pytest.approx(STEPS / 2, abs=2)
    assert float(found[0]["energy_J"]) == pytest.approx(3 * STORED_J_m2["pull"] * AREA, rel=1e-2)


def test_a_bond_that_stores_more_than_its_fracture_energy_snaps(tmp_path):
    freedom, critical, _, bond = CASES["pull"]
    found = load_one_bond(tmp_path, freedom, 2 * critical, fracture=0.5 * STORED_J_m2["pull"], **bond)
    assert float(found[0]["step"]) == pytest.approx(STEPS / 2, abs=2)
    assert float(found[0]["energy_J"]) == pytest.approx(STORED_J_m2["pull"] * AREA, rel=5e-3)


@pytest.mark.parametrize("damping_time", [0.0, 2e-8])
def test_the_ledger_closes_when_bonds_soften(tmp_path, damping_time):
    """Within 0.1 % of the energy of the impact, with bonds that have softened and hold, and more that broke."""
    tension = 2e6
    stored = tension**2 * LENGTH / (2 * E)
    body, speed, n = two_balls(tmp_path, damping_time, tension, fracture=3 * stored, dilatation=(1.5e9, 2.0, 0.0))
    start = np.bincount(np.repeat([0, 1], n), 0.5 * body.mass_kg * speed**2)
    parts = stone_energies(read_ledger(tmp_path / "ledger.bin", 2), 0.0, np.zeros(2))
    spent = sum(float(event["energy_J"]) for event in events(tmp_path))
    released = parts["released_by_breakage_J"][-1].sum()
    assert 0.01 * start.sum() < spent < (1 - 1e-4) * released
    for closure in (e["closure"] for e in energy_ledger(parts, PlateEnergy(), start)["by_agglomerate"]):
        assert abs(closure) < 1e-3
    if not damping_time:
        c = {name: values[-1].sum() for name, values in read_ledger(tmp_path / "ledger.bin", 2).column.items()}
        assert -c["bond_work_J"] - c["bond_elastic_J"] == pytest.approx(released, abs=1e-4 * start.sum())


def test_all_kernels_soften_alike(tmp_path):
    """What has been spent when a third of the bonds of a ball that is torn apart have yielded."""
    found = {}
    for kernel in ("plain", "sse2", "auto"):
        directory = tmp_path / kernel
        directory.mkdir()
        body = fcc_ball(3)
        write_files(directory, body)
        velocity = "variable vx atom x*2000\nvelocity all set v_vx 0 0\n"
        dt = 0.1 * np.sqrt(body.mass_kg.min() / (E * AREA / LENGTH))
        run_engine(directory, deck(dt, 300, 300, velocity=velocity, bonds=bond_line(
            E, RATIO, tension=2e6, shear=2e6, kernel=kernel, fracture=4.0, dilatation=(1.5e9, 2.0, 0.0))))
        column = ledger(directory).column
        found[kernel] = column["released_J"][-1].sum(), column["broken"][-1].sum()
    assert found["plain"][0] > 0
    for kernel in ("sse2", "auto"):
        assert found[kernel] == pytest.approx(found["plain"], rel=1e-6)
