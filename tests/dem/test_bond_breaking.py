"""When a bond breaks, against the strength of a round beam; and energy with breakage, agglomerate by agglomerate."""

import csv

import numpy as np
import pytest
from decks import Body, bond_line, chain, deck, fcc_ball, frames, run_engine, write_files

from dem.run.energy_balance import PlateEnergy, energy_ledger, read_ledger, stone_energies

E, RATIO = 5e9, 2.0
LENGTH, RADIUS = 2e-3, 1e-3
AREA, INERTIA = np.pi * RADIUS**2, np.pi * RADIUS**4 / 4
STEPS, DT = 2000, 1e-7


def events(directory):
    with open(directory / "events.csv") as file:
        return list(csv.DictReader(file))


def load_one_bond(directory, freedom, size, squeeze=0.0, along=0.0, strength_factor=1.0, **bond):
    """Move sphere 2 along one freedom (x y z, turn x y z) evenly up to `size`, both spheres too heavy to give way. The
    bond starts shortened by the strain `squeeze`, and is pulled by the share `along` of `size`. Returns the events."""
    body = chain(2)
    write_files(directory, body)
    undeformed = (directory / "bonds.txt").read_text().replace(" 1\n", f" {strength_factor}\n")
    body.center_m[1, 0] -= squeeze * LENGTH
    write_files(directory, body)
    (directory / "bonds.txt").write_text(undeformed)
    moved = ("v" if freedom < 3 else "omega") + "xyz"[freedom % 3]
    velocity = f"set atom 1*2 density 1e40\nset atom 2 {moved} {size / (STEPS * DT)!r}\n"
    velocity += f"set atom 2 vx {along * size / (STEPS * DT)!r}\n" if along else ""
    run_engine(directory, deck(DT, STEPS, STEPS, bonds=bond_line(E, RATIO, **bond), velocity=velocity))
    return events(directory)


# Beam theory: F/A, M r/I, F_s/A with k_s = E A/(ratio L), M_t r/J with k_t = k_s r^2/2; displacement at the strength.
STRENGTH = 1e5
CASES = {
    "pull": (0, STRENGTH * LENGTH / E, "tension", {"tension": STRENGTH}),
    "bend": (5, STRENGTH * LENGTH / (E * RADIUS), "tension", {"tension": STRENGTH}),
    "shear": (1, STRENGTH * RATIO * LENGTH / E, "shear", {"shear": STRENGTH}),
    "twist": (3, STRENGTH * 2 * (RADIUS**4 / 4) * np.pi / RADIUS / (E * AREA / LENGTH / RATIO * RADIUS**2 / 2),
              "shear", {"shear": STRENGTH}),
}


@pytest.mark.parametrize("name", CASES)
def test_a_bond_breaks_at_the_strength_of_a_beam(tmp_path, name):
    """At the step in which beam theory says so, with the mode, stress, place and elastic energy."""
    freedom, critical, mode, bond = CASES[name]
    found = load_one_bond(tmp_path, freedom, 2 * critical, **bond)
    assert len(found) == 1
    event = {key: float(value) for key, value in found[0].items() if key != "mode"}
    assert event["step"] == pytest.approx(STEPS / 2, abs=2)
    assert found[0]["mode"] == mode
    assert event["stress_Pa"] == pytest.approx(STRENGTH, rel=2e-3)
    # Half of load times displacement.
    k_n = E * AREA / LENGTH
    stiffness = {"pull": k_n, "bend": k_n * RADIUS**2 / 4 + k_n / RATIO * LENGTH**2 / 4, "shear": k_n / RATIO,
                 "twist": k_n / RATIO * RADIUS**2 / 2}[name]
    assert event["energy_J"] == pytest.approx(stiffness * critical**2 / 2, rel=5e-3)
    assert event["area_m2"] == pytest.approx(AREA, rel=1e-9)
    assert [event["x_m"], event["y_m"], event["z_m"]] == pytest.approx([LENGTH / 2, 0, 0], abs=1e-3 * LENGTH)


@pytest.mark.parametrize("kernel", ["plain", "auto"])
@pytest.mark.parametrize("name", CASES)
def test_the_strength_factor_of_a_bond_is_on_both_strengths(tmp_path, name, kernel):
    freedom, critical, mode, bond = CASES[name]
    found = load_one_bond(tmp_path, freedom, 6 * critical, strength_factor=3.0, kernel=kernel, **bond)
    assert [event["mode"] for event in found] == [mode]
    assert float(found[0]["step"]) == pytest.approx(STEPS / 2, abs=2)


@pytest.mark.parametrize("tan_friction", [0.0, 0.6])
def test_pressure_holds_shear_back_as_mohr_and_coulomb_say(tmp_path, tan_friction):
    """Shear strength c + tan(phi) p under the pressure p; tan(phi) = 0 is the constant strength."""
    squeeze = 1e-4
    strength = STRENGTH + tan_friction * E * squeeze
    critical = strength * RATIO * LENGTH / E
    found = load_one_bond(tmp_path, 1, 2 * critical, squeeze, shear=STRENGTH, tan_friction=tan_friction)
    assert [event["mode"] for event in found] == ["shear"]
    assert float(found[0]["step"]) == pytest.approx(STEPS / 2, abs=3)


@pytest.mark.parametrize("tan_friction", [0.0, 0.6])
def test_compression_alone_breaks_nothing(tmp_path, tan_friction):
    """Pressed to a stress 5000 times both strengths."""
    size = -5e3 * STRENGTH * LENGTH / E
    assert not load_one_bond(tmp_path, 0, size, tension=STRENGTH, shear=STRENGTH, tan_friction=tan_friction)


def two_balls(directory, damping_time=0.0, tension=2e6, **bond):
    """A ball of 4 and one of 5 layers meet off centre at 8 m/s and break. Returns the bodies as one, and speeds."""
    balls = [fcc_ball(4), fcc_ball(5)]
    balls[1].center_m += [10e-3, 2e-3, 1e-3]
    n = [len(ball.radius_m) for ball in balls]
    body = Body(np.vstack([b.center_m for b in balls]), np.concatenate([b.radius_m for b in balls]),
                np.vstack([balls[0].pair, balls[1].pair + n[0]]), np.concatenate([b.bond_radius_m for b in balls]))
    write_files(directory, body)
    (directory / "agglomerates.txt").write_text(f"{n[0]}\n{n[1]}\n")
    velocity = f"set atom 1*{n[0]} vx 5\nset atom {n[0] + 1}*{sum(n)} vx -3\n"
    dt = 0.1 * np.sqrt(body.mass_kg.min() / (E * AREA / LENGTH))
    run_engine(directory, deck(dt, 2000, 2000, velocity=velocity,
                               bonds=bond_line(E, RATIO, tension=tension, shear=tension, damping_time=damping_time, **bond)))
    return body, np.repeat([5.0, -3.0], n), n


def test_the_ledger_of_each_agglomerate_closes_when_bonds_break(tmp_path):
    """Within 0.1 % of the energy of the impact, the kinetic energies at both ends taken from the spheres themselves; the
    damping of the bonds, measured on its own, takes much more than that."""
    body, speed, n = two_balls(tmp_path, damping_time=2e-8)
    ball = np.repeat([0, 1], n)
    start = np.bincount(ball, 0.5 * body.mass_kg * speed**2)
    parts = stone_energies(read_ledger(tmp_path / "ledger.bin", 2), 0.0, np.zeros(2))
    f = frames(tmp_path)
    end = np.bincount(ball, 0.5 * f.mass[-1] * (f.v[-1] ** 2).sum(1) + 0.2 * f.mass[-1] * f.radius[-1] ** 2
                      * (f.omega[-1] ** 2).sum(1))
    assert parts["kinetic_J"][-1] == pytest.approx(end, rel=1e-9)
    broken = np.bincount([int(event["agglomerate"]) for event in events(tmp_path)], minlength=3)
    assert broken[1] > 10 and broken[2] > 10
    released = np.bincount([int(event["agglomerate"]) for event in events(tmp_path)],
                           [float(event["energy_J"]) for event in events(tmp_path)])[1:]
    assert parts["released_by_breakage_J"][-1] == pytest.approx(released, rel=1e-6)
    for closure in (e["closure"] for e in energy_ledger(parts, PlateEnergy(), start)["by_agglomerate"]):
        assert abs(closure) < 1e-3
    assert parts["bond_damping_J"][-1].sum() > 0.004 * start.sum()
    assert abs(parts["bonds_unexplained_J"][-1].sum()) < 1e-4 * start.sum()


def test_energy_released_is_what_the_bonds_kept_when_nothing_damps(tmp_path):
    """Without dampers the work the bonds took is in them or was in those that broke: the sum over the events."""
    body, speed, _ = two_balls(tmp_path)
    c = {name: values[-1].sum() for name, values in read_ledger(tmp_path / "ledger.bin", 2).column.items()}
    released = sum(float(event["energy_J"]) for event in events(tmp_path))
    impact = 0.5 * (body.mass_kg * speed**2).sum()
    assert released > 5e-3 * impact
    assert -c["bond_work_J"] - c["bond_elastic_J"] == pytest.approx(released, abs=1e-5 * impact)
