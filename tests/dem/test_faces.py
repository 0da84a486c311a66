"""Stones that press on the plate with their flat faces: closed forms, energy, and runs that stop, come late or share
ranks."""

import re
from dataclasses import replace

import meshio
import numpy as np
import pandas as pd
import pytest
from decks import run_engine
from scenes_of_tests import SCENES, changed
from scipy.spatial import ConvexHull, cKDTree
from scipy.spatial.transform import Rotation

from common.scene.scene import read_scene
from common.tables import InputError
from dem.deck.contact import column_stiffness_N_m, stiffest_face_N_m
from dem.deck.render import write_deck
from dem.run.energy_balance import read_ledger
from dem.run.prepare import prepare
from dem.run.run import Stopped, resume, run_scene
from dem.stones.assembly import assemble
from dem.stones.contact_patch import FaceColumns, _owner
from dem.stones.packing import Packing, SphereContainer

SIDE_m, SPEED_m_s = 0.04, 0.5
ALL = "stones.count stones.radius_m stones.positions_m stones.speed_m_s stones.gangue_order stones.gangue_ratio".split()
RIGID = {"size_m": [0.5, 0.5], "density_kg_m3": 7830.0, "youngs_modulus_Pa": 2.07e11,
         "poisson_ratio": 0.3}
E_Pa, NU, DENSITY_kg_m3 = 5.12e9, 0.3, 1380.0  # of coal


@pytest.fixture(scope="module")
def cube_file(tmp_path_factory):
    points = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    file = tmp_path_factory.mktemp("mesh") / "cube.stl"
    meshio.write_points_cells(file, points, [("triangle", ConvexHull(points).simplices)])
    return str(file)


def cube(file, subspheres=200, turn=None, restitution=1.0, friction=0.0, speed_m_s=SPEED_m_s, each=None, **changes):
    """A cube of coal on a rigid plate, as it stands or turned."""
    one = {"material": "coal", "radius_m": SIDE_m * (3 / 4 / np.pi) ** (1 / 3), "shape": "cube", "place_m": [0.0, 0.0],
           "velocity_m_s": speed_m_s}
    if turn is not None:
        one["attitude"] = np.roll(turn.as_quat(), 1).tolist()
    contact = {"restitution": restitution, "friction": friction}
    return changed("single", {
        **dict.fromkeys(ALL), "stones.each": [one | (each or {})], "stones.seed": 3, "shapes.cube": file, "assumptions": None,
        "time.view_interval_s": None, "stones.agglomerate": {"subspheres": subspheres, "unbreakable": True, "contact": "faces"},
        "time.gravity_m_s2": 0.0, "time.duration_s": 1.5e-4, "time.sample_interval_s": 3e-5, "plate": dict(RIGID),
        "contacts": dict.fromkeys(("coal_plate", "coal_coal"), contact), **changes})


def test_columns_have_the_area_of_each_face_and_its_middle(cube_file):
    """So that an even pressure is an even push; and together they are the flat punch where the stone is rigid."""
    scene = cube(cube_file)
    one = prepare(scene, "scene", None).assembly
    columns = one.faces[0]
    for normal in [*np.eye(3), *-np.eye(3)]:
        here = columns.normal @ normal > 1 - 1e-9
        assert columns.area_m2[here].sum() == pytest.approx(SIDE_m**2, rel=1e-6)
        middle = columns.area_m2[here] @ one.center_m[columns.sub_sphere[here]] / SIDE_m**2
        across = (middle - one.mass_kg @ one.center_m / one.mass_kg.sum())[normal == 0]
        assert np.abs(across).max() < 0.01 * SIDE_m
        assert np.all(columns.height_m[here] > 0.99 * one.radius_m[columns.sub_sphere[here]])
    down = columns.normal[:, 2] < -0.5
    only = FaceColumns(*(getattr(columns, name)[down] for name in ("sub_sphere", "normal", "height_m", "area_m2",
                                                                   "face_radius_m")))
    punch = 2 * 2e11 * SIDE_m / np.sqrt(np.pi)
    assert column_stiffness_N_m(only, 1e20, 2e11).sum() == pytest.approx(punch, rel=1e-6)
    level = replace(only, height_m=np.full(down.sum(), 0.002))
    assert column_stiffness_N_m(level, E_Pa, 1e20).sum() == pytest.approx(E_Pa * SIDE_m**2 / 0.002, rel=1e-6)
    assert stiffest_face_N_m(one) < E_Pa * SIDE_m**2 / one.radius_m.min()


@pytest.mark.parametrize(("subspheres", "within"), [(200, 0.1), (800, 0.05)])
def test_a_face_pushes_as_an_elastic_solid(tmp_path, cube_file, subspheres, within):
    """Its first force is that of a plane wave of pressure, rho c_p A v; it lasts as long as an elastic bar's, 2 L/c, and the
    columns of its last layer longer by what the finite elements of lab/rock/faces.py do. The sub-spheres alone reach
    0.4 and 0.55 of that force."""
    found = run_scene(cube(cube_file, subspheres), "scene", tmp_path / "run")
    force = pd.read_parquet(tmp_path / "run" / "fast.parquet")["force_N"].to_numpy()
    wave_m_s = np.sqrt(E_Pa * (1 - NU) / ((1 + NU) * (1 - 2 * NU)) / DENSITY_kg_m3)
    push = np.convolve(force, np.ones(5) / 5).max()  # rows of 1 us
    assert push == pytest.approx(DENSITY_kg_m3 * wave_m_s * SIDE_m**2 * SPEED_m_s, rel=within)
    lasts_s = 1e-6 * (force > 0.05 * force.max()).sum()
    assert lasts_s == pytest.approx(2 * SIDE_m / np.sqrt(E_Pa / DENSITY_kg_m3), rel=1.5 * within)
    assert abs(found["energy"]["closure"]) < 3e-4
    assert abs(found["energy"]["contacts_unexplained_J"]) < 5e-5 * found["energy"]["impact_J"]


def test_a_face_that_is_not_parallel_presses_with_its_sub_spheres(tmp_path, cube_file):
    turn = Rotation.from_euler("y", 0.02)
    runs = [run_scene(cube(cube_file, turn=turn, **{"stones.agglomerate.contact": contact}), "scene", tmp_path / contact)
            for contact in ("faces", "sub_spheres")]
    assert runs[0]["peak_force_N"] == runs[1]["peak_force_N"]


@pytest.mark.slow
@pytest.mark.parametrize("late_s", [0.0, 2e-4, -2e-4])
def test_a_face_that_turns_into_place_in_free_flight_strikes_as_by_brute_force(tmp_path, cube_file, late_s):
    """A cube turns as it falls, and lies parallel to the plate about when its face arrives: it comes back from its flight
    in time, so that the face presses from its first touch on, twice as hard as its sub-spheres alone would. A face that
    comes back too late is found below the plate, and begins without force."""
    gap_m, spin_rad_s, angle_rad, found = 0.004, 8.0, 0.0, {}
    for _ in range(30):  # turned so far when it starts, as its lowest edge has to fall
        lower_m = SIDE_m / 2 * (np.cos(angle_rad) + np.sin(angle_rad) - 1)
        angle_rad = spin_rad_s * (gap_m + lower_m) / SPEED_m_s
    turn = Rotation.from_euler("y", -angle_rad - spin_rad_s * late_s)
    for name, tolerance, contact in (("brute", 0.0, "faces"), ("free", 1e-4, "faces"), ("spheres", 1e-4, "sub_spheres")):
        scene = cube(cube_file, turn=turn, each={"spin_rad_s": [0.0, spin_rad_s, 0.0]}, **{
            "stones.gap_m": gap_m, "time.free_flight_tolerance": tolerance, "time.duration_s": 0.013,
            "stones.agglomerate.contact": contact})
        found[name] = run_scene(scene, "scene", tmp_path / name)
    assert found["brute"]["peak_force_N"] > 1.7 * found["spheres"]["peak_force_N"]
    for what in ("peak_force_N", "impulse_N_s"):
        assert found["free"][what] == pytest.approx(found["brute"][what], rel=1e-4)


@pytest.mark.slow
def test_a_body_comes_back_before_the_co_step_in_which_it_touches(tmp_path, cube_file, monkeypatch):
    """In whichever of the seven co-steps between two looks that is: else the plate has not been asked where it is."""
    plate = read_scene(SCENES / "caving.toml").plate.model_dump(mode="json", exclude_none=True)
    turn = Rotation.from_euler("xy", [0.4, 0.3])
    monkeypatch.setattr("dem.deck.time_step.FAST_Hz", 1e5)  # rows of 7 us
    peak_N = []
    for steps in range(0, 64, 7):
        scene = cube(cube_file, 60, turn, speed_m_s=5.0, **{
            "stones.gap_m": 0.003 + 5e-6 * steps, "plate": plate | {"tilt_deg": 0.0}, "time.co_step": 7,
            "time.time_step_s": 1e-6,
            "time.free_flight_tolerance": 1e-4, "time.sample_interval_s": 2.1e-4, "time.duration_s": 1.05e-3})
        found = run_scene(scene, "scene", tmp_path / str(steps))
        assert found["dt_s"] == pytest.approx(1e-6) and found["co_step"] == 7
        peak_N.append(found["peak_force_N"])
    assert np.ptp(peak_N) < 2e-3 * np.mean(peak_N)


def test_energy_of_cubes_that_slide_break_and_are_damped(tmp_path, cube_file):
    scene = cube(cube_file, 300, Rotation.from_euler("y", 0.004), 0.9, 0.4, 4.0, {"velocity_m_s": [1.5, 0.0, -4.0]},
                 **{"stones.agglomerate.unbreakable": False, "time.duration_s": 9e-4})
    found = run_scene(scene, "scene", tmp_path / "run")
    energy = found["energy"]
    assert found["n_bonds_broken"] > 100 and energy["friction_J"] > 0.001 * energy["impact_J"]
    assert abs(energy["closure"]) < 3e-4
    assert abs(energy["contacts_unexplained_J"]) < 3e-4 * energy["impact_J"]


@pytest.mark.slow
def test_a_cube_that_lies_on_the_plate_bears_its_weight(tmp_path, cube_file):
    """Set down softly it stays on its face: the mean force is its weight, and it sinks by less than its sub-spheres would."""
    scene = cube(cube_file, restitution=0.3, friction=0.4, speed_m_s=0.01,
                 **{"time.gravity_m_s2": 9.81, "time.duration_s": 0.03, "time.sample_interval_s": 1.5e-4})
    run_scene(scene, "scene", tmp_path / "run")
    fast = pd.read_parquet(tmp_path / "run" / "fast.parquet")
    late = fast["t_s"] > 0.02
    weight = DENSITY_kg_m3 * SIDE_m**3 * 9.81
    assert fast["force_N"][late].mean() == pytest.approx(weight, rel=0.1)


def test_a_run_that_was_stopped_goes_on_bit_by_bit(runs, cube_file):
    scene = cube(cube_file, restitution=0.5, friction=0.4, speed_m_s=5.0, **{
        "stones.agglomerate.unbreakable": False, "time.sample_interval_s": 1e-5, "time.duration_s": 2e-4})
    run_scene(scene, "scene", runs / "whole")
    with pytest.raises(Stopped, match="at the checkpoint"):
        run_scene(scene, "scene", runs / "parted", walltime_s=0.0)
    resume(runs / "parted", show_progress=False)
    for name in ("signals", "fast", "breakage", "energy", "contacts"):
        one, other = (pd.read_parquet(runs / directory / f"{name}.parquet") for directory in ("whole", "parted"))
        pd.testing.assert_frame_equal(one, other, check_exact=True)
    assert len(pd.read_parquet(runs / "whole" / "breakage.parquet")) > 10


@pytest.mark.slow
def test_two_ranks_and_a_stone_that_comes_late_find_the_same_contact(tmp_path, cube_file):
    found = []
    for name, ranks, arrival_s in (("one", 1, 0.0), ("two", 2, 0.0), ("late", 1, 3e-3)):
        each = {"arrival_s": arrival_s} if arrival_s else {}
        scene = cube(cube_file, friction=0.4, each=each, **{"time.free_flight_tolerance": 1e-3 if arrival_s else 0.0,
                                                            "time.duration_s": 3e-4 + arrival_s})
        model, directory = prepare(scene, "scene", tmp_path), tmp_path / name
        write_deck(directory, model.scene, model.assembly, model.step, model.modes)
        run_engine(directory, (directory / "deck.liggghts").read_text(), ranks)
        column = read_ledger(directory / "ledger.bin", 1).column
        found.append([column["kinetic_J"][-1, 0], column["wall_work_J"][-1, 0]])
    assert found[1] == pytest.approx(found[0], rel=1e-6)
    assert found[2][1] == pytest.approx(found[0][1], rel=1e-3)  # it meets the plate at another part of a step


@pytest.mark.parametrize(("changes", "said"), [
    ({"plate.yield_stress_Pa": 3e8}, "plate.yield_stress_Pa = 300000000.0: must be left out where"),
    ({"stones.each": [{"material": "coal", "radius_m": 0.02, "place_m": [0.0, 0.0], "velocity_m_s": 1.0}]},
     "stones.agglomerate.contact = 'faces': must be .* where all stones are spheres"),
])
def test_what_has_no_faces_is_refused(cube_file, changes, said):
    with pytest.raises(InputError, match=said):
        cube(cube_file, **changes)


def test_faces_of_a_larger_and_turned_stone_are_the_same_ones(cube_file):
    small, large = (prepare(cube(cube_file, turn=turn, each={"radius_m": radius}), "scene", None)
                    for turn, radius in ((None, 0.02), (Rotation.from_euler("x", 0.3), 0.04)))
    one, other = assemble(small.scene, small.assembly.stones).faces[0], large.assembly.faces[0]
    assert other.area_m2 == pytest.approx(4 * one.area_m2) and other.height_m == pytest.approx(2 * one.height_m)
    assert np.allclose(other.normal, Rotation.from_euler("x", 0.3).apply(one.normal))


def deck_of_cube(directory, scene, change):
    """Write the deck of a scene with `change` applied to its text, run it, and return the ledger's columns."""
    model = prepare(scene, "scene", directory.parent)
    write_deck(directory, model.scene, model.assembly, model.step, model.modes)
    run_engine(directory, change((directory / "deck.liggghts").read_text()))
    return model, {name: rows[:, 0] for name, rows in read_ledger(directory / "ledger.bin", 1).column.items()}


def test_pressure_under_a_face_is_its_force_over_its_area(tmp_path, cube_file):
    """It is recorded as the sphere on which Hertz' largest pressure, cbrt(6 F E*^2/(pi^3 R^2)), is that one, and the
    deepest contact as the depth over radius at which it is, p = 2 E*/pi sqrt(d/R)."""
    scene = cube(cube_file, **{"time.free_flight_tolerance": 0.0})
    model, column = deck_of_cube(tmp_path / "deck", scene, lambda text: re.sub(
        r"contacts.bin every \d+", "contacts.bin every 1", text))
    faces, data, at, records = model.assembly.faces[0], (tmp_path / "deck" / "contacts.bin").read_bytes(), 0, []
    while at < len(data):
        count = np.frombuffer(data, "<i8", 2, at)[1]
        records.append(np.frombuffer(data, "<f8", 5 * count, at + 16).reshape(-1, 5))
        at += 16 + 40 * count
    down = faces.normal[:, 2] < -0.5
    x, y, force, radius = np.concatenate(records)[:, 1:].T
    distance, which = cKDTree(model.assembly.center_m[faces.sub_sphere[down], :2]).query(np.column_stack([x, y]))
    modulus = 1 / ((1 - NU**2) / E_Pa + (1 - 0.3**2) / 2.07e11)
    pressure = np.cbrt(6 * force * modulus**2 / (np.pi**3 * radius**2))
    assert len(force) > 1000 and distance.max() < 1e-4
    assert pressure == pytest.approx(force / faces.area_m2[down][which], rel=1e-6)
    assert 2 * modulus / np.pi * np.sqrt(column["wall_deepest"].max()) == pytest.approx(pressure.max(), rel=1e-6)


def test_a_face_that_is_found_below_the_plate_gains_nothing(tmp_path, cube_file):
    """One that is set 40 um down and moves up has neither force nor energy: it goes on as it was."""
    scene = cube(cube_file, speed_m_s=0.02, **{"time.free_flight_tolerance": 0.0, "time.sample_interval_s": 1e-5})
    text = "velocity        all set 0 0 -0.02 units box\n"
    _, column = deck_of_cube(tmp_path / "deck", scene, lambda deck: deck.replace(
        text, "velocity        all set 0 0 0.02 units box\ndisplace_atoms all move 0 0 -4e-5 units box\n"))
    assert column["kinetic_J"] == pytest.approx(column["kinetic_J"][0], rel=1e-9)
    assert np.abs(column["wall_elastic_J"]).max() == 0


def test_sub_spheres_that_broke_off_press_by_themselves(tmp_path, cube_file):
    """Those of the lowest face lose their bonds as the cube falls, and strike the plate as if it had no faces."""
    scene = cube(cube_file, speed_m_s=1.0, **{"stones.agglomerate.unbreakable": False, "time.free_flight_tolerance": 0.0,
                                              "materials.coal.bond.fracture_energy_J_m2": None, "stones.gap_m": 5e-5})

    def column_of(directory, faces):
        def change(text):
            lowest = [row[0] for row in np.loadtxt(directory / "faces.txt", skiprows=1) if row[3] < -0.5]
            bonds = np.loadtxt(directory / "bonds.txt")
            bonds[:, 7] = np.where(np.isin(bonds[:, :2], lowest).any(axis=1), 1e-9, 1e6)
            np.savetxt(directory / "bonds.txt", bonds, fmt=["%d"] * 3 + ["%.17g"] * 5)
            apart = "".join(f"set atom {int(tag)} vz {-1.01 - 1e-4 * k:.6g}\n" for k, tag in enumerate(lowest))
            return re.sub(r"velocity .*\n", lambda all_of_it: all_of_it[0] + apart, text.replace("faces faces.txt", faces))
        return deck_of_cube(directory, scene, change)[1]
    with_faces, without = column_of(tmp_path / "faces", "faces faces.txt"), column_of(tmp_path / "without", "")
    assert with_faces["broken"][-1] > 100 and without["wall_work_J"].min() < -1e-3 * without["kinetic_J"][0]
    assert with_faces["wall_work_J"] == pytest.approx(without["wall_work_J"], rel=1e-9)


def test_points_belong_to_the_nearest_of_equal_sub_spheres_whatever_their_radius():
    """The largest is at height 0 of the power distance, where rounding must not make it less."""
    center = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    for radius_m in np.random.default_rng(1).uniform(1e-3, 3e-3, 500):
        packing = Packing(center, np.full(3, radius_m), SphereContainer(1.0))
        assert _owner(packing, np.arange(3), center + 0.1).tolist() == [0, 1, 2]
