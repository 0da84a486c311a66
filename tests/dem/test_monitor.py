"""A run that goes wrong ends with the limit it broke; nothing is lost in silence."""

import subprocess

import numpy as np
import pandas as pd
import pytest
from decks import HEAD, MATERIAL, bond_line, chain, deck, fcc_ball, write_files
from scenes_of_tests import changed

import dem.deck.time_step
from dem.coupling.launch import ENGINE
from dem.run.energy_balance import Unstable, check_closure
from dem.run.run import RunError, run_scene
from lab.accuracy.stability import build, cases

STONE = {"plate": {"size_m": [0.5, 0.5], "density_kg_m3": 7830.0, "youngs_modulus_Pa": 2.07e11,
                   "poisson_ratio": 0.3},
         "stones.agglomerate.subspheres": 60, "stones.agglomerate.contact": "sub_spheres",
         "stones.agglomerate.unbreakable": True, "time.view_interval_s": None,
         "time.duration_s": 6e-4}


@pytest.mark.parametrize("sample_s, limit", [(8.53e-5, "limit of energy"), (1.17e-4, "limit of displacement")])
def test_a_step_that_the_bonds_do_not_bear(tmp_path, monkeypatch, sample_s, limit):
    """30 steps a sample: 0.63 t0, which is just unstable, and 0.86 t0."""
    monkeypatch.setattr(dem.deck.time_step, "BOND_FRACTION", 1.0)
    monkeypatch.setattr(dem.deck.time_step, "DAMPED_SHARE", 9.0)
    monkeypatch.setattr(dem.deck.time_step, "RAYLEIGH_FRACTION", 10.0)
    with pytest.raises(RunError, match=limit):
        run_scene(changed("single", STONE | {"time.sample_interval_s": sample_s}), "single.toml", tmp_path / "run")
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("damping", [1.0])
def test_the_step_of_damped_bonds_is_short_enough(tmp_path, monkeypatch, damping):
    """Bonds up to critically damped: the energy closes at the step chosen, and not at the step of undamped bonds."""
    scene = changed("single", STONE | {"stones.agglomerate.damping_ratio": damping, "time.sample_interval_s": 5e-5})
    energy = run_scene(scene, "single.toml", tmp_path / "run")["energy"]
    assert abs(energy["closure"]) < 1e-3 and energy["bond_damping_J"] > 0
    monkeypatch.setattr(dem.deck.time_step, "DAMPED_SHARE", 9.0)
    with pytest.raises(RunError, match="limit"):
        run_scene(scene, "single.toml", tmp_path / "long")


@pytest.mark.slow
def test_a_co_step_that_plate_and_contact_do_not_bear(tmp_path, monkeypatch):
    """The heavy sphere on the thin plate of test_coupling, ten times beyond the limit of its dashpot."""
    monkeypatch.setattr(dem.deck.time_step, "DASHPOT_SHARE", 1.5)
    monkeypatch.setattr(dem.deck.time_step, "STIFFNESS_SHARE", 2.0)
    monkeypatch.setattr(dem.deck.time_step, "CO_STEPS_IN_CONTACT", 5)
    scene = changed("elastic_plate", {
        "time.duration_s": 0.003, "time.gravity_m_s2": 9.8, "stones.speed_m_s": 0.5, "plate.thickness_m": 0.002,
        "plate.max_frequency_Hz": 2000.0, "materials.gangue.density_kg_m3": 20000.0,
        "contacts.gangue_plate": {"restitution": 0.5, "friction": 0.0}})
    with pytest.raises(RunError, match="limit"):
        run_scene(scene, "elastic_plate.toml", tmp_path / "run")


@pytest.mark.slow
def test_what_tangential_springs_gain_is_not_taken_for_an_error(tmp_path):
    """With strong friction and no dashpot, springs whose stiffness rises with the normal force gain over 1 % of the energy
    for a while. The ledger counts that, and closes."""
    case = next(case for case in cases() if case.name == "combined 65")
    energy = run_scene(build(case.settings), case.name, tmp_path / "run")["energy"]
    table = pd.read_parquet(tmp_path / "run" / "energy.parquet")
    assert -table.groupby("t_s")["contact_springs_J"].sum().min() > 0.01 * energy["supplied_J"]
    assert abs(energy["closure"]) < 2e-3


@pytest.mark.parametrize("share, limit", [(0.9, True), (1.1, False)])
def test_energy_that_broken_bonds_release_counts(tmp_path, share, limit):
    """A bond is stretched from the start, which nobody supplied, and breaks at once: k d^2/2 against 1 % of the impact."""
    body, stretched_m, modulus = chain(2), 1e-6, 5e9
    write_files(tmp_path, body)
    bonds = (tmp_path / "bonds.txt").read_text()
    (tmp_path / "bonds.txt").write_text(bonds.replace("0.002 0 0", f"{2e-3 - stretched_m!r} 0 0"))
    energy_J = 0.5 * modulus * np.pi * 1e-6 / (2e-3 - stretched_m) * stretched_m**2
    impact_J = float(share * 100 * energy_J)
    monitor = f"fix monitor all monitor impact_J {impact_J!r} weight 0 height_kg_m 0\n"
    along = f"velocity all set 0 {float(np.sqrt(2 * impact_J / body.mass_kg.sum()))!r} 0 units box\n"
    (tmp_path / "deck").write_text(deck(1e-8, 100, 10, bonds=bond_line(modulus, tension=1.0, shear=1.0), lines=monitor,
                                        velocity=along))
    done = subprocess.run([str(ENGINE), "-in", "deck"], cwd=tmp_path, capture_output=True, text=True,
                          errors="replace", check=False)
    assert ("if half the time step gives less, the step is too long" in done.stdout + done.stderr) == (done.returncode != 0) == limit, done.stdout[-500:]
    assert limit or (tmp_path / "events.csv").read_text().count("\n") == 2  # its head, and the bond


@pytest.mark.parametrize("speed, lists", [("1e6", "yes"), ("nan", "yes"), ("nan", "no")])
def test_a_sub_sphere_that_runs_away(tmp_path, speed, lists):
    """Also where lists of neighbours are built at every step, since stock LIGGGHTS cannot sort what is nowhere."""
    body = fcc_ball(2)
    write_files(tmp_path, body)
    (tmp_path / "deck").write_text(HEAD + "read_data atoms.data\n" + MATERIAL + f"""timestep 1e-7
fix ledger all ledger agglomerates agglomerates.txt every 100 file ledger.bin
fix monitor all monitor impact_J 1 weight 0 height_kg_m 0
fix motion all nve/sphere
variable speed equal {"1e308*10-1e308*10" if speed == "nan" else speed}
velocity all set 0 0 -1 units box
velocity all set NULL NULL v_speed units box
neigh_modify delay 0 every 1 check {lists}
thermo 100
thermo_modify lost error
run 1000
""")
    done = subprocess.run([str(ENGINE), "-in", "deck"], cwd=tmp_path, capture_output=True, text=True,
                          errors="replace", check=False)
    assert done.returncode != 0
    assert "limit of displacement" in done.stdout + done.stderr, done.stdout[-500:]


@pytest.mark.parametrize("closure", [0.011, -0.5, np.nan])
def test_a_ledger_that_does_not_close(closure):
    """It says where."""
    energy = {"closure": closure, "supplied_J": 2.0, "bonds_unexplained_J": 0.004, "contacts_unexplained_J": -0.03}
    with pytest.raises(Unstable, match="limit is 1%: -0.20% in the bonds, 1.50% in the contacts"):
        check_closure(energy)
