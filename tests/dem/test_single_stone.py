"""One bonded stone on the flexible plate: energy, momentum, breakage, and the files of a run."""

import json
from xml.etree import ElementTree

import meshio
import numpy as np
import pandas as pd
import pytest
from scenes_of_tests import SCENES

from common.scene.scene import changed_scene
from dem.run.run import run_scene

SINGLE = (SCENES.parent / "tests" / "single.toml").read_text()


def run_single(directory, gangue_ratio=0.0, replace=("", "")):
    assert replace[0] in SINGLE
    scene = directory.with_suffix(".toml")
    scene.write_text(SINGLE.replace(*replace, 1))
    return run_scene(changed_scene(scene, {"stones.gangue_ratio": gangue_ratio}), str(scene), directory)


@pytest.fixture(scope="module")
def unbreakable(runs):
    change = ("[stones.agglomerate] ", "[stones.agglomerate]\nunbreakable = true\n")
    return run_single(runs / "unbreakable", replace=change)


@pytest.fixture(scope="module")
def broken(runs):
    """At 4 m/s: at the 3 m/s of the scene coal only cracks."""
    change = ("speed_m_s = 3.0 ", "speed_m_s = 4.0 ")
    return {name: (run_single(runs / name, ratio, change), runs / name) for name, ratio in (("coal", 0.0), ("gangue", 1.0))}


def test_an_unbreakable_stone_rebounds_and_its_energy_closes(unbreakable):
    assert unbreakable["n_bonds_broken"] == 0
    assert 0.5 < unbreakable["rebound_speed_m_s"][0] < 3.0
    assert abs(unbreakable["energy"]["closure"]) < 1e-3
    for name in ("bond_damping_J", "contact_damping_J", "friction_J", "plate_damping_J"):
        assert unbreakable["energy"][name] > 0


def test_impulse_on_the_plate_is_the_momentum_lost(unbreakable, broken):
    """Gravity is the only other force."""
    for summary in (unbreakable, broken["coal"][0], broken["gangue"][0]):
        mass = 4 / 3 * np.pi * 0.025**3 * summary["scene"]["materials"][summary["materials"][0]]["density_kg_m3"]
        weight = mass * summary["scene"]["time"]["gravity_m_s2"] * summary["steps"] * summary["dt_s"]
        assert summary["impulse_N_s"] - weight == pytest.approx(summary["momentum_change_kg_m_s"], rel=1e-9)


def test_coal_breaks_clearly_more_than_gangue(broken):
    coal, gangue = broken["coal"][0], broken["gangue"][0]
    assert coal["n_bonds_broken"] > 2 * gangue["n_bonds_broken"]
    assert coal["n_bonds_broken"] > 0.01 * coal["n_bonds"]
    assert all(abs(s["energy"]["closure"]) < 1e-3 for s in (coal, gangue))


def test_bonds_created_are_the_bonds_generated(broken):
    """What the engine counts as holding at the end is what was generated less the events."""
    summary, directory = broken["coal"]
    events = pd.read_parquet(directory / "breakage.parquet")
    bonds = np.loadtxt(directory / "deck" / "bonds.txt")
    assert len(bonds) == summary["n_bonds"]
    assert len(events) == summary["n_bonds_broken"] == events["bond"].nunique()
    assert set(events["mode"]) <= {"tension", "shear"}
    assert np.all(events["energy_J"] >= 0) and np.all(events["stress_Pa"] > 0)


def test_the_run_directory_holds_what_was_promised(broken):
    summary, directory = broken["coal"]
    assert summary == json.loads((directory / "run.json").read_text())
    signals, fast = (pd.read_parquet(directory / f"{name}.parquet") for name in ("signals", "fast"))
    assert len(signals) == 41 and np.allclose(np.diff(signals["t_s"]), 1.5e-4)
    assert np.diff(fast["t_s"]).max() <= 1e-5
    columns = {"t_s", "u_m", "v_m_s", "a_m_s2", "kinetic_J", "internal_J", "total_J", "force_N", "force_01_N",
               "acc_north_m_s2", "acc_east_m_s2", "rod_1_N", "rod_4_N"}
    assert columns <= set(signals.columns)
    assert list(signals.columns) == list(fast.columns)


def test_view_holds_particles_bonds_and_plate_on_one_time_axis(broken):
    summary, directory = broken["coal"]
    sets = ElementTree.parse(directory / "view.pvd").getroot().findall("./Collection/DataSet")
    times = sorted({float(s.get("timestep")) for s in sets})
    even = np.arange(41) * 1.5e-4
    assert len(times) > 41 and np.all(np.abs(np.array(times)[:, None] - even).min(axis=0) < 1e-9)
    assert all(sum(s.get("part") == part for s in sets) == len(times) for part in "0124")
    last = {s.get("part"): meshio.read(directory / s.get("file")) for s in sets[-5:]}
    assert len(last["0"].points) == summary["n_particles"]
    assert len(last["1"].cells[0].data) == summary["n_bonds"] - summary["n_bonds_broken"]
    assert np.abs(last["2"].point_data["displacement_m"]).max() > 0


def test_the_patches_in_the_view_carry_the_push_on_the_plate(broken):
    """At a picture with contact: the pressure of the patches adds up to the forces of contacts.parquet, which lie under
    the stone, and in the middle of each patch the stress is Hertz' and the plate's own."""
    summary, directory = broken["coal"]
    contacts = pd.read_parquet(directory / "contacts.parquet")
    sets = ElementTree.parse(directory / "view.pvd").getroot().findall("./Collection/DataSet")
    t = contacts.groupby("t_s")["force_N"].sum().idxmax()
    rows = contacts[contacts["t_s"] == t]
    files = {s.get("part"): s.get("file") for s in sets if abs(float(s.get("timestep")) - t) < 1e-8}
    patches, plate = (meshio.read(directory / files[part]) for part in ("3", "2"))
    pressure, number = patches.point_data["pressure_Pa"], patches.point_data["contact"].astype(int) - 1
    centre = np.searchsorted(number, np.arange(len(rows)))
    assert patches.points[centre, :2] == pytest.approx(rows[["x_m", "y_m"]].to_numpy(), rel=6e-8, abs=1e-12)  # single precision
    assert np.abs(rows[["x_m", "y_m"]] - [0.1, 0.0]).to_numpy().max() < 0.025
    for k, row in enumerate(rows.itertuples()):
        of_patch = patches.cells[0].data[number[patches.cells[0].data[:, 0]] == k]
        corner = patches.points[of_patch][:, :, :2]
        u, v = corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]
        area = 0.5 * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
        assert (area * pressure[of_patch].mean(axis=1)).sum() == pytest.approx(row.force_N, rel=0.1)
    total = plate.point_data["von_mises_with_contacts_Pa"]
    assert total.max() >= plate.point_data["von_mises_Pa"].max() > 0
    assert patches.point_data["von_mises_with_contacts_Pa"].max() > 5 * plate.point_data["von_mises_Pa"].max()
    bending = summary["yield"]["bending"]
    assert bending["von_mises_Pa"] >= 0.99 * plate.point_data["von_mises_Pa"][far_from_rods(plate.points)].max()
    assert "no yield stress given" in summary["yield"]["verdict"]
    assert 0 < summary["plate_energy_left_out"] < 1e-4  # 20 kHz for a contact of 234 us


def far_from_rods(points):
    return np.abs(np.abs(points[:, :2]) - 0.2).max(axis=1) > 0.02
