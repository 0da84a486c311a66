"""Friction moves the plate in its plane: a sphere that strikes a swaying plate aslant, beside a naive integration."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scenes_of_tests import changed, hertz
from scipy.integrate import solve_ivp
from test_piston_plate import plate_that_moves
from test_smooth_contact import stone

import dem.deck.render
from common.files.cache import user_cache
from dem.run.prepare import prepare
from dem.run.run import run_prepared
from plate_fem.elements.mesh import default_mesh_size
from plate_fem.modes import PlateModes, plate_modes
from plate_fem.solution.eigen import eigenmodes
from plate_fem.solution.model import build_model

SWAYING_kg, SWAY_Hz = 0.5, 500.0
LENGTH_m = 0.5


def swaying():
    """A plate that sways along x and does nothing else: every place of its top face moves alike."""
    lines = np.linspace(-LENGTH_m / 2, LENGTH_m / 2, 5)
    lateral = np.zeros((25, 2, 1))
    lateral[:, 0] = 1 / np.sqrt(SWAYING_kg)
    return PlateModes(
        frequency_Hz=np.array([SWAY_Hz]), damping_ratio=np.zeros(1), lines_x_m=lines, lines_y_m=lines,
        nodal=np.zeros((4, 25, 1)), mean_shape=np.zeros(1), rod_force=np.zeros((0, 1)),
        surface_stress=np.zeros((25, 3, 1)), mass_kg=SWAYING_kg, theory="mindlin", n_residual=0, lateral=lateral)


def strike_aslant(monkeypatch, directory, scene, velocity_m_s, modes=None):
    """Run a scene whose stones come along x, or x and y, too; their speed is that of the scene."""
    render, (x, y, *_), z = dem.deck.render.render, (*velocity_m_s[:-1], 0.0), velocity_m_s[-1]

    def aslant(*given):
        text, straight = render(*given), f"all set 0 0 {-scene.stones.speed_m_s}"
        assert straight in text
        return text.replace(straight, f"all set {x} {y} {z}")
    monkeypatch.setattr(dem.deck.render, "render", aslant)
    model = prepare(scene, "aslant", user_cache())
    if modes is not None:
        model.modes = modes
    return run_prepared(model, directory)


def inertia_about_y(body):
    """Over m R^2: 0.4 of a solid sphere, less of a packing whose sub-spheres fill it unevenly."""
    mass, x = body.mass_kg, body.center_m - body.mass_kg @ body.center_m / body.mass_kg.sum()
    return (mass * (x[:, 0]**2 + x[:, 2]**2 + 0.4 * body.radius_m**2)).sum() / (mass.sum() * 0.025**2)


def naive(friction, velocity_m_s, duration_s, is_smooth, inertia=0.4, dt_s=2e-8):
    """Sphere of the `inertia` m R^2 on Hertz' spring with Mindlin's spring across it, 8 G* sqrt(R d), up to Coulomb's
    limit; the plate is an oscillator. The spring of a smooth stone keeps its force as it stiffens, that of LIGGGHTS'
    sphere its stretch. Returns the plate's energy, and the sphere's, J."""
    sphere, radius = hertz("coal"), 0.025
    bodies = changed("hertz_coal", {})
    shear = 1 / sum(2 * (2 - b.poisson_ratio) * (1 + b.poisson_ratio) / b.youngs_modulus_Pa
                    for b in (bodies.materials["coal"], bodies.plate))
    mass, omega = sphere["mass_kg"], 2 * np.pi * SWAY_Hz
    z, (v_x, v_z), spin, stretch, sway, rate, spring = 2e-5, velocity_m_s, 0.0, 0.0, 0.0, 0.0, 0.0
    for _ in range(int(duration_s / dt_s)):
        z += dt_s * v_z
        sway += dt_s * rate
        push = drag = 0.0
        if z < 0:
            arm = radius + z / 2
            push = sphere["stiffness"] * (-z) ** 1.5
            spring, before = 8 * shear * np.sqrt(radius * -z), spring
            stretch *= min(1, before / spring) if is_smooth else 1
            stretch += dt_s * (v_x - spin * arm - rate)
            stretch = np.clip(stretch, -friction * push / spring, friction * push / spring)
            drag = -spring * stretch
            spin -= dt_s * drag * arm / (inertia * mass * radius**2)
        v_z += dt_s * push / mass
        v_x += dt_s * drag / mass
        rate -= dt_s * (drag / SWAYING_kg + omega**2 * sway)
    return (0.5 * SWAYING_kg * (rate**2 + (omega * sway) ** 2),
            0.5 * mass * (v_x**2 + v_z**2) + 0.5 * inertia * mass * (radius * spin) ** 2)


@pytest.mark.parametrize(("friction", "velocity_m_s", "seeds", "within"), [
    (0.1, (3.0, -3.0), (), 0.003), (0.5, (0.4, -3.0), (), 0.003), (0.1, (3.0, -3.0), (100,), 0.02),
    (0.5, (1.0, -3.0), (100, 101), 0.15),
    pytest.param(0.5, (1.0, -3.0), range(100, 124), 0.05, marks=pytest.mark.validate)],
    ids=["slides", "sticks", "bonded stone slides", "bonded stone sticks", "bonded stones stick"])
def test_a_sphere_drags_a_plate_that_sways(tmp_path, monkeypatch, friction, velocity_m_s, seeds, within):
    """A bonded stone that sticks does so on average: what drags then is the square of an impulse that changes sign."""
    plate = changed("single", {}).plate.model_copy(update={"max_frequency_Hz": 2000.0}).model_dump(mode="json")
    spheres = {} if seeds else {"stones.agglomerate": None}
    found = []
    for seed in seeds or (1,):
        scene = stone(speed_m_s=float(np.hypot(*velocity_m_s)), friction=friction, plate=plate,
                      **{"time.duration_s": 4e-4, "time.sample_interval_s": 4e-5, "stones.seed": seed} | spheres)
        body = prepare(scene, "aslant", user_cache()).assembly
        of_plate, of_sphere = naive(friction, velocity_m_s, 4e-4, bool(seeds), inertia_about_y(body))
        with monkeypatch.context() as patched:
            energy = strike_aslant(patched, tmp_path / f"run_{seed}", scene, velocity_m_s, swaying())["energy"]
        assert energy["given_to_plate_J"] == pytest.approx(energy["plate_work_J"], rel=1e-3)
        assert abs(energy["closure"]) < 1e-4
        assert energy["kinetic_J"] == pytest.approx(of_sphere, rel=6e-3 if seeds else 1e-4)
        found.append(energy["plate_work_J"] / of_plate)
    assert np.mean(found) == pytest.approx(1, abs=within)
    if len(found) > 2:
        assert 2 * np.std(found, ddof=1) / np.sqrt(len(found)) < within


def test_a_stone_whose_bonds_give_more_than_its_contact_keeps_its_energy(tmp_path, monkeypatch):
    """At 60 m/s Mindlin's spring is stiffer than the bonds beneath it."""
    scene = stone(200, speed_m_s=float(np.hypot(60, 60)), friction=1.0, **{"time.duration_s": 1.5e-4})
    energy = strike_aslant(monkeypatch, tmp_path / "run", scene, (60.0, -60.0))["energy"]
    assert abs(energy["closure"]) < 2e-3 and energy["friction_J"] > 0.05 * energy["impact_J"]


def test_a_strong_dashpot_across_the_contact_makes_the_stone_roll(tmp_path, monkeypatch):
    """Coulomb's limit is far, so a sphere leaves rolling, with 5/7 of its energy along the plate; it was the members of
    the patch that a step of the dashpot threw back faster than they came."""
    along, down, restitution = 0.3, 3.0, 0.06
    scene = stone(speed_m_s=float(np.hypot(along, down)), restitution=restitution, friction=0.4,
                  **{"time.duration_s": 1.2e-3})
    found = strike_aslant(monkeypatch, tmp_path / "run", scene, (along, -down))
    energy, rebound_m_s = found["energy"], found["rebound_speed_m_s"][0]
    assert abs(energy["contacts_unexplained_J"]) < 5e-5 * energy["impact_J"]
    assert rebound_m_s == pytest.approx(restitution * down, rel=0.02)
    before, after = 0.5 * hertz("coal")["mass_kg"] * np.square([along, rebound_m_s])
    assert (energy["kinetic_J"] - after) / before == pytest.approx(5 / 7, rel=0.12)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_sphere_that_slides_feels_the_plate_beneath_it(tmp_path, monkeypatch, axis):
    """It strikes a plate whose one mode grows with the square of the way it slides: a naive integration takes the shape at
    every instant."""
    down_m_s, along_m_s, start_m, duration_s, gap_m = 3.0, 30.0, 0.05, 3e-4, 2e-5
    places = plate_that_moves().node_m[:, axis]
    per_m2 = 400 / np.sqrt(SWAYING_kg)
    nodal = np.zeros((4, 25, 1))
    nodal[0, :, 0], nodal[1 + axis, :, 0] = per_m2 * places**2, 2 * per_m2 * places
    scene = changed("elastic_plate", {
        "stones.positions_m": [[start_m, 0.0] if axis == 0 else [0.0, start_m]],
        "stones.speed_m_s": float(np.hypot(along_m_s, down_m_s)), "stones.gap_m": gap_m, "time.gravity_m_s2": None,
        "plate.sensors": None, "plate.rods": None, "plate.max_frequency_Hz": 2000.0, "time.duration_s": duration_s, "time.sample_interval_s": 3e-5})
    velocity = (along_m_s, -down_m_s) if axis == 0 else (0.0, along_m_s, -down_m_s)
    runs = []
    for grid in (0.4, 0.04):  # of a mesh of 125 mm; cubics are exact on either; on the finer one slopes reach a tenth as far
        with monkeypatch.context() as patch:
            patch.setattr(dem.deck.render, "SHAPE_GRID", grid)
            modes = replace(plate_that_moves(), nodal=nodal)
            runs.append(strike_aslant(patch, tmp_path / f"grid_{grid}", scene, velocity, modes))
    found, finer = runs
    assert found["energy"]["plate_work_J"] == pytest.approx(finer["energy"]["plate_work_J"], rel=1e-4)
    assert found["rebound_speed_m_s"][0] == pytest.approx(finer["rebound_speed_m_s"][0], abs=1e-4 * down_m_s)
    stiffness, mass = hertz("gangue")["stiffness"], hertz("gangue")["mass_kg"]

    def rates(t, y):
        shape = per_m2 * (start_m + along_m_s * t) ** 2
        push = stiffness * max(shape * y[2] - y[0], 0.0) ** 1.5
        return [y[1], push / mass, y[3], -shape * push]
    end = solve_ivp(rates, (0, duration_s), [gap_m, -down_m_s, 0, 0], rtol=1e-9, atol=1e-12, max_step=1e-6).y[:, -1]
    assert found["energy"]["plate_work_J"] == pytest.approx(0.5 * end[3] ** 2, rel=1e-3)
    assert found["rebound_speed_m_s"][0] == pytest.approx(end[1], abs=1e-3 * down_m_s)


@pytest.mark.validate
def test_top_face_moves_as_sway_yaw_and_rotation_say():
    """At places between the nodes of a plate on unlike rods, beside the splines' own displacement.

    The mesh is half as wide: beside a rod cubics through the nodes of the default mesh are 6e-4 off.
    """
    plate = changed("single", {}).plate
    thicker = plate.rods[0].model_copy(update={"diameter_m": 0.03})
    plate = plate.model_copy(update={"max_frequency_Hz": 600.0, "rods": (thicker, *plate.rods[1:])})
    plate = plate.model_copy(update={"mesh_size_m": default_mesh_size(plate) / 2})
    modes, model = plate_modes(plate), build_model(plate)
    x, y = np.linspace(-0.24, 0.24, 5), np.linspace(-0.2, 0.23, 4)
    vectors = model.expansion @ eigenmodes(model.parts, 600.0)[1].toarray()
    places = np.array([(a, b) for a in x for b in y])
    for axis in (0, 1):
        exact = (model.system.lateral(places, axis, plate.thickness_m / 2) @ vectors).reshape(5, 4, -1)
        found = modes.lateral_grid(x, y, axis)
        assert np.abs(np.abs(found) - np.abs(exact)).max() < 1e-4 * np.abs(exact).max()


@pytest.mark.parametrize(("changes", "within"), [
    ({"friction": 0.1}, 1e-4), ({"friction": 1.0}, 1e-4), ({"friction": 0.3, "restitution": 0.5}, 2e-3),
    ({"friction": 0.1, "materials.coal.contact_strength_Pa": 100e6}, 1e-4)],
    ids=["slides", "sticks", "damped", "crushes"])
def test_all_that_the_patch_of_a_stone_holds_and_takes_adds_up_at_every_instant(tmp_path, monkeypatch, changes, within):
    """At 45 degrees: kinetic energy, that of patch, spring and bonds, dashpots, friction and crushing."""
    scene = stone(200, speed_m_s=float(np.hypot(3.0, 3.0)), **changes, **{"time.duration_s": 5e-4, "time.sample_interval_s": 1e-5})
    strike_aslant(monkeypatch, tmp_path / "run", scene, (3.0, -3.0))
    table = pd.read_parquet(tmp_path / "run" / "energy.parquet")
    parts = table.drop(columns=["t_s", "agglomerate", "contacts_unexplained_J"]).sum(axis=1)
    assert table["contact_elastic_J"].max() > 0.1 * parts.iloc[0]
    assert table["friction_J"].diff().min() > -1e-9 * parts.iloc[0] and (table["contact_springs_J"] == 0).all()
    assert parts.to_numpy() == pytest.approx(parts.iloc[0], abs=within * parts.iloc[0])


@pytest.mark.parametrize(("restitution", "least", "most"), [(1.0, 0.98, 1.02), (0.3, 0.8, 1.0)])
def test_a_sliding_stone_is_rubbed_by_all_that_it_pushes_with(tmp_path, monkeypatch, restitution, least, most):
    """Coulomb's law counts the dashpot's push: friction takes mu F v_slip, and v_slip falls by mu F (1/m + R^2/I), F being
    the push in the record. So goes its share over time. A dashpot presses at once, and shakes the bonds, which take some."""
    friction, along, mass = 0.05, 3.0, hertz("coal")["mass_kg"]
    scene = stone(200, speed_m_s=float(np.hypot(along, 3.0)), restitution=restitution, friction=friction,
                  **{"time.duration_s": 4e-4, "time.sample_interval_s": 1e-5})
    strike_aslant(monkeypatch, tmp_path / "run", scene, (along, -3.0))
    inertia = inertia_about_y(prepare(scene, "aslant", user_cache()).assembly)
    fast = pd.read_parquet(tmp_path / "run" / "fast.parquet")
    impulse = np.cumsum(fast["force_N"].to_numpy()) * (fast["t_s"][1] - fast["t_s"][0])
    slip = along - (1 + 1 / inertia) * friction * impulse / mass
    taken = np.cumsum(friction * np.diff(impulse, prepend=0) * slip)
    table = pd.read_parquet(tmp_path / "run" / "energy.parquet")
    found, expected = table["friction_J"].to_numpy(), np.interp(table["t_s"], fast["t_s"], taken)
    slides = table["t_s"] > 2.5e-5  # before, the spring was stretched
    assert (found / found[-1])[slides] == pytest.approx((expected / expected[-1])[slides], abs=0.05)
    assert least * expected[-1] < found[-1] < most * expected[-1]
