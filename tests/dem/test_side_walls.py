"""Walls that stand on the edges of the plate: the law of the plate's contact turned upright, impulse and energy."""

from xml.etree import ElementTree

import meshio
import numpy as np
import pandas as pd
import pytest
from decks import Body, deck, frames, ledger, run_engine, write_files
from test_checkpoint_engine import engine, stopped_at_next
from test_stream import PLATE as PLATE_OF_STREAMS, STREAMS, engine_run, scene_of, set_checkpoints, written

from common.tables import InputError
from dem.run.energy_balance import PlateEnergy, energy_ledger, read_ledger, stone_energies
from dem.run.run import run_scene
from dem.stones.arrangement import stones_of

RADIUS_m, AT_m = 3e-3, 0.02
SIDES = {  # rectangle, and how a direction in front of the plate (z away from it) stands in front of the wall
    "x_plus": (f"{AT_m} {AT_m} -0.05 0.05 -0.01 0.1", [[0, 0, -1], [0, 1, 0], [1, 0, 0]]),
    "x_minus": (f"-{AT_m} -{AT_m} -0.05 0.05 -0.01 0.1", [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]),
    "y_plus": (f"-0.05 0.05 {AT_m} {AT_m} -0.01 0.1", [[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "y_minus": (f"-0.05 0.05 -{AT_m} -{AT_m} -0.01 0.1", [[1, 0, 0], [0, 0, 1], [0, -1, 0]]),
}
PLATE = ("fix plate all wall/plate agglomerates agglomerates.txt forces forces.bin extent -1 1 -1 1 co_step 1 "
         "contact model hertz tangential history primitive type 2 zplane 0.0\n")
NO_FRICTION_AND_ELASTIC = {"0.5 0.5 0.5 0.5": "0 0 0 0", "0.9 0.9 0.9 0.9": "1 1 1 1"}


def wall_line(box, every=10):
    return (f"fix side all wall/side agglomerates agglomerates.txt forces side.bin every {every} box {box} "
            f"contact model hertz tangential history primitive type 2 zplane 0.0\n")


def throw(directory, place, velocity, lines, steps=6000, law=()):
    """One sphere; returns its frames, the ledger, and the force on the wall, rows of step and (3,)."""
    directory.mkdir()
    body = Body(np.array([place]), np.full(1, RADIUS_m), np.zeros((0, 2), int), np.zeros(0))
    write_files(directory, body)
    text = deck(2e-7, steps, 10, lines=lines, velocity=f"velocity all set {' '.join(map(repr, velocity))} units box\n")
    for old, new in dict(law).items():
        text = text.replace(old, new)
    run_engine(directory, text)
    row = np.dtype([("step", "<i8"), ("force", "<f8", (3,))])
    pushed = np.fromfile(directory / "side.bin", row) if (directory / "side.bin").exists() else np.zeros(0, row)
    return frames(directory), {name: rows[:, 0] for name, rows in ledger(directory).column.items()}, pushed


@pytest.mark.parametrize(("law", "within"), [
    ({}, 5e-3), ({"0.9 0.9 0.9 0.9": "1 1 1 1"}, 1e-4), ({"0.9 0.9 0.9 0.9": "1 1 1 1", "0.5 0.5 0.5 0.5": "0.1 0.1 0.1 0.1"}, 1e-4)],
    ids=["damped", "sticks", "slides"])
def test_all_that_the_contact_with_the_plate_holds_and_takes_adds_up_at_every_instant(tmp_path, law, within):
    """Kinetic energy, that of Hertz' and of Mindlin's spring, dashpots and friction; when it is over, to 1e-5."""
    place, velocity = [0.0, 0.0, RADIUS_m + 1.99e-5], [0.8, 0.25, -1.0]
    _, c, _ = throw(tmp_path / "run", place, velocity, PLATE, steps=700, law=law)
    held = c["kinetic_J"] + c["wall_elastic_J"]
    gone = held + c["wall_damped_J"] + c["friction_J"] - c["springs_gained_J"] - held[0]
    assert c["wall_elastic_J"].max() > 0.4 * held[0] and c["wall_elastic_J"][-1] == 0
    assert np.abs(gone).max() < within * held[0]
    assert abs(gone[-1]) < 1e-5 * held[0]


AWAY_m, OBLIQUE_m_s = np.array([0, 0, RADIUS_m + 1.99e-5]), np.array([0.4, 0.25, -1.0])


@pytest.fixture(scope="module")
def on_the_plate(tmp_path_factory):
    """An oblique throw at the stock wall at z = 0."""
    return throw(tmp_path_factory.mktemp("flat") / "plate", AWAY_m.tolist(), OBLIQUE_m_s.tolist(), PLATE)


@pytest.mark.parametrize("side", SIDES)
def test_a_wall_is_the_plate_turned_upright(tmp_path, on_the_plate, side):
    """Obliquely, with friction and dashpot: places, velocities and spins are those in front of the stock wall at z = 0,
    turned, and so are the energies in the ledger. The wall feels the opposite of what the sphere felt."""
    box, turn = SIDES[side]
    turn = np.array(turn, dtype=float)
    flat, energy, _ = on_the_plate
    corner = (AT_m if side.endswith("plus") else -AT_m) * np.array([side[0] == "x", side[0] == "y", 0])
    seen, found, pushed = throw(tmp_path / "wall", (turn @ AWAY_m + corner + [0, 0, 0.05]).tolist(),
                                (turn @ OBLIQUE_m_s).tolist(), wall_line(box))
    assert seen.v[:, 0] == pytest.approx(flat.v[:, 0] @ turn.T, abs=1e-7)
    assert seen.omega[:, 0] == pytest.approx(flat.omega[:, 0] @ turn.T, abs=1e-4 * np.abs(flat.omega).max())
    assert np.abs(flat.omega).max() > 10 and flat.v[-1, 0, 2] > 0.8
    for name in ("kinetic_J", "wall_work_J", "wall_damped_J", "friction_J", "springs_gained_J", "wall_elastic_J"):
        assert found[name] == pytest.approx(energy[name], abs=1e-7 * energy["kinetic_J"][0]), name
    impulse = 10 * 2e-7 * pushed["force"].sum(axis=0)
    assert impulse == pytest.approx(-seen.mass[0, 0] * (seen.v[-1, 0] - seen.v[0, 0]), rel=1e-9)


def test_an_elastic_smooth_wall_mirrors_the_velocity(tmp_path):
    box, _ = SIDES["y_plus"]
    seen, found, _ = throw(tmp_path / "run", [0, AT_m - RADIUS_m - 2e-5, 0.05], [0.3, 1.0, -0.2], wall_line(box),
                           law=NO_FRICTION_AND_ELASTIC)
    assert seen.v[-1, 0] == pytest.approx([0.3, -1.0, -0.2], abs=1e-4)
    assert found["kinetic_J"][-1] == pytest.approx(found["kinetic_J"][0], rel=1e-4)


@pytest.mark.parametrize("place, velocity, turned", [
    ([0, AT_m + 1.5e-3, 0.1 + RADIUS_m], [0.0, 0.0, -1.0], 30.0),   # beside the middle of the upper edge
    ([0, AT_m, 0.1 + RADIUS_m], [0.0, 0.0, -1.0], 0.0),             # on it
    ([0.05 + RADIUS_m, AT_m, 0.05], [-1.0, 0.0, 0.0], 0.0),         # against its end
])
def test_the_edges_of_a_wall_push_away_from_their_nearest_point(tmp_path, place, velocity, turned):
    """A sphere turns its velocity about the line from the nearest point of the wall to its centre."""
    box, _ = SIDES["y_plus"]
    place = np.array(place) + 2e-5 * -np.array(velocity)
    seen, _, _ = throw(tmp_path / "run", place.tolist(), velocity, wall_line(box), law=NO_FRICTION_AND_ELASTIC)
    normal = -np.array(velocity) * np.cos(np.radians(turned)) + [0, np.sin(np.radians(turned)), 0]
    assert seen.v[-1, 0] == pytest.approx(velocity - 2 * np.dot(velocity, normal) * normal, abs=0.02)


def test_above_and_beyond_a_wall_nothing_is_felt(tmp_path):
    box, _ = SIDES["y_plus"]
    seen, _, pushed = throw(tmp_path / "run", [0, AT_m - RADIUS_m - 2e-5, 0.1 + 1.01 * RADIUS_m], [0.0, 1.0, 0.0],
                            wall_line(box))
    assert len(pushed) == 0 and np.all(seen.v[:, 0] == [0.0, 1.0, 0.0])


CHUTE = PLATE_OF_STREAMS | {"size_m": [0.2, 0.08], "tilt_deg": 25.0,
                            "wall_height_m": {"y_minus": 0.04, "y_plus": 0.04}}
IN_CHUTE = [{"place_m": [-0.05, 0.02], "velocity_m_s": (0.1, 2.0, -0.5)},
            {"place_m": [-0.05, -0.02], "velocity_m_s": (0.3, -1.5, -0.6), "spin_rad_s": (20.0, 0.0, 0.0)}]


@pytest.fixture(scope="module")
def in_chute(tmp_path_factory):
    """Two stones fly to and fro between the walls of a chute, with bodies in free flight and by brute force."""
    out = tmp_path_factory.mktemp("chute")
    return [run_scene(scene_of(IN_CHUTE, 0.06, plate=CHUTE, **{"time.free_flight_tolerance": tolerance,
                                                               "time.view_interval_s": pictures_s}), "scene",
                      out / name) for name, tolerance, pictures_s in (("free", 1e-4, 0.02), ("brute", 0.0, None))] + [out]


def test_walls_work_together_with_free_flight(in_chute):
    free, brute, _ = in_chute
    assert free["wall_time_s"]["engine and plate"] < brute["wall_time_s"]["engine and plate"] / 2
    for edge, impulse in brute["wall_impulse_N_s"].items():
        assert free["wall_impulse_N_s"][edge] == pytest.approx(impulse, abs=0.01 * max(map(abs, impulse)))
        assert abs(impulse[1]) > 0.01 and abs(impulse[2]) > 1e-4  # pushed and rubbed
    assert free["energy"]["kinetic_J"] == pytest.approx(brute["energy"]["kinetic_J"], rel=0.01)


def test_walls_are_in_every_picture_where_they_stand(in_chute):
    out = in_chute[2] / "free"
    entries = [one.attrib for one in ElementTree.parse(out / "view.pvd").iter("DataSet")]
    times = {name: [one["timestep"] for one in entries if name in one["file"]] for name in ("particles", "walls")}
    assert times["walls"] == times["particles"] and len(times["walls"]) > 3
    assert {one["file"] for one in entries if one["part"] == "5"} == {"view/walls.vtu"}
    alone = ElementTree.parse(out / "view" / "walls.pvd").iter("DataSet")
    assert {one.get("file") for one in alone} == {"walls.vtu"}
    mesh = meshio.read(out / "view" / "walls.vtu")
    assert np.ravel(mesh.cell_data["wall"][0]).tolist() == [1, 2]
    for quad, y in zip(mesh.cells_dict["quad"], (-0.04, 0.04), strict=True):
        corner = mesh.points[quad]
        assert corner.min(axis=0) == pytest.approx([-0.1, y, -0.01]) and corner.max(axis=0) == pytest.approx([0.1, y, 0.04])
        around = np.diff(np.vstack([corner, corner[:1]]), axis=0)
        assert np.linalg.norm(around, axis=1) == pytest.approx([0.2, 0.05, 0.2, 0.05])  # in order, not crossed


def test_energy_and_momentum_close_in_a_chute(in_chute):
    for run in in_chute[:2]:
        assert abs(run["energy"]["closure"]) < 2e-3
        mass = 2 * 1380.0 * 4 / 3 * np.pi * 0.01**3
        weight = mass * 9.8 * np.cos(np.radians(25.0)) * run["steps"] * run["dt_s"]
        of_walls = -sum(impulse[2] for impulse in run["wall_impulse_N_s"].values())
        assert run["impulse_N_s"] + of_walls - weight == pytest.approx(run["momentum_change_kg_m_s"],
                                                                       abs=1e-3 * run["impulse_N_s"])
        assert run["impulse_N_s"] - weight != pytest.approx(run["momentum_change_kg_m_s"], abs=1e-3 * run["impulse_N_s"])


def test_forces_on_walls_are_kept_and_do_not_load_the_plate(in_chute):
    free, _, out = in_chute
    walls, stones = pd.read_parquet(out / "free" / "walls.parquet"), pd.read_parquet(out / "free" / "stones.parquet")
    assert set(walls["wall"]) == {"y_minus", "y_plus"} and walls["t_s"].is_monotonic_increasing
    outwards = walls["force_y_N"] * np.where(walls["wall"] == "y_plus", 1, -1)
    assert outwards.min() > -0.05 * outwards.max()  # the stock dashpot pulls a little as a contact ends
    assert stones["impulse_N_s"].sum() == pytest.approx(free["impulse_N_s"])


def engine_ends(directory, resume=0):
    process = engine(directory, 1, resume)
    output = process.communicate(timeout=120)[0]
    assert process.returncode == 0, output[-1500:]


@pytest.fixture(scope="module")
def over_a_wall(tmp_path_factory):
    """Of a stream, one stone hops over a wall, one leaves the chute at its end, and one is still to come."""
    directory = tmp_path_factory.mktemp("over") / "deck"
    each = [{"place_m": [-0.05, 0.0], "velocity_m_s": (0.0, 0.7, -1.3)},
            {"place_m": [0.08, -0.025], "velocity_m_s": (1.0, -0.5, -0.6), "arrival_s": 0.07},
            {"place_m": [0.0, 0.0], "velocity_m_s": (0.0, 0.0, -0.6), "arrival_s": 1.0}]
    return engine_run(directory, scene_of(each, 0.3, plate=CHUTE | {"tilt_deg": 0.0})), directory


def test_stones_that_leave_a_chute_are_taken_out(over_a_wall):
    model, directory = over_a_wall
    gone = pd.read_csv(directory / "left.csv")
    assert sorted(gone.agglomerate) == [1, 2] and (gone.z_m < -0.01).all()
    first, second = (gone[gone.agglomerate == k].iloc[0] for k in (1, 2))
    assert first.y_m > 0.04 + 0.01 and second.x_m > 0.1
    pushed = {edge: (directory / f"wall_{edge}.bin").stat().st_size for edge in ("y_minus", "y_plus")}
    assert pushed["y_plus"] == 0 and pushed["y_minus"] > 0
    ledger = read_ledger(directory / "ledger.bin", 3)
    parts = stone_energies(ledger, 9.8, model.assembly.mass_height_kg_m)
    energy = energy_ledger(parts, PlateEnergy(), ledger.has_entered[-1] * model.assembly.kinetic_start_J)
    assert abs(energy["closure"]) < 2e-3


def test_a_run_in_a_chute_that_is_taken_up_is_the_undisturbed_one(over_a_wall, tmp_path):
    """Stopped while a stone pushes on a wall: its spring and the row of forces go on."""
    model, seen = over_a_wall
    sample = model.step.sample_steps
    rows = np.fromfile(seen / "wall_y_minus.bin", [("step", "<i8"), ("force", "<f8", (3,))])
    step = next(int(row) for row in rows["step"] if row % sample == 0)
    for name in ("whole", "parts"):
        written(tmp_path / name, model.given)
        set_checkpoints(tmp_path / name, step)
    engine_ends(tmp_path / "whole")
    code, output, stopped = stopped_at_next(tmp_path / "parts", 1)
    assert (code, stopped) == (75, step), output[-1500:]
    engine_ends(tmp_path / "parts", step)
    for name in (*STREAMS, "wall_y_minus.bin", "wall_y_plus.bin"):
        whole = tmp_path / "whole" / name
        assert not whole.exists() or (tmp_path / "parts" / name).read_bytes() == whole.read_bytes(), name


def test_a_scene_without_walls_has_none_in_its_deck(tmp_path):
    written(tmp_path / "deck", scene_of(IN_CHUTE, 0.01))
    assert "wall/side" not in (tmp_path / "deck" / "deck.liggghts").read_text()


@pytest.mark.parametrize("plate, each, said", [
    ({"walls": {"edges": ["y_plus"], "height_m": 0.1}}, {}, "plate.walls = .*: unknown key; use plate.wall_height_m"),
    ({"wall_height_m": {"left": 0.1}}, {}, "plate.wall_height_m.left"),
    ({"wall_height_m": {"y_plus": 0.0}}, {}, "plate.wall_height_m.y_plus = 0.0: must be greater than 0"),
    ({"wall_height_m": {"y_plus": 0.1}}, {"place_m": [-0.05, 0.035]}, "stone 1, .* would come through this wall"),
    ({"wall_height_m": {"x_minus": 1.0}}, {"velocity_m_s": (2.0, 0.0, -1.0), "arrival_s": 0.1},
     "x_minus: stone 1, .* would come through this wall"),
])
def test_bad_walls_are_refused_in_one_line(plate, each, said):
    with pytest.raises(InputError, match=said) as refused:
        stones_of(scene_of([IN_CHUTE[0] | each], 0.01, plate=CHUTE | plate), "scene")
    assert "\n" not in str(refused.value)
